"""Where the search for a motion in stages starts: the legs' optimal patterns, each driven by one wave."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from identify.motion.information_bound import tensor_covariance
from identify.motion.leg_limits import Limits
from identify.motion.periodic_motion import Periodic, accelerations
from identify.motion.phase_patterns import Mixture, mixture
from identify.motion.stages import Stages
from identify.motion.stewart_platform import jacobian, lengths
from uq.excitation.design_goal import Measure
from uq.experiment.experiment import Experiment, TrajectorySpec
from uq.propagation.prediction import Prediction

UNKNOWN = 3
"""Harmonics of a stage where speed, stroke or acceleration of a leg are free."""
DITHER = 0.03
"""Standard deviation of what is added to a start's unknowns, so that no symmetry holds the search."""


def patterns_for(experiment: Experiment, spec: TrajectorySpec, limits: Limits, measure: Measure) -> Mixture:
    """Return the mixture of the legs' patterns that is best for a goal, by the load cell's white noise alone.

    Args:
        experiment: body, platform and sources.
        spec: how long and how often is sampled.
        limits: in figures.
        measure: what is to be small, of the covariance.
    """
    noise = np.asarray(Prediction.of(experiment, spec).moment_noise)
    covariance = tensor_covariance(spec.rate * spec.duration, noise if np.linalg.eigvalsh(noise)[0] > 0 else np.eye(3))
    at_home = np.asarray(jacobian(experiment.platform, experiment.platform.home_pose))
    to_alpha = np.linalg.inv(at_home)[3:] * accelerations(limits)
    return mixture(lambda moment: measure(covariance(moment)), to_alpha).both_ways()


def harmonics(experiment: Experiment, limits: Limits) -> int:
    """Return how many harmonics a stage has: the lowest at which a sine of full acceleration meets all else is one."""
    home = np.asarray(lengths(experiment.platform, experiment.platform.home_pose))
    stroke = np.abs(limits.length - home[:, None]).min(axis=1)
    lowest = np.maximum(limits.acceleration / limits.speed, np.sqrt(limits.acceleration / stroke)).max() / (2 * np.pi)
    return max(1, int(limits.bandwidth / lowest)) if np.isfinite(lowest) and lowest > 0 else UNKNOWN


def staged(
    experiment: Experiment, limits: Limits, patterns: Mixture, grid: int, duration: float, ramp: float
) -> tuple[Stages, Callable[[np.random.Generator], Float[np.ndarray, " u"]]]:
    """Return the stages that run through some patterns, and a function that gives the search's start.

    Args:
        experiment: with the platform.
        limits: in figures.
        patterns: one for each stage, and their shares.
        grid: instants in a period of the highest frequency.
        duration: of the run [s].
        ramp: time to start and to stop each stage [s].
    """
    band = limits.bandwidth
    period = harmonics(experiment, limits) / band
    periodic = Periodic.of(experiment.platform, limits, period=period, band=band, rate=grid * band)
    stages = Stages.of(periodic, patterns.share, duration, ramp)

    def first(generator: np.random.Generator) -> Float[np.ndarray, " u"]:
        motions = DITHER * generator.normal(size=(stages.count, 2, 6, len(periodic.frequency)))
        motions[:, 0, :, 0] += patterns.phasors.real
        motions[:, 1, :, 0] -= patterns.phasors.imag
        return motions.ravel()

    return stages, first
