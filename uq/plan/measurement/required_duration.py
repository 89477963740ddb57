"""How long must I measure? The duration that a target takes, or the source that forbids it.

Noise is averaged: its variance falls with the time between the ramps. What is drawn once is not: its variance stays,
and that of a drift grows. The law of propagation tells each source's part at the trajectory's own duration and at twice
that; in between and beyond, noise follows ``1 / (T - lost)`` and every other source its own power of T. The answer is
checked, and mended, by the law at the answer itself.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np
from jaxtyping import Float

from identify.display.reporting import Result
from identify.display.rounding import significant
from identify.exceptions import explains_names
from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE, MOMENTS, PRODUCTS
from rig.exceptions import quoted
from uq.analysis.propagation.experiment_law import law, prepare_law
from uq.experiment.experiment import Experiment, ExperimentError, TrajectorySpec
from uq.experiment.typical_errors import typical_errors

NOTHING = "no [[source]] in the experiment changes its tensor: declare the sensors' errors, or leave out fewer"
GOALS: Mapping[str, tuple[int, ...]] = {
    "moments": tuple(MOMENTS), "products": tuple(PRODUCTS), **{name: (k,) for k, name in enumerate(COMPONENTS)},
}  # fmt: skip
"""Components whose average 3σ is meant, by the goal's name."""
DRIFTS = ("cell_drift", "gyro_drift")
"""Errors whose effect grows with time."""
LONGEST = 1e6
"""Durations of the trajectory beyond which none is looked for."""
MOST_POWER = 4.0
"""Largest power of the duration that a variance may follow; only that of a drift grows."""
CLOSE = 2e-3
"""Relative difference within which the law at the answer meets the target."""
ROUNDS = 4
MOST_SAMPLES = 2_000_000
"""Most samples of a run at which the law is evaluated; a longer answer is extrapolated."""


@dataclass(frozen=True)
class Growth:
    """Each source's variance as a function of the duration."""

    names: tuple[str, ...]
    duration: float
    """The duration at which the variances are stated [s]."""
    variance: Float[np.ndarray, "sources 6"]
    """Variance of the tensor by each source at ``duration`` [(kg·m²)²]."""
    lost: Float[np.ndarray, "sources 6"]
    """Time that the ramps take from what is averaged [s]; not-a-number: the variance follows a power of the
    duration."""
    power: Float[np.ndarray, "sources 6"]
    """Power of the duration that the other variances follow: at 0 they stay, above 0 they grow."""
    undeclared: Float[np.ndarray, "6"]
    """Variance of the tensor by undeclared errors at typical size, which no time averages away [(kg·m²)²]."""

    def at(self, duration: float | np.ndarray) -> np.ndarray:
        """Return each source's variance at a duration [s]; durations lead."""
        T = np.asarray(duration, float)[..., None, None]
        with np.errstate(invalid="ignore", divide="ignore"):
            noise = np.where(self.lost < T, (self.duration - self.lost) / (T - self.lost), np.inf)
            factor = np.where(np.isnan(self.lost), (T / self.duration) ** self.power, noise)
            return np.where(self.variance > 0, self.variance * factor, 0.0)

    def three_sigma(self, duration: float | np.ndarray) -> np.ndarray:
        """Return the 3σ of each component by all sources at a duration [s]; durations lead."""
        return 3 * np.sqrt(self.at(duration).sum(axis=-2))


@dataclass(frozen=True, repr=False)
class Duration(Result):
    """The duration that a target requires.

    Example: ``required_duration(Experiment.load("barreto2016"), 1e-3).seconds``.
    """

    target: float
    """Target of the average 3σ [kg·m²]."""
    goal: str
    """Components whose average 3σ is meant: a name in ``GOALS``."""
    seconds: float | None
    """Duration that reaches it; None: none does."""
    reached: float
    """The average 3σ there by the law; where no duration reaches the target, the least that can be approached."""
    forbids: str | None
    """The source that stands most in the way where none does."""
    current_duration: float
    """Duration of the trajectory as it is [s]."""
    now: float
    """Average 3σ by the law at the trajectory's present duration [kg·m²]."""
    growth: Growth
    checked: bool = True
    """Whether the law was evaluated at the answer; otherwise the answer is extrapolated from two durations."""

    @property
    def floor(self) -> float:
        """Average 3σ by undeclared errors at typical size, in the conventional bound at any duration [kg·m²]."""
        return float(average(3 * np.sqrt(self.growth.undeclared), self.goal))

    @property
    def reachable(self) -> bool:
        """Whether some duration reaches the target."""
        return self.seconds is not None

    def to_dict(self) -> dict[str, Any]:
        """Return what result.json says: kg·m², s."""
        return {
            "goal": self.goal, "target": self.target, "seconds": self.seconds, "reached": self.reached,
            "unit": "kg*m^2", "forbids": self.forbids, "current_duration": self.current_duration, "now": self.now,
            "checked": self.checked, "floor_of_undeclared": self.floor,
        }  # fmt: skip

    def records(self) -> list[dict[str, Any]]:
        """Return its content, kg·m² and s."""
        return [self.to_dict()]


@explains_names
def required_duration(
    experiment: Experiment,
    target: float,
    *,
    goal: str = "moments",
    trajectory: str | None = None,
    estimator: str | None = None,
    growth: Growth | None = None,
) -> Duration:
    """Return how long a trajectory must last for a target uncertainty.

    Ramps, amplitudes and frequencies stay as they are; only the motion between the ramps lasts longer or shorter.

    Args:
        experiment: body, platform, sources, estimators.
        target: average 3σ of the goal's components [kg·m²].
        goal: ``moments``, ``products`` or one component.
        trajectory: its name; None for the first.
        estimator: its name; None for the recording's, or the first.
        growth: of this trajectory and estimator, from :func:`growth_of`; None: it is computed.

    Raises:
        ExperimentError: a target that is not above zero, an unknown name, a source that the law cannot take.
    """
    if goal not in GOALS:
        raise ExperimentError(f"unknown goal {quoted(goal)}: choose one of {', '.join(GOALS)}")
    if not 0 < target < np.inf:
        raise ExperimentError(f"a target of {GRAM_METRE * target:g} g·m²: give an uncertainty above zero")
    name, spec = experiment.select(trajectory)
    growth = growth or growth_of(experiment, name, estimator)
    now = average(growth.three_sigma(spec.duration), goal)
    answer = partial(
        Duration, target=target, goal=goal, forbids=None, current_duration=spec.duration, now=now, growth=growth
    )
    seconds = _solve(growth, target, goal, spec)
    if seconds is None:
        least, source = _floor(growth, goal, spec)
        return answer(seconds=None, reached=least, forbids=source)
    for _ in range(ROUNDS):
        model = average(growth.three_sigma(seconds), goal)
        if seconds * spec.rate > MOST_SAMPLES:
            return answer(seconds=seconds, reached=model, checked=False)
        reached = average(3 * np.sqrt(_variances(experiment, name, spec, seconds, estimator).sum(axis=0)), goal)
        if abs(reached / target - 1) < CLOSE:
            break
        again = _solve(growth, target * model / reached, goal, spec)
        if again is None or abs(again / seconds - 1) < 1e-3:
            break
        seconds = again
    return answer(seconds=seconds, reached=reached)


def growth_of(experiment: Experiment, trajectory: str | None = None, estimator: str | None = None) -> Growth:
    """Return how each source's variance depends on a trajectory's duration, from the law at two durations.

    Raises:
        ExperimentError: an unknown name, no source that counts, or one that the law cannot take.
    """
    if not experiment.sources:
        raise ExperimentError(NOTHING)
    name, spec = experiment.select(trajectory)
    T = spec.duration
    once, twice = (_variances(experiment, name, spec, duration, estimator) for duration in (T, 2 * T))
    if not once.any():
        raise ExperimentError(NOTHING)
    averaged = np.array([source.white_variance(1.0) is not None for source in experiment.sources])[:, None]
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.where((once > 0) & (twice > 0), once / twice, 1.0)
        lost = np.where(averaged & (ratio > 1), (ratio - 2) / (ratio - 1) * T, np.nan)
        power = np.where(np.isnan(lost), -np.log2(ratio), 0.0)
    drifts = np.array([source.perturbs in DRIFTS for source in experiment.sources])[:, None]
    power = np.clip(power, -MOST_POWER, np.where(drifts, MOST_POWER, 0.0))
    return Growth(
        names=tuple(source.name for source in experiment.sources), duration=T, variance=once, lost=lost, power=power,
        undeclared=_undeclared(experiment, name, estimator),
    )  # fmt: skip


def _undeclared(experiment: Experiment, trajectory: str, estimator: str | None) -> np.ndarray:
    """Variance of the tensor by the law of errors that the experiment does not declare, at typical size, (6,)."""
    chosen = experiment.estimator(estimator).name
    (run,) = prepare_law(replace(experiment, sources=()), trajectory, chosen).runs.values()
    force, moment = (float(np.max(run.peaks.largest[signal])) for signal in ("F", "M"))
    errors = typical_errors(experiment, (force, moment))
    return (
        np.diag(law(errors, trajectory, chosen)[trajectory, chosen].total.covariance) if errors.sources else np.zeros(6)
    )


def lasting(spec: TrajectorySpec, duration: float) -> TrajectorySpec:
    """Return a trajectory that lasts for another time [s], its ramps and frequencies as they are.

    Raises:
        ExperimentError: shorter than the ramps.
    """
    trajectory: Any = spec.trajectory
    if duration < shortest(spec):
        where = " in each stage" if getattr(trajectory, "start", None) is not None else ""
        raise ExperimentError(
            f"{duration:g} s do not hold two ramps of {float(trajectory.ramp):g} s{where}: last for longer"
        )
    return replace(spec, trajectory=trajectory.lasting(duration), duration=float(duration))


def shortest(spec: TrajectorySpec) -> float:
    """Return how short a trajectory may be made, its ramps as they are [s]."""
    trajectory: Any = spec.trajectory
    return float(trajectory.shortest)


def average(three_sigma: Float[np.ndarray, "*n 6"], goal: str) -> Any:
    """Return the average 3σ of a goal's components."""
    widths = three_sigma[..., list(GOALS[goal])].mean(axis=-1)
    return float(widths) if np.ndim(widths) == 0 else widths


def half_of(three_sigma: Float[np.ndarray, " 6"], goal: str) -> float:
    """Return a target where none is asked: half the average 3σ of a goal's components, to two digits [kg·m²]."""
    return float(significant(GRAM_METRE * average(three_sigma, goal) / 2, 2)) / GRAM_METRE


def _variances(
    experiment: Experiment, name: str, spec: TrajectorySpec, duration: float, estimator: str | None
) -> np.ndarray:
    """Each source's variance by the law, scaled so that they add up to the total's: (sources, 6)."""
    chosen = experiment.estimator(estimator).name
    trajectories = {name: lasting(spec, duration)}
    breakdown = law(replace(experiment, trajectories=trajectories, document={}), name, chosen)[name, chosen]
    variances = np.array([np.diag(breakdown.sources[source.name].covariance) for source in experiment.sources])
    total = variances.sum(axis=0)
    return variances * (np.diag(breakdown.total.covariance) / np.where(total > 0, total, 1.0))


def _durations(spec: TrajectorySpec) -> np.ndarray:
    return np.geomspace(max(1.001 * shortest(spec), 1e-3 * spec.duration), LONGEST * spec.duration, 4000)


def _solve(growth: Growth, target: float, goal: str, spec: TrajectorySpec) -> float | None:
    """The shortest duration at which the model is at the target or below."""
    durations = _durations(spec)
    widths = average(growth.three_sigma(durations), goal)
    below = np.flatnonzero(widths <= target)
    if not len(below):
        return None
    k = int(below[0])
    if k == 0:
        return float(durations[0])
    between = np.log([target, widths[k], widths[k - 1]])
    share = (between[0] - between[1]) / (between[2] - between[1])
    return float(np.exp((1 - share) * np.log(durations[k]) + share * np.log(durations[k - 1])))


def _floor(growth: Growth, goal: str, spec: TrajectorySpec) -> tuple[float, str]:
    """The least average 3σ that any duration approaches, and the source with the largest part in it."""
    durations = _durations(spec)
    variances = growth.at(durations)
    widths = average(3 * np.sqrt(variances.sum(axis=-2)), goal)
    k = int(np.argmin(widths))
    shares = (variances[k] / variances[k].sum(axis=0))[:, list(GOALS[goal])].mean(axis=1)
    return float(widths[k]), growth.names[int(np.argmax(shares))]
