"""The search for the best motion: amplitudes of one kind of motion under all limits, from several starts."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from typing import Any

import jax.numpy as jnp
import numpy as np

from identify.motion.leg_limits import Limits, effort, signed_shares
from identify.motion.optimiser import Lagrangian, Optimum, minimise
from identify.motion.periodic_motion import Periodic
from identify.motion.stages import Stages
from identify.motion.starting_motions import start
from uq.excitation.design_goal import Measure
from uq.excitation.reference_trajectory import WEIGHT, PredictedTrajectory, differentiator
from uq.excitation.rig_limits import largest_size, largest_use
from uq.excitation.search_starts import patterns_for, staged
from uq.experiment.experiment import Experiment, TrajectorySpec
from uq.propagation.prediction import Prediction
from uq.trials.progress_bar import Progress

GRID = 16
"""Instants of the optimiser in a period of the highest frequency."""
RAMP = 6.0
"""Time in which a stage starts or stops, in periods of the highest frequency."""
FINAL = 8
"""Looks at the finer grid before a design is given up."""
Start = Callable[[np.random.Generator], np.ndarray]
"""Gives the unknowns from which a search starts."""


def searches(
    experiment: Experiment, reference: TrajectorySpec, limits: Limits, measure: Measure, period: float, starts: int
) -> Iterator[tuple["Search", dict[int, Start]]]:
    """Yield the searches and their numbered starts: first in stages, then with one period for the whole run.

    A run that does not hold four periods of each stage has no stages.
    """
    band, duration = limits.bandwidth, reference.duration
    patterns = patterns_for(experiment, reference, limits, measure)
    stages, first = staged(experiment, limits, patterns, GRID, duration, RAMP / band)
    room = np.diff(stages.border).min() >= 4 * stages.periodic.period
    if room:
        yield (
            Search(experiment=experiment, reference=reference, limits=limits, measure=measure, stages=stages),
            {0: first},
        )
    if starts > 1 or not room:
        periodic = Periodic.of(experiment.platform, limits, period=period, band=band, rate=GRID * band)
        whole_run = Stages.of(periodic, np.ones(1), duration, RAMP / band)
        r_cg = experiment.r_cg_from_omb

        def single(number: int) -> Start:
            return lambda generator: start(periodic, r_cg, generator, number)

        numbers = range(1 if room else 0, starts)
        yield (
            Search(experiment=experiment, reference=reference, limits=limits, measure=measure, stages=whole_run),
            {number: single(number) for number in numbers},
        )


class Search:
    """The minimisation for one experiment and one kind of motion, compiled once for all starts."""

    def __init__(
        self, experiment: Experiment, reference: TrajectorySpec, limits: Limits, measure: Measure, stages: Stages
    ):
        self.experiment, self.limits, self.stages = experiment, limits, stages
        self.spec = replace(reference, still="omb")
        prediction = Prediction.of(experiment, self.spec)
        samples = jnp.asarray(reference.rate * stages.seconds)
        gain = differentiator(float(np.max(stages.periodic.frequency))).alpha_noise_gain(reference.rate)
        names = limited(limits)
        r_cg, gravity = jnp.asarray(experiment.r_cg_from_omb), jnp.asarray(experiment.gravity)
        platform, body = experiment.platform, experiment.body

        def goal(unknowns):
            motion = stages.moved(platform, unknowns, r_cg, gravity)
            used = signed_shares(effort(platform, body, r_cg, motion.platform, gravity), limits)
            mean_error, covariance = prediction.moments(motion.body, motion.jerk, gain, samples)
            shares = jnp.concatenate([jnp.abs(stages.finer(used[name])).ravel() for name in names])
            return jnp.log(measure(covariance, mean_error)), shares - 1

        self.lagrangian = Lagrangian(goal)

    def from_start(self, first: np.ndarray, rounds: int, steps: int, tell: Callable[[int], None]) -> Optimum:
        """Minimise from a start; ``tell`` is called with the rounds done."""
        optimum = minimise(self.lagrangian, first, rounds=rounds, steps=steps, progress=lambda done, *_: tell(done))
        return replace(optimum, goal=float(np.exp(optimum.goal)))

    def finish(self, optimum: Optimum, fine: float, tell: Progress) -> PredictedTrajectory | None:
        """Return the whole run, of the largest size that meets the limits on a finer grid; None: no size."""
        short = lambda size: self._spec(size * optimum.unknowns, short=True)  # noqa: E731
        size = largest_size(self.experiment, short, self.limits, fine)
        for number in range(FINAL):
            tell("limits", number, FINAL)
            spec = self._spec(size * optimum.unknowns)
            share = largest_use(self.experiment, spec, self.limits, fine)
            if share <= 1:
                tell("limits", FINAL, FINAL)
                return PredictedTrajectory.of(self.experiment, spec, self.limits.bandwidth)
            size = size / (1 + WEIGHT * (share - 1))
        return None

    def _spec(self, unknowns: np.ndarray, short: bool = False) -> TrajectorySpec:
        trajectory = self.stages.multisine(unknowns, short=short)
        return replace(self.spec, trajectory=trajectory, duration=float(trajectory.duration))


def limited(limits: Limits) -> list[str]:
    """Return the quantities that are limited, as :func:`identify.motion.leg_limits.shares` names them."""
    values: Any = limits._replace(length=limits.length[:, 1])._asdict()
    return [name for name, value in values.items() if name != "bandwidth" and np.isfinite(value).any()]
