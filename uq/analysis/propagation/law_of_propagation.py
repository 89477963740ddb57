"""The GUM's law of propagation for a measurement model, its derivatives by automatic differentiation.

A model is a function of ONE trial's inputs, the same that a Monte Carlo runs. Inputs are independent of one another;
the coordinates of one input may be correlated.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from typing import Any, NamedTuple, Protocol, runtime_checkable

import jax
import jax.numpy as jnp
import numpy as np
import scipy
from jaxtyping import Array, Float

from identify.display.reporting import Result
from identify.floating_point import check_precision
from identify.least_squares.covariance_matrices import root_of
from uq.monte_carlo.coverage.expanded_uncertainty import welch_satterthwaite


@runtime_checkable
class Input(Protocol):
    """An input's distribution as the law needs it; one with a ``covariance`` has correlated coordinates."""

    @property
    def mean(self) -> Array | np.ndarray:
        """Best estimate, of any shape."""

    @property
    def standard_deviation(self) -> Array | np.ndarray:
        """Standard deviation, of the mean's shape."""

    @property
    def degrees_of_freedom(self) -> float | Array | np.ndarray:
        """Degrees of freedom of the standard uncertainty; infinite when it is known."""


Model = Callable[[dict[str, Array]], Array]


@dataclass(frozen=True, repr=False)
class LinearLaw(Result):
    """A measurand by the law of propagation. Matrices are over the measurand's m components, flattened.

    Example: ``propagate(lambda x: x["a"] * x["b"], {"a": Normal(1.0, 0.1), "b": Normal(2.0, 0.3)}).to_frame()``.
    """

    value: np.ndarray
    """The model at the inputs' estimates (GUM 4.1.4), of the measurand's own shape."""
    covariance: np.ndarray
    """First-order covariance (m, m), ``J Σ Jᵀ`` (GUM 5.1.2, JCGM 102 6.2)."""
    contributions: Mapping[str, np.ndarray]
    """Each input's part of the covariance (m, m); their sum is the covariance."""
    degrees_of_freedom: np.ndarray
    """Effective degrees of freedom (m,) by Welch and Satterthwaite (GUM G.4.1); infinite where every input is known."""
    second_order_mean: np.ndarray
    """``value + ½ tr(H Σ)``, of the measurand's shape: where the model's curvature moves the mean."""
    second_order_covariance: np.ndarray
    """Covariance (m, m) with the next order of the GUM's note to 5.1.2, for normal inputs."""

    @property
    def standard_uncertainty(self) -> np.ndarray:
        """Combined standard uncertainty of first order, of the measurand's shape."""
        return np.sqrt(np.diag(self.covariance)).reshape(self.value.shape)

    def coverage_interval(self, probability: float = 0.95) -> tuple[np.ndarray, np.ndarray]:
        """Return the ends of ``value ± k u``, k from Student's t at the effective degrees of freedom (GUM G.3, G.4)."""
        k = scipy.special.stdtrit(self.degrees_of_freedom, (1 + probability) / 2).reshape(self.value.shape)
        half = k * self.standard_uncertainty
        return np.asarray(self.value - half), np.asarray(self.value + half)

    def records(self) -> list[dict[str, Any]]:
        """Return the same as numbers, in the measurand's unit."""
        columns = self.columns()
        return [dict(zip(columns, row, strict=True)) for row in zip(*columns.values(), strict=True)]

    def columns(self) -> dict[str, np.ndarray]:
        """Return estimate, standard uncertainty, interval and contributions by their heads in a table."""
        low, high = self.coverage_interval()
        columns = {"estimate": self.value, "u": self.standard_uncertainty, "95 % from": low, "to": high,
                   "degrees of freedom": self.degrees_of_freedom}  # fmt: skip
        contributions = {
            f"u from {name}": np.sqrt(np.diag(covariance)) for name, covariance in self.contributions.items()
        }
        return {name: np.ravel(values) for name, values in (columns | contributions).items()}


class ModelExpansion(NamedTuple):
    """A model about a point, over standardised coordinates z: mean 0, covariance the unit matrix."""

    value: Array
    """Value of the model at the point, of the measurand's shape."""
    jacobian: Float[Array, "m d"]
    shift: Float[Array, " m"]
    """Second-order shift of the mean, ``½ tr H``."""
    hessian: Float[Array, "m d d"]
    slope: Float[Array, "m d"]
    """Derivative of the shift, ``½ Σ_k ∂³f/∂z ∂z_k²``."""


def expand(function: Callable[[Array], Array], size: int) -> ModelExpansion:
    """Expand a function of ``size`` standardised coordinates about zero, to the third order where the GUM needs it."""
    zero, directions = jnp.zeros(size), jnp.eye(size)
    value = function(zero)

    def flat(z):
        return jnp.ravel(function(z))

    def shift(z):
        def curvature(direction):
            # zᵀ H z of one direction by forward over forward, so that the shift itself can be differentiated once more
            return jax.jvp(lambda y: jax.jvp(flat, (y,), (direction,))[1], (z,), (direction,))[1]

        return 0.5 * jnp.sum(jax.vmap(curvature)(directions), axis=0)

    hessian = jax.jacfwd(jax.jacfwd(flat))(zero)
    return ModelExpansion(
        value=value, jacobian=jax.jacfwd(flat)(zero), shift=shift(zero), hessian=hessian, slope=jax.jacfwd(shift)(zero)
    )


def higher_order(expansion: ModelExpansion) -> Float[Array, "m m"]:
    """Return what curvature adds to normal inputs' covariance (GUM 5.1.2): ``½ tr(H_a Σ H_b Σ)`` and the ``∂f ∂³f``."""
    crossed = expansion.jacobian @ expansion.slope.T
    return 0.5 * jnp.einsum("aij,bij->ab", expansion.hessian, expansion.hessian) + crossed + crossed.T


def propagate(model: Model, inputs: Mapping[str, Input]) -> LinearLaw:
    """Propagate the inputs' uncertainties through a model by the GUM's law.

    An input with finite degrees of freedom and a ``scale`` (Student's t) enters with its scale, which is the GUM's
    standard uncertainty (4.2.3); its degrees of freedom then widen the coverage interval. Every other input enters with
    its standard deviation.

    Args:
        model: the measurement model, JAX on a dict of arrays, one trial.
        inputs: their distributions by name: mean, standard deviation or covariance, degrees of freedom.

    Returns:
        Estimate, covariance, contributions, effective degrees of freedom, and the higher orders. For inputs that are
        not normal the second-order covariance neglects the excess kurtosis of those that enter squared.

    Raises:
        ValueError: no input, or an input's covariance does not fit its mean.
    """
    if not inputs:
        raise ValueError("Argument `inputs` must hold at least one input, but is empty.")
    check_precision("float64")
    inputs = dict(sorted(inputs.items()))
    means = {name: jnp.broadcast_to(jnp.asarray(given.mean, float), _shape(given)) for name, given in inputs.items()}
    roots = {name: jnp.asarray(_root(name, given)) for name, given in inputs.items()}
    expansion = jax.tree.map(np.asarray, _expand(model, means, roots))
    # over standardised coordinates Σ is the unit matrix, so that J Σ Jᵀ (GUM 5.1.2) is a sum over the inputs
    blocks = np.split(expansion.jacobian, np.cumsum([root.shape[1] for root in roots.values()])[:-1], axis=1)
    contributions = {name: block @ block.T for name, block in zip(inputs, blocks, strict=True)}
    first = expansion.jacobian @ expansion.jacobian.T
    return LinearLaw(
        value=expansion.value, covariance=first, contributions=contributions,
        degrees_of_freedom=_degrees_of_freedom(first, zip(inputs.values(), blocks, strict=True)),
        second_order_mean=np.asarray(expansion.value + expansion.shift.reshape(expansion.value.shape)),
        second_order_covariance=first + np.asarray(higher_order(expansion)),
    )  # fmt: skip


@partial(jax.jit, static_argnames="model")
def _expand(model: Model, means: Mapping[str, Array], roots: Mapping[str, Array]) -> ModelExpansion:
    sizes = [root.shape[1] for root in roots.values()]

    def of_standardised(z):
        coordinates = dict(zip(roots, jnp.split(z, np.cumsum(sizes)[:-1]), strict=True))
        return model(
            {name: mean + (roots[name] @ coordinates[name]).reshape(mean.shape) for name, mean in means.items()}
        )

    return expand(of_standardised, sum(sizes))


def _root(name: str, given: Input) -> Float[np.ndarray, "k k"]:
    """A matrix whose product with its transpose is the covariance of an input's coordinates."""
    shape = _shape(given)
    size = int(np.prod(shape))
    if (covariance := _joint(given)) is not None:
        if np.shape(covariance) != (size, size):
            raise ValueError(
                f"Argument `inputs` must give '{name}' a covariance of shape {(size, size)}, but it has the shape "
                f"{np.shape(covariance)}."
            )
        return root_of(np.asarray(covariance, float))
    infinite_freedom = np.all(np.isinf(given.degrees_of_freedom))
    sigma = given.standard_deviation if infinite_freedom else getattr(given, "scale", given.standard_deviation)
    return np.diag(np.broadcast_to(np.asarray(sigma, float), shape).ravel())


def _shape(given: Input) -> tuple[int, ...]:
    if _joint(given) is not None:
        return np.shape(given.mean)
    return np.broadcast_shapes(np.shape(given.mean), np.shape(given.standard_deviation))


def _joint(given: Input) -> np.ndarray | None:
    """The covariance of coordinates that belong together: stated, or that of sampled rows; None if they do not."""
    samples = getattr(given, "samples", None)
    if samples is not None and np.ndim(samples) == 2:
        return np.cov(np.asarray(samples, float), rowvar=False, ddof=0).reshape(np.shape(samples)[1:] * 2)
    return getattr(given, "covariance", None)


def _degrees_of_freedom(covariance: np.ndarray, blocks) -> np.ndarray:
    """Effective degrees of freedom of each component; correlated coordinates count as one input."""
    contributions = []
    for given, block in blocks:
        squares = block**2 if _joint(given) is None else np.sum(block**2, axis=1, keepdims=True)
        freedom = np.broadcast_to(np.asarray(given.degrees_of_freedom, float), _shape(given)).ravel()
        contributions.append((squares, freedom[: squares.shape[1]]))
    return welch_satterthwaite(np.diag(covariance), contributions)
