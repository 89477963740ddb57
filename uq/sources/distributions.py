"""Probability distributions as pytrees: moments of a quantity, and draws from a key.

The names and parameters are those of JCGM 101:2008, 6.4. Parameters may be arrays, one value per axis; a draw's shape
ends with theirs. A value is a function of one or two coordinates of the unit cube that has the distribution where they
are uniform: in a draw they come from a key, for quasi-random trials from Sobol's sequence. Draws depend on the key, the
shape and the dtype alone.
"""

import math
from abc import abstractmethod
from typing import TYPE_CHECKING, Any, ClassVar

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Key

from identify.pytree import Pytree
from identify.rigid_body.regressor import library_of

Value = Any
"""A number or an array of numbers."""


class Distribution(Pytree):
    """The probability distribution of a quantity."""

    uniforms: ClassVar[int] = 1
    """Coordinates that a value takes."""

    if TYPE_CHECKING:  # fields in some distributions, properties in others

        @property
        def mean(self) -> Value:
            """Expectation of the value, its best estimate."""

        @property
        def standard_deviation(self) -> Value:
            """Standard deviation of the value, its standard uncertainty."""

        @property
        def degrees_of_freedom(self) -> Value:
            """Degrees of freedom of the standard uncertainty (GUM G.4.2); infinite unless stated."""

    skewness: ClassVar[Any] = 0.0
    """Third central moment over the cube of the standard deviation; zero of a symmetric distribution."""
    excess_kurtosis: ClassVar[Any] = 0.0
    """Fourth central moment over the fourth power of the standard deviation, less the 3 of a normal distribution."""

    def draw(self, key: Key[Array, ""], shape: tuple[int, ...] = (), dtype: Any = None) -> Float[Array, "..."]:
        """Return independent draws.

        Args:
            key: where the draws come from.
            shape: shape of the result, to which the parameters are broadcast.
            dtype: float32 or float64; None for JAX's default float.
        """
        dtype = jax.dtypes.canonicalize_dtype(float) if dtype is None else dtype
        return self.at(random_point(key, self.coordinates(shape), dtype), shape)

    @abstractmethod
    def at(self, point: Float[Array, " coordinates"], shape: tuple[int, ...] = ()) -> Float[Array, "..."]:
        """Return the values at a point of the open unit cube with :meth:`coordinates`; ``shape`` as for a draw."""

    def coordinates(self, shape: tuple[int, ...] = ()) -> int:
        """Return how many coordinates values of this shape take."""
        return self.uniforms * math.prod(shape)


class Normal(Distribution):
    """Gaussian distribution (JCGM 101, 6.4.7)."""

    mean: Value
    standard_deviation: Value
    degrees_of_freedom: Value = np.inf

    def __post_init__(self) -> None:
        _require("standard_deviation", "zero or more", self.standard_deviation, lambda s: s >= 0)

    def at(self, point: Array, shape: tuple[int, ...] = ()) -> Array:
        """Return the quantiles of these probabilities."""
        return _located(self.mean, self.standard_deviation, jax.scipy.special.ndtri(point.reshape(shape)))


class Bounded(Distribution):
    """A symmetric distribution between two limits, drawn as a function of uniform numbers."""

    ratio: ClassVar[float]
    """Half-width over the standard deviation."""
    low: Value
    high: Value

    def __post_init__(self) -> None:
        if not isinstance(self.low, jax.core.Tracer):
            _require("high", "low or more", self.high, lambda high: high >= np.asarray(self.low))

    @property
    def mean(self) -> Value:
        """Middle of the interval."""
        return (self.low + self.high) / 2

    @property
    def standard_deviation(self) -> Value:
        """The half-width over :attr:`ratio`."""
        return (self.high - self.low) / 2 / self.ratio

    def at(self, point: Array, shape: tuple[int, ...] = ()) -> Array:
        """Return the values of these uniform numbers."""
        return self._transformed(point.reshape(self.uniforms, *shape))

    @abstractmethod
    def _transformed(self, uniform: Float[Array, "uniforms ..."]) -> Array:
        """The values of uniform numbers."""

    def _between(self, fraction: Array) -> Array:
        """The value that lies this fraction of the way from low to high."""
        return _located(self.low, self.high - self.low, fraction)


class Rectangular(Bounded):
    """All values between two limits are equally probable (JCGM 101, 6.4.2)."""

    ratio = np.sqrt(3)
    excess_kurtosis = -1.2
    degrees_of_freedom: Value = np.inf

    def _transformed(self, uniform: Array) -> Array:
        return self._between(uniform[0])


class Triangular(Bounded):
    """Symmetric triangle between two limits (JCGM 101, 6.4.5): the average of two rectangular ones."""

    uniforms: ClassVar[int] = 2
    ratio = np.sqrt(6)
    excess_kurtosis = -0.6
    degrees_of_freedom: Value = np.inf

    def _transformed(self, uniform: Array) -> Array:
        return self._between((uniform[0] + uniform[1]) / 2)


class UShaped(Bounded):
    """Arc sine between two limits: a quantity that cycles sinusoidally, seen at a random instant (JCGM 101, 6.4.6)."""

    ratio = np.sqrt(2)
    excess_kurtosis = -1.5
    degrees_of_freedom: Value = np.inf

    def _transformed(self, uniform: Array) -> Array:
        return self._between((1 + jnp.sin(2 * np.pi * uniform[0])) / 2)


BETWEEN_LIMITS: dict[str, type[Bounded]] = {"rectangular": Rectangular, "triangular": Triangular, "u_shaped": UShaped}
"""Distributions that two limits alone determine, by their names in files."""


class StudentT(Distribution):
    """Scaled and shifted t: the mean of a few indications, ``scale = s / √n``, ``n - 1`` degrees (JCGM 101, 6.4.9).

    The standard deviation, ``scale √(ν / (ν - 2))``, is larger than the scale, which is what the GUM's own law takes
    for standard uncertainty; it is infinite for ν ≤ 2.
    """

    uniforms: ClassVar[int] = 2
    mean: Value
    scale: Value
    degrees_of_freedom: Value

    def __post_init__(self) -> None:
        _require("scale", "zero or more", self.scale, lambda s: s >= 0)
        _require("degrees_of_freedom", "above zero", self.degrees_of_freedom, lambda n: n > 0)

    @property
    def standard_deviation(self) -> Value:
        """Standard deviation of the distribution; infinite for two degrees of freedom or fewer."""
        xp = library_of(self.scale, self.degrees_of_freedom)
        nu = xp.asarray(self.degrees_of_freedom, float)
        finite = nu > 2
        return xp.where(finite, self.scale / xp.sqrt(1 - 2 / xp.where(finite, nu, 4.0)), np.inf)

    @property
    def excess_kurtosis(self) -> Value:
        """Excess kurtosis 6/(ν - 4) of ν degrees of freedom; infinite for four or fewer."""
        nu = np.asarray(self.degrees_of_freedom, float)
        return np.where(nu > 4, 6 / np.where(nu > 4, nu - 4, 1), np.inf)

    def at(self, point: Array, shape: tuple[int, ...] = ()) -> Array:
        """Return the values of these uniform numbers (Bailey 1994, doi:10.1090/S0025-5718-1994-1219705-3)."""
        first, second = point.reshape(2, *shape)
        mean, scale, nu = (_over(x, shape, point.dtype) for x in (self.mean, self.scale, self.degrees_of_freedom))
        finite = jnp.where(jnp.isinf(nu), 1, nu)
        square = jnp.where(jnp.isinf(nu), -2 * jnp.log(first), finite * jnp.expm1(-2 / finite * jnp.log(first)))
        return mean + scale * jnp.sqrt(square) * jnp.cos(2 * np.pi * second)


class Empirical(Distribution):
    """A finite set of equally likely values; or of rows of values that belong together, shape (n, k)."""

    samples: Float[Array | np.ndarray, " n *k"]

    def __post_init__(self) -> None:
        if np.ndim(self.samples) not in (1, 2) or len(self.samples) < 2:
            raise ValueError(
                f"Argument `samples` must be two or more values or rows, but has shape {np.shape(self.samples)}."
            )
        _require("samples", "finite", self.samples, np.isfinite)

    @property
    def mean(self) -> Value:
        """Mean of the values, axis by axis."""
        return jnp.mean(jnp.asarray(self.samples), axis=0)

    @property
    def standard_deviation(self) -> Value:
        """Standard deviation of the values, each with probability 1/n, axis by axis."""
        return jnp.std(jnp.asarray(self.samples), axis=0)

    @property
    def degrees_of_freedom(self) -> Value:
        """One less than there are samples."""
        return len(self.samples) - 1

    @property
    def skewness(self) -> Value:
        """Skewness of the values, axis by axis."""
        return self._moment(3)

    @property
    def excess_kurtosis(self) -> Value:
        """Excess kurtosis of the values, axis by axis."""
        return self._moment(4) - 3

    def _moment(self, order: int) -> np.ndarray:
        samples = np.asarray(self.samples)
        away = samples - samples.mean(axis=0)
        return np.mean((away / samples.std(axis=0)) ** order, axis=0)

    def coordinates(self, shape: tuple[int, ...] = ()) -> int:
        """Return how many values there are in this shape; or rows, with whose length it ends."""
        count, row = len(shape) - np.ndim(self.samples) + 1, np.shape(self.samples)[1:]
        if shape[count:] != row:
            raise ValueError(f"Argument `shape` must end with {row}, but is {shape}.")
        return math.prod(shape[:count])

    def at(self, point: Array, shape: tuple[int, ...] = ()) -> Array:
        """Return the values, or rows, in order of their place in the set."""
        place = jnp.floor(point * len(self.samples)).astype(int)
        return jnp.asarray(self.samples, point.dtype)[place].reshape(shape)


def random_point(key: Key[Array, ""], coordinates: int, dtype: Any) -> Float[Array, " coordinates"]:
    """Return a point of the open unit cube; each coordinate depends on the key and on its place alone."""
    point = jax.random.uniform(key, (coordinates,), dtype)
    return point + jnp.finfo(point.dtype).epsneg  # half a step: at 0 a normal value would be infinite


def _over(value: Value, shape: tuple[int, ...], dtype: Any) -> Array:
    return jnp.broadcast_to(jnp.asarray(value, dtype), shape)


def _located(start: Value, width: Value, standard: Array) -> Array:
    """``start + width * standard``, of the shape and precision of the last."""
    return _over(start, standard.shape, standard.dtype) + _over(width, standard.shape, standard.dtype) * standard


def _require(name: str, what: str, value: Value, holds: Any) -> None:
    """Refuse a parameter that cannot be; one that JAX traces is taken as it is."""
    if not isinstance(value, jax.core.Tracer) and not np.all(holds(np.asarray(value))):
        raise ValueError(f"Argument `{name}` must be {what}, but is {value}.")
