"""Expanded uncertainty: the coverage factor for a probability, or the probability of a factor (GUM, 6 and annex G)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from jaxtyping import Float

from identify.results.identification_result import Identification
from identify.rigid_body.inertia import COMPONENTS
from identify.rounding import beside_uncertainty, decimals, exact, fixed, interval, rounded

USUAL = 0.95
"""Coverage probability of the intervals that results hold."""
MANY = 1000
"""Degrees of freedom from which they are printed as infinite: k differs by 0.1 %."""
EVEN = 0.02
"""Difference of an interval's two arms, as a part of its width, up to which it counts as symmetric."""


@dataclass(frozen=True)
class Expanded:
    """Value, standard and expanded uncertainty of some quantities, in one unit."""

    names: tuple[str, ...]
    value: Float[np.ndarray, " n"]
    standard: Float[np.ndarray, " n"]
    factor: Float[np.ndarray, " n"]
    """Half the interval over the standard uncertainty."""
    probability: Float[np.ndarray, " n"]
    interval: Float[np.ndarray, "n 2"]
    freedom: Float[np.ndarray, " n"]
    """Degrees of freedom of Student's t that has this factor at this probability; infinity: normal."""

    @property
    def expanded(self) -> Float[np.ndarray, " n"]:
        """Half of each interval."""
        return (self.interval[:, 1] - self.interval[:, 0]) / 2

    def rows(self, unit: float = 1.0) -> list[list[str]]:
        """Return name, value, U, k, ν, p, u and interval of each, rounded to two digits of U (GUM 7.2.6).

        Args:
            unit: factor to the unit that is printed.
        """
        return [self._row(k, unit) for k in range(len(self.names))]

    def _row(self, k: int, unit: float) -> list[str]:
        value, u, low, high = (unit * x for x in (self.value[k], self.standard[k], *self.interval[k]))
        half = (high - low) / 2
        if not np.isfinite([value, half, u]).all():
            ends = f"{rounded(low, u) if np.isfinite(low) else '−∞'} … {rounded(high, u) if np.isfinite(high) else '∞'}"
            return [self.names[k], rounded(value, u), *["–"] * 5, ends]
        places = decimals(half)
        below, above = fixed(value - low, places), fixed(high - value, places)
        even = abs((high - value) - (value - low)) <= EVEN * (high - low) or below == above
        return [
            self.names[k], beside_uncertainty(value, u, half), fixed(half, places) if even else f"+{above} −{below}",
            fixed(self.factor[k], 2), "∞" if self.freedom[k] >= MANY else f"{self.freedom[k]:.0f}",
            *exact([round(100 * self.probability[k], 2)]),
            fixed(u, decimals(u)),
            interval((low, high), places),
        ]  # fmt: skip


HEAD = ("value", "U", "k", "ν", "p, %", "u", "coverage interval")
"""Headings of the columns of :meth:`Expanded.rows` behind the name."""


def of_tensor(result: Identification, *, factor: float | None = None, probability: float | None = None) -> Expanded:
    """Return the components with their expanded uncertainty, in kg·m².

    The result's own intervals of 95 % stand unless another factor or probability is asked for; then they are scaled as
    Student's t says, with the degrees of freedom that their coverage factor implies.

    Args:
        result: an identification.
        factor: the coverage factor k to use; the probability follows.
        probability: the coverage probability to use; the factor follows.
    """
    ends = result.interval95
    return of_intervals(COMPONENTS, result.inertia, result.standard_uncertainty, ends, factor, probability)


def of_intervals(
    names: tuple[str, ...],
    value: Float[np.ndarray, " n"],
    u: Float[np.ndarray, " n"],
    interval95: Float[np.ndarray, "n 2"],
    factor: float | None = None,
    probability: float | None = None,
) -> Expanded:
    """Return quantities with intervals of 95 % of their own, with their expanded uncertainty; see :func:`of_tensor`."""
    usual = np.diff(interval95, axis=1)[:, 0] / 2 / np.where(u > 0, u, 1)
    freedom = np.array([degrees_of_freedom(factor) for factor in usual])
    k, p = _factor(freedom, factor, probability)
    ends = interval95
    if factor is None and probability in (None, USUAL):
        k = usual
    else:
        with np.errstate(invalid="ignore"):
            arms = (interval95 - value[:, None]) * (k / np.where(usual > 0, usual, 1))[:, None]
        ends = value[:, None] + arms
    return Expanded(names=names, value=value, standard=u, factor=k, probability=p, interval=ends, freedom=freedom)


def _factor(freedom: np.ndarray, factor: float | None, probability: float | None) -> tuple[np.ndarray, np.ndarray]:
    """Coverage factor and probability of each; one of the two may be asked for, else 95 %."""
    if factor is not None:
        return np.full(len(freedom), factor), 2 * scipy.special.stdtr(freedom, factor) - 1
    wanted = USUAL if probability is None else probability
    return scipy.special.stdtrit(freedom, (1 + wanted) / 2), np.full(len(freedom), wanted)


def welch_satterthwaite(
    variance: Float[np.ndarray, " m"], contributions: Sequence[tuple[np.ndarray, np.ndarray]]
) -> Float[np.ndarray, " m"]:
    """Return the effective degrees of freedom ``u⁴ / Σ u_i⁴ / ν_i`` of each quantity (GUM G.4.1).

    Args:
        variance: combined variance u² of each of m quantities.
        contributions: variances u_i² (m, k) of some inputs and their degrees of freedom ν_i (k,), for every input.
    """
    total = np.zeros(len(variance))
    for squares, freedom in contributions:
        total += np.sum(squares**2 / freedom, axis=1)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(total > 0, variance**2 / total, np.inf)


def degrees_of_freedom(factor: float) -> float:
    """Return the degrees of freedom of which Student's t has this coverage factor of 95 %; infinity for 1.96."""
    if not np.isfinite(factor) or factor <= float(scipy.special.ndtri((1 + USUAL) / 2)) * (1 + 1e-4):
        return np.inf
    return max(float(scipy.special.stdtridf((1 + USUAL) / 2, factor)), 0.2)
