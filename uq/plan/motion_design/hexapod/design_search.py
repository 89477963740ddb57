"""The search for the best motion: amplitudes of one kind of motion under all limits, from several starts.

In stages it starts from the legs' optimal patterns, each driven by one wave.
"""

from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from identify.motion.information_bound import tensor_covariance, tensor_information
from identify.motion.leg_limits import Limits, shares
from identify.motion.optimal_mixture import Mixture, mixture
from identify.motion.optimiser import Lagrangian, Optimum
from identify.motion.periodic_motion import Periodic, accelerations
from identify.motion.stages import Stages
from identify.motion.starting_motions import start
from identify.motion.stewart_platform import jacobian, lengths
from uq.analysis.propagation.prediction import Prediction
from uq.experiment.experiment import Experiment, TrajectorySpec
from uq.plan.measurement.platform_run import effort_of
from uq.plan.motion_design.design_goal import Measure
from uq.plan.motion_design.hexapod.reference_trajectory import PredictedTrajectory, differentiator
from uq.plan.motion_design.hexapod.rig_limits import largest_size, reduced
from uq.progress_bar import Progress

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
    periodic_with = partial(Periodic.of, experiment.platform, limits, band=band, rate=GRID * band)
    stage_motion = periodic_with(period=harmonics(experiment, limits) / band)
    stages = Stages.of(stage_motion, patterns.share, duration, RAMP / band)
    holds_stages = np.diff(stages.border).min() >= 4 * stages.periodic.period
    if holds_stages:
        yield search(stages=stages), {0: patterned(stages, patterns, generators[0])}
    if starts > 1 or not holds_stages:
        periodic = periodic_with(period=period)
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


UNKNOWN = 3
"""Harmonics of a stage where speed, stroke or acceleration of a leg are free."""
DITHER = 0.03
"""Standard deviation of what is added to a start's unknowns, so that no symmetry holds the search."""


def patterns_for(experiment: Experiment, spec: TrajectorySpec, limits: Limits, measure: Measure) -> Mixture:
    """Return the mixture of the legs' patterns that is best for a goal, by white noise of load cell and gyro alone.

    Args:
        experiment: body, platform and sources.
        spec: how long and how often is sampled.
        limits: in figures.
        measure: what is to be small.
    """
    prediction = Prediction.of(experiment, spec)
    noise = np.asarray(prediction.moment_noise)
    covariance = tensor_covariance(spec.rate * spec.duration, noise if np.linalg.eigvalsh(noise)[0] > 0 else np.eye(3))
    gain = differentiator(limits.bandwidth).alpha_noise_gain(spec.rate)
    mean_error = attenuation(np.asarray(experiment.body.inertia), gain**2 * np.diag(np.asarray(prediction.gyro)))
    at_home = np.asarray(jacobian(experiment.platform, experiment.platform.home_pose))
    to_alpha = np.linalg.inv(at_home)[3:] * accelerations(limits)

    def predicted(moment):
        mean_square = moment / 2  # of sines, whose amplitudes are the patterns'
        return measure(covariance(mean_square), mean_error(mean_square))

    return mixture(predicted, to_alpha).both_ways()


def attenuation(
    inertia: Float[np.ndarray, "6"], noise: Float[np.ndarray, "3 3"]
) -> Callable[[Float[Array, "3 3"]], Float[Array, "6"]]:
    """Return the mean error that white noise of alpha causes [kg·m²] as a function of the second moment of alpha.

    ``-(mean(ΩᵀΩ) + N)⁻¹ N i``, N what the noise adds to ``mean(ΩᵀΩ)``, with omega left out: errors in variables.

    Args:
        inertia: packed tensor i [kg·m²].
        noise: covariance of alpha's noise at one sample [rad²/s⁴].
    """
    squares = tensor_information(np.eye(3))
    added = squares(jnp.asarray(noise))
    return lambda moment: -jnp.linalg.solve(squares(moment) + added, added @ inertia)


def harmonics(experiment: Experiment, limits: Limits) -> int:
    """Return how many harmonics a stage has: the lowest at which a sine of full acceleration meets all else is one."""
    home = np.asarray(lengths(experiment.platform, experiment.platform.home_pose))
    stroke = np.abs(limits.length - home[:, None]).min(axis=1)
    lowest = np.maximum(limits.acceleration / limits.speed, np.sqrt(limits.acceleration / stroke)).max() / (2 * np.pi)
    return max(1, int(limits.bandwidth / lowest)) if np.isfinite(lowest) and lowest > 0 else UNKNOWN


def patterned(stages: Stages, patterns: Mixture, generator: np.random.Generator) -> Float[np.ndarray, " u"]:
    """Return the unknowns from which the search starts: each stage's pattern at its lowest frequency, and a dither."""
    motions = DITHER * generator.normal(size=(stages.count, 2, 6, len(stages.periodic.frequency)))
    motions[:, 0, :, 0] += patterns.phasors.real
    motions[:, 1, :, 0] -= patterns.phasors.imag
    return motions.ravel()
