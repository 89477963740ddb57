"""Quasi-random points: Sobol's sequence under independent random shifts, and standard errors from their spread.

A trial is a point of the unit cube, a coordinate for each number that it draws. Points of Sobol's sequence fill the
cube more evenly than random ones, so that means over them converge faster, nearly as 1/n instead of 1/√n where few
coordinates matter. The sequence is scrambled (Matoušek 1998, doi:10.1006/jcom.1998.0489): its digits are mixed
and shifted at random, so that each point is uniformly distributed and no mean is biased. But points of one shift depend
on one another, and their scatter says nothing of the mean's error. Trials therefore belong in turn to
:data:`REPLICATES` shifts drawn independently, whose figures are independent too: their spread gives the standard error.

A trial's point depends on the seed, the number of coordinates and the trial's number alone. The sequence is most even
after 2^k points, so 8 × 2^k trials say more than a few thousand beyond.
"""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Literal, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
import scipy
from jaxtyping import Array, Float, UInt32

from uq.sources.distributions import Distribution
from uq.sources.random_normals import Index

Points = Literal["quasi-random", "random"]
REPLICATES = 8
"""Number of independent shifts: more give a better standard error, but fewer points to each shift."""
BITS = 30
"""Binary digits of a coordinate."""


class SobolPoints(NamedTuple):
    """Scrambled Sobol points by the number of the trial."""

    directions: UInt32[Array, "coordinates bits"]
    """Direction numbers, multiplied by random lower triangular matrices; as many as the trials need."""
    shifts: UInt32[Array, "replicates coordinates"]
    """Each replicate's digital shift."""

    @property
    def coordinates(self) -> int:
        """Numbers in a point."""
        return self.directions.shape[0]

    def of_trial(self, trial: Index) -> Float[Array, " coordinates"]:
        """Return a trial's point, within the open unit cube."""
        return self.of_place(trial // len(self.shifts), self.shifts[trial % len(self.shifts)])

    def of_place(self, place: Index, shift: UInt32[Array, " coordinates"]) -> Float[Array, " coordinates"]:
        """Return the point of a place in the sequence under a digital shift."""
        order = jnp.asarray(place).astype(jnp.uint32)
        gray = order ^ (order >> jnp.uint32(1))  # successive points differ by one direction (Antonov, Saleev 1979)
        on = (gray >> jnp.arange(self.directions.shape[1], dtype=jnp.uint32)) & jnp.uint32(1)
        chosen = jnp.where(on[None] == 1, self.directions, jnp.uint32(0))
        word = shift ^ jax.lax.reduce(chosen, np.uint32(0), jax.lax.bitwise_xor, (1,))
        point = (word.astype(float) + 0.5) * 2.0**-BITS
        return jnp.minimum(point, 1 - jnp.finfo(point.dtype).epsneg)


def sobol_points(coordinates: int, trials: int, seed: int, *, replicates: int = REPLICATES) -> SobolPoints:
    """Return the points of trials 0 … ``trials`` - 1, and of some beyond: the same whatever their number.

    Args:
        coordinates: numbers in a point.
        trials: in all replicates together.
        seed: of the scrambling and the shifts.
        replicates: independent shifts, to which trials belong in turn.
    """
    generator = np.random.default_rng([seed % 2**64, coordinates])
    engine = scipy.stats.qmc.Sobol(coordinates, bits=BITS, rng=generator)
    first = _words(engine)
    count = max(1, (-(-trials // replicates) - 1).bit_length())
    directions = np.zeros((coordinates, count), np.uint32)
    for bit in range(count):  # in Gray code's order, the point before 2^(bit + 1) is the one of this direction alone
        engine.fast_forward(2 ** (bit + 1) - 1 - engine.num_generated)
        directions[:, bit] = _words(engine) ^ first
    shifts = generator.integers(2**BITS, size=(replicates, coordinates), dtype=np.uint32)
    return SobolPoints(jnp.asarray(directions), jnp.asarray(shifts))


def _words(engine: "scipy.stats.qmc.Sobol") -> np.ndarray:
    return np.asarray(engine.random(1)[0] * 2.0**BITS).astype(np.uint32)


def coordinates_of(inputs: Mapping[str, Distribution]) -> int:
    """Return how many coordinates one draw of every input takes."""
    return sum(given.coordinates(np.shape(given.mean)) for given in inputs.values())


def values_at(
    inputs: Mapping[str, Distribution],
    point: Float[Array, " coordinates"],
    shapes: Mapping[str, tuple[int, ...]] = MappingProxyType({}),
) -> dict[str, Float[Array, "..."]]:
    """Return one value of every input; names in alphabetical order take the point's coordinates one after the other.

    Args:
        inputs: distributions by name.
        point: of the open unit cube.
        shapes: of values that have not the shape of their mean.
    """
    values, start = {}, 0
    for name in sorted(inputs):
        shape = shapes.get(name, np.shape(inputs[name].mean))
        count = inputs[name].coordinates(shape)
        values[name] = inputs[name].at(point[start : start + count], shape)
        start += count
    return values


def standard_error(figures: Float[np.ndarray, "n *outputs"]) -> Float[np.ndarray, "*outputs"]:
    """Return the standard error of the mean of independent figures; NaN of fewer than four.

    ``√((n - 1) / (n - 3)) s / √n``, the standard deviation of the scaled t distribution that n indications leave (JCGM
    101:2008, 6.4.9.4): two of them hold the mean 95 times in a hundred, of 8 replicates as of 10,000 trials.
    """
    n = len(figures)
    if n < 4:
        return np.full(np.shape(figures)[1:], np.nan)
    return np.asarray(np.sqrt(np.square(figures - figures.mean(0)).sum(0) / (n * (n - 3))))


def of_replicates(figure: Callable[[np.ndarray], np.ndarray], trials: np.ndarray) -> np.ndarray:
    """Return what a function says of each replicate's trials, which take turns on the leading axis."""
    return np.stack([figure(trials[first::REPLICATES]) for first in range(min(REPLICATES, len(trials)))])
