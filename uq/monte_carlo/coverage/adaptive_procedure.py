"""Number of trials by the adaptive Monte Carlo of JCGM 101:2008, 7.9, and of JCGM 102:2011, 7.8.

Trials come in blocks. Each block gives its own estimate, standard uncertainty and ends of the coverage interval; their
scatter over the blocks says how well the averages are known. The clause stops when twice the standard deviations of
the averages are within the numerical tolerance. With few blocks and many figures under watch that stops too soon, too
often (Wübbeler, Harris, Cox, Elster 2010, doi:10.1088/0026-1394/47/3/023), so that here the factor is Student's t for
the number of blocks, shared out over the figures under watch (Bonferroni): never less than the clause's two.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
import scipy
from jaxtyping import Float

from uq.monte_carlo.coverage.coverage_intervals import Value, check_probability, symmetric_interval
from uq.monte_carlo.coverage.coverage_regions import Draws, covariance_of, distance, quantile, scatter_of

CONFIDENCE = 0.95
"""Probability with which all figures under watch are within their tolerances at the stop."""


def numerical_tolerance(uncertainty: Value, digits: int = 2) -> np.ndarray:
    """Return the numerical tolerance of a standard uncertainty (JCGM 101, 7.9.2).

    ``u`` with ``digits`` significant decimal digits is ``c 10^l`` with an integer c; the tolerance is ``10^l / 2``.

    Raises:
        ValueError: less than one digit, or an uncertainty that is negative.
    """
    if digits < 1:
        raise ValueError(f"Argument `digits` must be 1 or more, but is {digits}.")
    values = np.asarray(uncertainty, float)
    if (values < 0).any():
        raise ValueError("Argument `uncertainty` must be zero or more, but has a negative value.")

    def half_of_the_last_digit(u: float) -> float:
        if not math.isfinite(u) or u == 0:
            return 0.0 if u == 0 else math.nan
        exponent = int(f"{u:.{digits - 1}e}".partition("e")[2])  # of the rounded value: 9.97 is 10 with two digits
        return 0.5 * 10.0 ** (exponent - digits + 1)

    return np.vectorize(half_of_the_last_digit, otypes=[float])(values)


@dataclass(frozen=True)
class Goal:
    """Goal of an adaptive run."""

    digits: int = 2
    """Significant decimal digits of the standard uncertainties that are to be stable (7.9.2)."""
    tolerance: Value = None
    """The numerical tolerance itself, in the outputs' unit, instead of digits."""
    probability: float = 0.95
    """Coverage probability of the intervals."""
    joint: bool = False
    """Whether the largest eigenvalue of the correlation matrix and k_p are watched too (JCGM 102, 7.8.3)."""

    def __post_init__(self) -> None:
        if self.digits < 1:
            raise ValueError(f"Argument `digits` must be 1 or more, but is {self.digits}.")
        if self.tolerance is not None and not (np.asarray(self.tolerance) > 0).all():
            raise ValueError(f"Argument `tolerance` must be above zero, but is {self.tolerance}.")
        check_probability(self.probability)

    @property
    def least_block(self) -> int:
        """Trials in a block at least: 100 / (1 - p) (7.9.4 b)."""
        return int(np.ceil(100 / (1 - self.probability) - 1e-9))


@dataclass(frozen=True)
class Stability:
    """Stability that an adaptive run reached, output by output."""

    goal: Goal
    blocks: int
    tolerance: np.ndarray
    """Numerical tolerance δ of each output."""
    reached: np.ndarray
    """Largest expanded standard deviation of each output's figures: estimate, standard uncertainty, interval's ends."""
    joint: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """Reached figure and tolerance of λ_max and k_p, if they are watched."""

    @property
    def stable(self) -> bool:
        """Whether all figures under watch are within their tolerances."""
        return self.ratio <= 1

    @property
    def ratio(self) -> float:
        """Largest of what is reached over its tolerance; infinite for a single block, NaN without a figure."""
        reached = np.array([*self.reached, *(r for r, _ in self.joint.values())])
        tolerance = np.array([*self.tolerance, *(d for _, d in self.joint.values())])
        with np.errstate(invalid="ignore", divide="ignore"):
            return float(np.max(np.where(reached == 0, 0, reached / tolerance)))

    def trials_needed(self, trials: int) -> int:
        """Return about how many trials make it stable, from how stable so many did."""
        return int(min(trials * self.ratio**2, 1e15)) if math.isfinite(self.ratio) else trials


class Blocks:
    """The figures of each block so far."""

    def __init__(self, goal: Goal, comparisons: int = 1) -> None:
        """Start without blocks; ``comparisons`` runs must be stable together, such as one for each trajectory."""
        self.goal, self.comparisons = goal, comparisons
        self.figures: list[np.ndarray] = []
        self.shared: list[tuple[float, float]] = []

    def add(self, draws: Draws) -> None:
        """Add one block of trials; trials that are not finite are left out."""
        draws = draws[np.isfinite(draws).all(axis=1)]
        if len(draws) < 2:
            draws = np.full((2, draws.shape[1]), np.nan)
        interval = symmetric_interval(draws, self.goal.probability)
        self.figures.append(np.stack([draws.mean(0), draws.std(0, ddof=1), interval.low, interval.high]))
        if self.goal.joint:
            self.shared.append(_joint_figures(draws, self.goal.probability))

    def stability(self) -> Stability:
        """Return how stable the averages over the blocks are."""
        figures = np.array(self.figures)  # blocks, 4, outputs
        size = figures[0].size
        everything = figures.reshape(len(figures), -1)
        if self.goal.joint:
            everything = np.concatenate([everything, np.array(self.shared)], axis=1)
        reached = _expanded(everything, self.comparisons)
        uncertainty = np.sqrt(np.mean(figures[:, 1] ** 2, axis=0))
        given = self.goal.tolerance
        tolerance = numerical_tolerance(uncertainty, self.goal.digits) if given is None else np.asarray(given)
        shared = numerical_tolerance(everything[:, size:].mean(0), self.goal.digits)
        joint = dict(zip(("λ_max", "k_p"), zip(reached[size:].tolist(), shared.tolist(), strict=True), strict=False))
        return Stability(
            goal=self.goal, blocks=len(figures), tolerance=np.broadcast_to(tolerance, uncertainty.shape),
            reached=reached[:size].reshape(4, -1).max(axis=0), joint=joint,
        )  # fmt: skip


def _expanded(figures: Float[np.ndarray, "blocks figures"], comparisons: int) -> Float[np.ndarray, " figures"]:
    """Standard deviations of the averages times Student's t; infinite for a single block."""
    h, watched = figures.shape
    if h < 2:
        return np.full(watched, np.inf)
    factor = scipy.special.stdtrit(h - 1, 1 - (1 - CONFIDENCE) / (2 * watched * comparisons))
    return factor * figures.std(axis=0, ddof=1) / np.sqrt(h)


def _joint_figures(draws: Draws, probability: float) -> tuple[float, float]:
    """λ_max of the correlation matrix and k_p of the ellipsoidal region (JCGM 102, 7.8.3)."""
    covariance = covariance_of(draws)
    if not np.isfinite(covariance).all():
        return np.nan, np.nan
    scale = scatter_of(covariance)
    strength = np.linalg.eigvalsh(covariance / np.outer(scale, scale))[-1]
    return float(strength), quantile(distance(draws, draws.mean(0), covariance), probability).value


def not_stable(stability: Stability, trials: int) -> str:
    """Return the sentence for a run that ended at its limit."""
    if not math.isfinite(stability.ratio):
        return f"not stable after {trials:,} trials: two or more blocks without failure are needed to judge."
    return (
        f"the limit of {trials:,} trials was reached: the result is stable to {stability.ratio:.3g} times the "
        f"tolerance; about {stability.trials_needed(trials):,} trials would be needed."
    )
