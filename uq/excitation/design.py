"""The best experiment a platform can run: the motion of least predicted uncertainty within its limits."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import jax.numpy as jnp
import numpy as np

from identify.motion.leg_limits import Limits, Peak, effort, signed_shares
from identify.motion.optimiser import Lagrangian, Optimum, minimise
from identify.motion.periodic_motion import Periodic
from identify.motion.stages import Stages
from identify.motion.starting_motions import start
from identify.signals.estimator_spec import EstimatorSpec
from uq.excitation.baseline import WEIGHT, Promise, best_reference, largest, promise, scaled, worst_use
from uq.excitation.design_bound import DesignBound, design_bound
from uq.excitation.design_goal import GOALS, Measure, expanded, goal_of
from uq.excitation.rig_limits import resolved_limits, uses
from uq.excitation.starting_stages import patterns_for, staged
from uq.experiment.experiment import Experiment, TrajectorySpec
from uq.files.document import ExperimentError
from uq.propagation.prediction import Prediction

NAME = "designed"
"""Of the designed trajectory in :meth:`Design.montecarlo_experiment`."""
GRID = 16
"""Instants of the optimiser in a period of the highest frequency."""
FINER = 10
"""Times as many at which the limits are checked in the end."""
ACTIVE = 0.98
"""Share of a limit from which on it counts as active."""
RAMP = 6.0
"""Time in which a stage starts or stops, in periods of the highest frequency."""
FINAL = 8
"""Looks at the finer grid before a design is given up."""

Progress = Callable[[str, int, int], None]
"""Called with what is being done, the steps done and the steps in all."""


@dataclass(frozen=True)
class Start:
    """How the search from one start ended."""

    goal: float
    """What was to be small, against the reference's."""
    excess: float
    """Largest violation of a limit on the optimiser's grid, as a share of it."""
    evaluations: int
    stages: int = 1
    """Of its motion."""

    @property
    def met(self) -> bool:
        """Whether it met the limits there, to the per cent that a smaller amplitude mends."""
        return self.excess < 0.01


@dataclass(frozen=True, eq=False)
class Design:
    """A designed trajectory, what it promises, and what limits it."""

    experiment: Experiment
    """As given."""
    spec: TrajectorySpec
    """The designed trajectory, a Multisine; the reference itself where no design beat it."""
    reference: TrajectorySpec
    """What it is compared with, at the size and speed that promise most under the same limits."""
    limits: Limits
    """In figures."""
    expanded: np.ndarray
    """Predicted 3σ of each component with the designed trajectory [kg·m²]."""
    expanded_reference: np.ndarray
    """The same with the reference."""
    bound: DesignBound | None
    """What no motion under these limits can beat; None: the limits do not tell."""
    peaks: list[Peak]
    """Each limit's largest use over the whole run, largest first."""
    starts: list[Start]
    """Of the search."""
    band: float
    """Highest frequency of the designed trajectory [Hz], for the differentiator."""

    @property
    def active(self) -> list[Peak]:
        """What limits the design."""
        return [peak for peak in self.peaks if peak.share >= ACTIVE]

    @property
    def improved(self) -> bool:
        """Whether a design beat the reference."""
        return self.spec is not self.reference

    def montecarlo_experiment(self) -> Experiment:
        """Return the experiment with this trajectory and a differentiator matched to its band, named ``designed``."""
        estimator = EstimatorSpec(NAME, "savitzky-golay", self.band)
        return replace(self.experiment, trajectories={NAME: self.spec}, estimators=(estimator,))


def design(
    experiment: Experiment,
    *,
    goal: str = "all",
    reference: str = "T1",
    duration: float | None = None,
    starts: int = 6,
    seed: int = 0,
    period: float = 5.0,
    rounds: int = 14,
    steps: int = 150,
    progress: Progress | None = None,
) -> Design:
    """Find the motion of least predicted uncertainty that a platform can run.

    The motion is sums of sines and cosines up to the command's bandwidth, displacement and rotation of the platform's
    centre, between two ramps: either in stages, one for each of the legs' optimal patterns
    (identify/motion/phase_patterns.py), each repeating a short period of its own, or one period for the whole run. Its
    predicted uncertainty, by the law of propagation with every declared source, is minimised over the amplitudes under
    all limits at every instant, from several starts. The best motion of either kind is then made smaller until all
    limits are met over the whole run, ramps included, on a grid ten times finer; the better one is returned.

    Args:
        experiment: body, sources, ``[platform] geometry`` and ``[platform.limits]``.
        goal: ``all`` (average 3σ of moments and of products, each against the reference's), ``moments``, ``products``,
            ``worst`` (component), ``axis 1`` to ``axis 3`` (principal moments, the least first).
        reference: name of the trajectory to be beaten; its size and speed are chosen anew under the limits.
        duration: of the run [s]; None: the reference's.
        starts: motions to start from: the first in stages, the second a spiral that keeps the centre of gravity still,
            the others random.
        seed: of the starts.
        period: of the motions that are not in stages [s].
        rounds: of the minimisation from each start.
        steps: in each round, at most.
        progress: called with what is being done, the steps done and the steps in all.

    Raises:
        ExperimentError: limits missing or exceeded at home, an unknown goal or trajectory, a number that cannot be.
    """
    _check(goal, starts, period, duration)
    tell = progress or (lambda *_: None)
    _, given = experiment.select(reference)
    limits = resolved_limits(experiment, FINER * GRID)
    fine = FINER * GRID * limits.bandwidth
    given = _lasting(given, duration)
    if period * limits.bandwidth < 2 or 4 * period > given.duration:
        raise ExperimentError(f"a period of {period:g} s: give 2 / bandwidth to a quarter of the duration")
    tell("reference", 0, 1)
    base = promise(experiment, given, 10 * limits.bandwidth)
    beaten = best_reference(experiment, given, limits, goal_of(goal, _inertia(experiment), base.covariance), fine)
    tell("reference", 1, 1)
    measure = goal_of(goal, _inertia(experiment), beaten.covariance)
    searches = kinds(experiment, beaten.spec, limits, measure, period, starts)
    listed, promised = [], [beaten]
    for search, firsts in searches:
        found = []
        for number, first in firsts:
            of_all = lambda done, number=number: tell("starts", number * rounds + done, starts * rounds)  # noqa: E731
            generator = np.random.default_rng([seed, number])
            found.append(search.from_start(first(generator), rounds, steps, of_all))
        listed += [Start(one.goal, one.excess, one.evaluations, search.stages.count) for one in found]
        ended = search.finish(min(found, key=lambda one: one.goal + 10 * max(one.excess - 0.01, 0.0)), fine, tell)
        promised += [] if ended is None else [ended]
    best = min(promised, key=lambda one: float(measure(jnp.asarray(one.covariance))))
    return Design(
        experiment, best.spec, beaten.spec, limits, np.asarray(expanded(jnp.asarray(best.covariance))),
        np.asarray(expanded(jnp.asarray(beaten.covariance))), design_bound(experiment, beaten.spec, limits),
        uses(experiment, best.spec, limits, fine), listed, limits.bandwidth,
    )  # fmt: skip


Beginning = tuple[int, Callable[[np.random.Generator], np.ndarray]]
"""Number of a start, and what gives its unknowns."""


def kinds(
    experiment: Experiment, reference: TrajectorySpec, limits: Limits, measure: Measure, period: float, starts: int
) -> Iterator[tuple["Search", list[Beginning]]]:
    """Yield the searches and where each starts: first in stages, then with one period for the whole run.

    A run that does not hold four periods of each stage has no stages.
    """
    band, duration = limits.bandwidth, reference.duration
    mixed = patterns_for(experiment, reference, limits, measure)
    stages, first = staged(experiment, limits, mixed, GRID, duration, RAMP / band)
    room = np.diff(stages.border).min() >= 4 * stages.periodic.period
    if room:
        yield Search(experiment, reference, limits, measure, stages), [(0, first)]
    if starts > 1 or not room:
        periodic = Periodic.of(experiment.platform, limits, period=period, band=band, rate=GRID * band)
        one = Stages.of(periodic, np.ones(1), duration, RAMP / band)
        r_cg = experiment.r_cg_from_omb

        def single(number: int) -> Beginning:
            return number, lambda random: start(one.periodic, r_cg, random, number)

        numbers = range(1 if room else 0, starts)
        yield Search(experiment, reference, limits, measure, one), [single(number) for number in numbers]


def _check(goal: str, starts: int, period: float, duration: float | None) -> None:
    if goal not in GOALS:
        raise ExperimentError(f"unknown goal '{goal}': choose one of {', '.join(GOALS)}")
    if starts < 1:
        raise ExperimentError(f"{starts} starts: ask for one at least")
    for name, value in (("period", period), ("duration", duration)):
        if value is not None and not 0 < value < np.inf:
            raise ExperimentError(f"a {name} of {value:g} s: give seconds above zero")


def _inertia(experiment: Experiment) -> np.ndarray:
    return np.asarray(experiment.body.inertia)


def _lasting(spec: TrajectorySpec, duration: float | None) -> TrajectorySpec:
    return spec if duration is None else scaled(spec, 1.0, 1.0, duration)


class Search:
    """The minimisation for one experiment and one kind of motion, compiled once for all starts."""

    def __init__(
        self, experiment: Experiment, reference: TrajectorySpec, limits: Limits, measure: Measure, stages: Stages
    ):
        self.experiment, self.limits, self.stages = experiment, limits, stages
        self.spec = replace(reference, still="omb")
        prediction = Prediction.of(experiment, self.spec)
        samples = jnp.asarray(reference.rate * stages.seconds)
        names = limited(limits)
        r_cg, gravity = jnp.asarray(experiment.r_cg_from_omb), jnp.asarray(experiment.gravity)
        platform, body = experiment.platform, experiment.body

        def goal(unknowns):
            one = stages.moved(platform, unknowns, r_cg, gravity)
            used = signed_shares(effort(platform, body, r_cg, one.platform, gravity), limits)
            covariance = prediction.covariance(one.body, one.jerk, samples)
            most = jnp.concatenate([jnp.abs(stages.finer(used[name])).ravel() for name in names])
            return jnp.log(measure(covariance)), most - 1

        self.lagrangian = Lagrangian(goal)

    def from_start(self, first: np.ndarray, rounds: int, steps: int, tell: Callable[[int], None]) -> Optimum:
        """Minimise from a start; ``tell`` is called with the rounds done."""
        found = minimise(self.lagrangian, first, rounds=rounds, steps=steps, progress=lambda done, *_: tell(done))
        return replace(found, goal=float(np.exp(found.goal)))

    def finish(self, found: Optimum, fine: float, tell: Progress) -> Promise | None:
        """Return the whole run, of the largest size that meets the limits on a finer grid; None: no size."""
        short = lambda size: self._spec(size * found.unknowns, short=True)  # noqa: E731
        size = largest(self.experiment, short, self.limits, fine)
        for number in range(FINAL):
            tell("limits", number, FINAL)
            spec = self._spec(size * found.unknowns)
            share = worst_use(self.experiment, spec, self.limits, fine)
            if share <= 1:
                tell("limits", FINAL, FINAL)
                return promise(self.experiment, spec, 10 * self.limits.bandwidth)
            size = size / (1 + WEIGHT * (share - 1))
        return None

    def _spec(self, unknowns: np.ndarray, short: bool = False) -> TrajectorySpec:
        trajectory = self.stages.multisine(unknowns, short=short)
        return replace(self.spec, trajectory=trajectory, duration=float(trajectory.duration))


def limited(limits: Limits) -> list[str]:
    """Return the quantities that are limited, as :func:`identify.motion.leg_limits.shares` names them."""
    values: Any = limits._replace(length=limits.length[:, 1])._asdict()
    return [name for name, value in values.items() if name != "bandwidth" and np.isfinite(value).any()]
