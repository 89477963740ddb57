"""The best experiment a platform can run: the motion of least predicted uncertainty within its limits."""

from dataclasses import dataclass, replace

import numpy as np

from identify.display.reporting import Shown
from identify.exceptions import explains_names
from identify.motion.leg_limits import Limits
from identify.motion.limit_peaks import Peak
from uq.analysis.propagation.prepared_run import prepared_run
from uq.analysis.propagation.uncovered_sources import ANYWHERE, BeyondLawError, beyond_the_prediction
from uq.experiment.experiment import Experiment, TrajectorySpec
from uq.files.mistakes import ExperimentError
from uq.plan.motion_design.design_goal import GOALS, OBJECTIVES, Measure, goal_of
from uq.plan.motion_design.hexapod.design_bound import DesignBound, design_bound
from uq.plan.motion_design.hexapod.design_search import GRID, searches
from uq.plan.motion_design.hexapod.reference_trajectory import (
    PredictedTrajectory,
    best_reference,
    differentiator,
    stretched,
)
from uq.plan.motion_design.hexapod.rig_limits import resolved_limits, uses
from uq.plan.motion_design.search import check_options, optima
from uq.progress_bar import Progress, progress_of

FINER = 10
"""Factor on the optimiser's instants for the final check of the limits."""
ACTIVE = 0.98
"""Share of a limit from which on it counts as active."""


@dataclass(frozen=True)
class Start:
    """Outcome of the search from one start."""

    goal: float
    """Value of the minimised goal over that of the reference."""
    excess: float
    """Largest violation of a limit on the optimiser's grid, as a share of the limit."""
    evaluations: int
    stages: int = 1
    """Number of stages of the motion."""

    @property
    def met(self) -> bool:
        """Whether the search met the limits, to the per cent that a smaller amplitude corrects."""
        return self.excess < 0.01


@dataclass(frozen=True, eq=False, repr=False)
class Design(Shown, PredictedTrajectory):
    """A designed trajectory, a Multisine, what it promises, and what limits it.

    Where no design beat the reference it is the reference itself.
    """

    experiment: Experiment
    """Experiment for which the trajectory was designed."""
    reference: PredictedTrajectory
    """Trajectory for comparison, at the size and speed that promise most under the same limits."""
    limits: Limits
    """Limits of the rig in SI."""
    bound: DesignBound | None
    """Lower bound that no motion under these limits can beat; None: the limits do not give one."""
    peaks: list[Peak]
    """Each limit's largest use over the whole run, largest first."""
    starts: list[Start]
    """Outcome of the search from each of its starts."""
    band: float
    """Highest frequency of the designed trajectory [Hz], for the differentiator."""
    objective: str = "rms"
    """Quantity that was minimised: three times the root mean square error, or 3σ (``3sigma``)."""

    @property
    def active(self) -> list[Peak]:
        """Limits that are active in the design."""
        return [peak for peak in self.peaks if peak.share >= ACTIVE]

    @property
    def improved(self) -> bool:
        """Whether a design beat the reference."""
        return self.spec is not self.reference.spec


@explains_names
def design(
    experiment: Experiment,
    *,
    goal: str = "all",
    objective: str = "rms",
    reference: str | None = None,
    duration: float | None = None,
    starts: int = 1,
    seed: int = 0,
    period: float = 5.0,
    rounds: int = 14,
    steps: int = 150,
    progress: Progress | bool | None = None,
) -> Design:
    """Find the motion of least predicted uncertainty that a platform can run.

    The motion is sums of sines and cosines up to the command's bandwidth, displacement and rotation of the platform's
    centre, between two ramps: either in stages, one for each of the legs' optimal patterns
    (identify/motion/optimal_mixture.py), each repeating a short period of its own, or one period for the whole run. Its
    predicted uncertainty, by the law of propagation with every declared source, is minimised over the amplitudes under
    all limits at every instant, from several starts: for each component three times the root mean square error,
    ``3 √(σ² + b²)`` with the mean error b, or 3σ. The best motion of either kind is then made smaller until all
    limits are met over the whole run, ramps included, on a grid ten times finer; the better one is returned.

    Args:
        experiment: body, sources, ``[platform] geometry`` and ``[platform.limits]``.
        goal: ``all`` (averages of moments and of products, each against the reference's), ``moments``, ``products``,
            ``worst`` (component), ``axis 1`` to ``axis 3`` (principal moments, the least first).
        objective: ``rms`` or ``3sigma``: what of each component counts.
        reference: name of the trajectory to be beaten, None for the first; its size and speed are chosen for the
            limits.
        duration: of the run [s]; None: the reference's.
        starts: motions to start from, some minutes each: the first in stages, which came out best in every study; the
            second a spiral that keeps the centre of gravity still, the others random.
        seed: of the starts.
        period: of the motions that are not in stages [s].
        rounds: of the minimisation from each start.
        steps: in each round, at most.
        progress: called with what is being done, the steps done and the steps in all; True: a bar.

    Raises:
        ExperimentError: limits missing or exceeded at home, an unknown goal, objective or trajectory, a number that
            cannot be, a sample rate at which a motion of the bandwidth cannot be differentiated.
    """
    choices = {"goal": (goal, GOALS), "objective": (objective, OBJECTIVES)}
    check_options(choices, {"starts": starts}, {"period": period, "duration": duration})
    tell = progress_of(progress, "steps")
    beaten, given = experiment.select(reference)
    _check_rate(experiment, beaten, given)
    _check_sources(experiment, given)
    limits = resolved_limits(experiment, FINER * GRID)
    fine = FINER * GRID * limits.bandwidth
    given = given if duration is None else stretched(given, duration)
    _check_period(period, limits.bandwidth, given.duration)
    inertia = np.asarray(experiment.body.inertia)

    def measured_from(base: PredictedTrajectory) -> Measure:
        return goal_of(goal, inertia, base.covariance, base.mean_error, objective)

    tell("reference", 0, 1)
    unscaled = PredictedTrajectory.of(experiment, given, limits.bandwidth)
    to_beat = best_reference(experiment, given, limits, measured_from(unscaled), fine)
    tell("reference", 1, 1)
    measure = measured_from(to_beat)
    ends, candidates = [], [to_beat]
    for search, first in searches(experiment, to_beat.spec, limits, measure, period=period, starts=starts, seed=seed):
        minima = optima(search.lagrangian, first, tell, asked=starts, rounds=rounds, steps=steps)
        minima = [replace(optimum, goal=float(np.exp(optimum.goal))) for optimum in minima]
        ends += [Start(end.goal, end.excess, end.evaluations, search.stages.count) for end in minima]
        designed = search.finish(min(minima, key=lambda end: end.goal + 10 * max(end.excess - 0.01, 0.0)), fine, tell)
        candidates += [] if designed is None else [designed]
    best = min(candidates, key=lambda candidate: candidate.measured_by(measure))
    return Design(
        **vars(best), experiment=experiment, reference=to_beat, limits=limits, starts=ends, objective=objective,
        bound=design_bound(experiment, to_beat.spec, limits), peaks=uses(experiment, best.spec, limits, fine),
        band=min(best.spec.trajectory.highest_frequency, limits.bandwidth),
    )  # fmt: skip


def _check_period(period: float, bandwidth: float, duration: float) -> None:
    if period * bandwidth < 2:
        raise ExperimentError(f"period is {period:g} s: give 2 / bandwidth or more, {2 / bandwidth:g} s")
    if duration < 4 * period:
        raise ExperimentError(f"a run of {duration:g} s: motions of period {period:g} s take {4 * period:g} s or more")


def _check_sources(experiment: Experiment, spec: TrajectorySpec) -> None:
    """Refuse, before a long search, all sources that the prediction or the law of the reference does not take."""
    peaks = ANYWHERE
    if not all(source.drawn for source in experiment.sources):  # a range or a step, which matter by the signals' size
        peaks = prepared_run(experiment, spec, [differentiator(spec.trajectory.highest_frequency)]).peaks
    if reasons := beyond_the_prediction(experiment.sources, experiment.mixing, peaks):
        raise BeyondLawError(reasons)


def _check_rate(experiment: Experiment, name: str, spec: TrajectorySpec) -> None:
    """Refuse, before a long search, a sample rate at which the designed motion cannot be differentiated."""
    band = np.inf if experiment.limits is None else experiment.limits.figures.bandwidth
    if np.isfinite(band):
        try:
            differentiator(band).taps(spec.rate)
        except ValueError:
            raise ExperimentError(
                f"trajectory.{name}.rate is {spec.rate:g} Hz, too low to differentiate a motion of {band:g} Hz: raise "
                "it, or lower platform.limits.bandwidth"
            ) from None
