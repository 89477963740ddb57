"""How many trials are enough: the adaptive Monte Carlo of JCGM 101:2008, 7.9, and of JCGM 102:2011, 7.8.

Trials come in blocks. Each block gives its own estimate, standard uncertainty and ends of the coverage interval; their
scatter over the blocks says how well the averages are known. The clause stops when twice the standard deviations of
the averages are within the numerical tolerance. With few blocks and many figures under watch that stops too soon, too
often (Wübbeler, Harris, Cox, Elster 2010, doi:10.1088/0026-1394/47/3/023), so that here the factor is Student's t for
the number of blocks, shared out over the figures under watch (Bonferroni): never less than the clause's two.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import scipy
from jaxtyping import Array, Float

from identify.precision import check_precision
from identify.tables import html_table, text_table
from uq.coverage import CoverageInterval, Value, numerical_tolerance, shortest_interval, symmetric_interval
from uq.distributions import Distribution
from uq.linear import Model
from uq.regions import Draws, covariance_of, distance, quantile
from uq.sources import stream_number

CONFIDENCE = 0.95
"""Probability with which all figures under watch are within their tolerances at the stop."""


@dataclass(frozen=True)
class Goal:
    """What an adaptive run is to reach."""

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
        if not 0 < self.probability < 1:
            raise ValueError(f"Argument `probability` must lie between 0 and 1, but is {self.probability}.")

    @property
    def least_block(self) -> int:
        """Trials in a block at least: 100 / (1 - p) (7.9.4 b)."""
        return int(np.ceil(100 / (1 - self.probability) - 1e-9))


@dataclass(frozen=True)
class Stability:
    """What an adaptive run reached, output by output."""

    goal: Goal
    blocks: int
    tolerance: np.ndarray
    """δ of each output."""
    reached: np.ndarray
    """Expanded standard deviation of each output's figure that is known worst: estimate, u, or an end."""
    joint: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """Reached figure and tolerance of λ_max and k_p, if they are watched."""

    @property
    def stable(self) -> bool:
        """Whether everything under watch is within its tolerance."""
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
        return Stability(
            self.goal,
            len(figures),
            np.broadcast_to(tolerance, uncertainty.shape),
            reached[:size].reshape(4, -1).max(axis=0),
            dict(zip(("λ_max", "k_p"), zip(reached[size:].tolist(), shared.tolist(), strict=True), strict=False)),
        )


def _expanded(figures: Float[np.ndarray, "blocks figures"], comparisons: int) -> Float[np.ndarray, " figures"]:
    """Standard deviations of the averages times Student's t; infinite for a single block."""
    h, watched = figures.shape
    if h < 2:
        return np.full(watched, np.inf)
    factor = scipy.stats.t.ppf(1 - (1 - CONFIDENCE) / (2 * watched * comparisons), h - 1)
    return factor * figures.std(axis=0, ddof=1) / np.sqrt(h)


def _joint_figures(draws: Draws, probability: float) -> tuple[float, float]:
    """λ_max of the correlation matrix and k_p of the ellipsoidal region (JCGM 102, 7.8.3)."""
    covariance = covariance_of(draws)
    if not np.isfinite(covariance).all():
        return np.nan, np.nan
    scale = np.sqrt(np.diag(covariance))
    scale = np.where(scale > 0, scale, 1)
    strength = np.linalg.eigvalsh(covariance / np.outer(scale, scale))[-1]
    return float(strength), quantile(distance(draws, draws.mean(0), covariance), probability).value


@dataclass(frozen=True)
class Propagation:
    """A measurand by the propagation of distributions (JCGM 101, 7.6 and 7.7)."""

    trials: int
    seed: int
    estimate: np.ndarray
    """Average of the trials, of the measurand's shape."""
    covariance: np.ndarray
    """Of the measurand's m components, flattened, (m, m)."""
    symmetric: CoverageInterval
    shortest: CoverageInterval
    stability: Stability
    warnings: tuple[str, ...]
    draws: Float[np.ndarray, "trials *outputs"] = field(repr=False, compare=False)

    @property
    def standard_uncertainty(self) -> np.ndarray:
        """Standard deviation of the trials, of the measurand's shape."""
        return np.asarray(np.sqrt(np.diag(self.covariance)).reshape(self.estimate.shape))

    def rows(self) -> tuple[list[str], list[list[str]]]:
        """Return head and rows: estimate, standard uncertainty, both intervals, tolerance."""
        columns = [
            self.estimate, self.standard_uncertainty, self.symmetric.low, self.symmetric.high, self.shortest.low,
            self.shortest.high, self.stability.tolerance.reshape(self.estimate.shape),
        ]  # fmt: skip
        percent = f"{100 * self.symmetric.probability:g} %"
        head = ["estimate", "u", f"{percent} from", "to", "shortest from", "to", "tolerance"]
        rows = np.stack([np.ravel(column) for column in columns], axis=1)
        return head, [[f"{x:.6g}".replace("-", "−") for x in row] for row in rows]

    def _title(self) -> str:
        return f"Monte Carlo, {self.trials:,} trials in {self.stability.blocks} blocks, seed {self.seed}"

    def __repr__(self) -> str:
        return "\n".join([self._title(), text_table(*self.rows()), *self.warnings])

    def _repr_html_(self) -> str:
        return html_table(*self.rows(), caption=self._title()) + "".join(f"<p>{text}</p>" for text in self.warnings)


def propagate_distributions(
    model: Model,
    inputs: Mapping[str, Distribution],
    *,
    digits: int = 2,
    tolerance: Value = None,
    probability: float = 0.95,
    joint: bool = False,
    seed: int = 0,
    block: int | None = None,
    most_trials: int = 10_000_000,
) -> Propagation:
    """Propagate the inputs' distributions through a model by an adaptive Monte Carlo (JCGM 101, 7.9).

    A draw depends on the seed, the input's name and the number of the block, so that another input changes none.

    Args:
        model: the measurement model, JAX on a dict of arrays, one trial.
        inputs: distributions by name; correlated coordinates belong to one of them.
        digits: significant digits of the standard uncertainty that are to be stable.
        tolerance: the numerical tolerance instead, in the output's unit; one figure or one an output.
        probability: coverage probability.
        joint: watch λ_max and k_p of several outputs too (JCGM 102, 7.8).
        seed: seed of every draw.
        block: trials in a block; None for 10,000, or 100 / (1 - p) if that is more (7.9.4 b).
        most_trials: where to stop at the latest; the result then says so in its warnings.

    Raises:
        ValueError: no input, or a goal that cannot be.
    """
    if not inputs:
        raise ValueError("Argument `inputs` must hold at least one input, but is empty.")
    goal = Goal(digits, tolerance, probability, joint)
    block = block or max(10_000, goal.least_block)
    warned = check_precision("float64")
    inputs, blocks = dict(sorted(inputs.items())), Blocks(goal)
    parts: list[np.ndarray] = []
    while not parts or (len(parts) + 1) * block <= most_trials:
        parts.append(np.asarray(_block(model, inputs, jax.random.key(seed), jnp.asarray(len(parts)), block)))
        blocks.add(parts[-1].reshape(block, -1))
        if blocks.stability().stable:
            break
    draws, stability = np.concatenate(parts), blocks.stability()
    finite = draws[np.isfinite(draws.reshape(len(draws), -1)).all(axis=1)]
    return Propagation(
        len(draws),
        seed,
        np.asarray(finite.mean(0)),
        covariance_of(finite.reshape(len(finite), -1)),
        symmetric_interval(finite, probability),
        shortest_interval(finite, probability),
        stability,
        (*warned, *_warnings(stability, len(draws), len(draws) - len(finite))),
        draws,
    )


def _warnings(stability: Stability, trials: int, failed: int) -> list[str]:
    found = [] if stability.stable else [not_stable(stability, trials)]
    return found + ([f"{failed} of {trials:,} trials are not finite and are left out."] if failed else [])


def not_stable(stability: Stability, trials: int) -> str:
    """Return the sentence for a run that ended at its limit."""
    if not math.isfinite(stability.ratio):
        return f"not stable after {trials:,} trials: two blocks or more that do not fail are needed to tell."
    return (
        f"the limit of {trials:,} trials came before the asked tolerance: {stability.ratio:.3g} times it is reached; "
        f"about {stability.trials_needed(trials):,} trials would be needed."
    )


@eqx.filter_jit
def _block(model: Model, inputs: Mapping[str, Distribution], key: Array, number: Array, size: int) -> Array:
    def draw(name: str, given: Distribution) -> Array:
        own = jax.random.fold_in(jax.random.fold_in(key, stream_number(name)), number)
        return given.draw(own, (size, *np.shape(given.mean)))

    return jax.vmap(model)({name: draw(name, given) for name, given in inputs.items()})
