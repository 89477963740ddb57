"""Expanded uncertainty: the coverage factor for a probability, or the probability of a factor (GUM, 6 and annex G)."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import scipy
from jaxtyping import Float

from identify.display.rounding import beside_uncertainty, decimals, exact, fixed, interval, rounded
from identify.results.identification_result import Identification
from identify.results.ledger import USUAL
from identify.results.mass_and_centre import NAMES
from identify.rigid_body.inertia import COMPONENTS

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


QUANTITY_NAMES = (*NAMES, *COMPONENTS)
"""Names of the ten parameters in a table."""
HEAD = ("value", "U", "k", "ν", "p, %", "u", "coverage interval")
"""Headings of the columns of :meth:`Expanded.rows` behind the name."""


def of_parameters(
    result: Identification, which: slice, *, factor: float | None = None, probability: float | None = None
) -> Expanded:
    """Return some of the ten parameters with their expanded uncertainty [kg, m, kg·m²].

    All figures are those of the ledger's rows: intervals at the probability that is asked for, or that a factor has,
    degrees of freedom by Welch and Satterthwaite (GUM G.4).

    Args:
        result: an identification.
        which: of the ten parameters.
        factor: the coverage factor k to use; the probability follows.
        probability: the coverage probability to use, 95 % if None; the factor follows.
    """
    u = result.parameters.standard_uncertainty
    p = np.full(10, USUAL if probability is None else probability)
    ends = result.intervals(float(p[0]))
    if factor is not None:
        p, half = _probabilities(result, factor), np.ptp(ends, axis=1) / 2
        scale = np.divide(factor * u, half, out=np.ones(10), where=half > 0)
        ends = result.value[:, None] + (ends - result.value[:, None]) * scale[:, None]
    k = np.divide(np.ptp(ends, axis=1) / 2, u, out=np.zeros(10), where=u > 0)
    return Expanded(
        names=QUANTITY_NAMES[which], value=result.value[which], standard=u[which], factor=k[which],
        probability=p[which], interval=ends[which], freedom=result.ledger.degrees_of_freedom[which],
    )  # fmt: skip


GRID = (0.3, 0.5, 0.68, 0.8, 0.9, USUAL, 0.975, 0.99, 0.995, 0.9975, 0.999)
"""Probabilities between whose intervals that of a coverage factor is interpolated: draws tell no more."""


def _probabilities(result: Identification, factor: float) -> Float[np.ndarray, "10"]:
    """Coverage probabilities of the intervals of this coverage factor."""
    halves = np.array([np.ptp(result.intervals(p), axis=1) / 2 for p in GRID])
    normal, wanted = scipy.special.ndtri((1 + np.array(GRID)) / 2), factor * result.parameters.standard_uncertainty
    # of a normal distribution the factor is the quantile itself: interpolated between those it changes little
    quantile = [np.interp(w, half, normal) if w > 0 else np.nan for w, half in zip(wanted, halves.T, strict=True)]
    return 2 * scipy.special.ndtr(np.array(quantile)) - 1


def of_tensor(result: Identification, *, factor: float | None = None, probability: float | None = None) -> Expanded:
    """Return the components with their expanded uncertainty, in kg·m²; see :func:`of_parameters`."""
    return of_parameters(result, slice(4, 10), factor=factor, probability=probability)


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
