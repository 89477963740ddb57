"""The search for the best motion: amplitudes of one kind of motion under all limits, from several starts."""

from collections.abc import Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from identify.motion.leg_limits import Limits, shares
from identify.motion.optimiser import Lagrangian, Optimum
from identify.motion.periodic_motion import Periodic
from identify.motion.stages import Stages
from identify.motion.starting_motions import start
from uq.experiment.experiment import Experiment, TrajectorySpec
from uq.motion_design.design_goal import Measure
from uq.motion_design.hexapod.reference_trajectory import PredictedTrajectory, differentiator
from uq.motion_design.hexapod.rig_limits import largest_size, reduced
from uq.motion_design.hexapod.search_starts import patterned, patterns_for, staged
from uq.planning.platform_run import effort_of
from uq.progress_bar import Progress
from uq.propagation.prediction import Prediction

GRID = 16
"""Instants of the optimiser in a period of the highest frequency."""
RAMP = 6.0
"""Time in which a stage starts or stops, in periods of the highest frequency."""


def searches(
    experiment: Experiment,
    reference: TrajectorySpec,
    limits: Limits,
    measure: Measure,
    *,
    period: float,
    starts: int,
    seed: int,
) -> Iterator[tuple["Search", dict[int, Float[np.ndarray, " u"]]]]:
    """Yield the searches and their starts by number: first in stages, then with one period for the whole run.

    A run that does not hold four periods of each stage has no stages.
    """
    band, duration = limits.bandwidth, reference.duration
    generators = [np.random.default_rng([seed, number]) for number in range(starts)]
    search = partial(Search, experiment=experiment, reference=reference, limits=limits, measure=measure)
    patterns = patterns_for(experiment, reference, limits, measure)
    stages = staged(experiment, limits, patterns, GRID, duration, RAMP / band)
    holds_stages = np.diff(stages.border).min() >= 4 * stages.periodic.period
    if holds_stages:
        yield search(stages=stages), {0: patterned(stages, patterns, generators[0])}
    if starts > 1 or not holds_stages:
        periodic = Periodic.of(experiment.platform, limits, period=period, band=band, rate=GRID * band)
        whole_run = Stages.of(periodic, np.ones(1), duration, RAMP / band)
        numbers = range(1 if holds_stages else 0, starts)
        first = {number: start(periodic, experiment.r_cg_from_omb, generators[number], number) for number in numbers}
        yield search(stages=whole_run), first


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
        platform = experiment.platform

        def goal(unknowns):
            motion = stages.moved(platform, unknowns, r_cg, gravity)
            used = shares(effort_of(experiment, motion.platform), limits)
            mean_error, covariance = prediction.moments(motion.body, motion.jerk, gain, samples)
            most = jnp.concatenate([jnp.abs(stages.finer(used[name])).ravel() for name in names])
            return jnp.log(measure(covariance, mean_error)), most - 1

        self.lagrangian = Lagrangian(goal)

    def finish(self, optimum: Optimum, fine: float, tell: Progress) -> PredictedTrajectory | None:
        """Return the whole run, of the largest size that meets the limits on a finer grid; None: no size."""
        short = lambda size: self._spec(size * optimum.unknowns, short=True)  # noqa: E731
        full = lambda size: self._spec(size * optimum.unknowns)  # noqa: E731
        size = largest_size(self.experiment, short, self.limits, fine)
        spec = reduced(self.experiment, full, size, self.limits, fine, tell=tell)
        return None if spec is None else PredictedTrajectory.of(self.experiment, spec, self.limits.bandwidth)

    def _spec(self, unknowns: np.ndarray, short: bool = False) -> TrajectorySpec:
        trajectory = self.stages.multisine(unknowns, short=short)
        return replace(self.spec, trajectory=trajectory, duration=float(trajectory.duration))


def limited(limits: Limits) -> list[str]:
    """Return the quantities that are limited, as :func:`identify.motion.leg_limits.shares` names them."""
    values: Any = limits._replace(length=limits.length[:, 1])._asdict()
    return [name for name, value in values.items() if name != "bandwidth" and np.isfinite(value).any()]
