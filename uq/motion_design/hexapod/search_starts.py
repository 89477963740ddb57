"""Starts of the search for a motion in stages: the legs' optimal patterns, each driven by one wave."""

from collections.abc import Callable

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from identify.motion.information_bound import tensor_covariance, tensor_information
from identify.motion.leg_limits import Limits
from identify.motion.periodic_motion import Periodic, accelerations
from identify.motion.phase_patterns import Mixture, mixture
from identify.motion.stages import Stages
from identify.motion.stewart_platform import jacobian, lengths
from uq.experiment.experiment import Experiment, TrajectorySpec
from uq.motion_design.design_goal import Measure
from uq.motion_design.hexapod.reference_trajectory import differentiator
from uq.propagation.prediction import Prediction

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


def staged(
    experiment: Experiment, limits: Limits, patterns: Mixture, grid: int, duration: float, ramp: float
) -> Stages:
    """Return the stages that run through some patterns.

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
    return Stages.of(periodic, patterns.share, duration, ramp)


def patterned(stages: Stages, patterns: Mixture, generator: np.random.Generator) -> Float[np.ndarray, " u"]:
    """Return the unknowns from which the search starts: each stage's pattern at its lowest frequency, and a dither."""
    motions = DITHER * generator.normal(size=(stages.count, 2, 6, len(stages.periodic.frequency)))
    motions[:, 0, :, 0] += patterns.phasors.real
    motions[:, 1, :, 0] -= patterns.phasors.imag
    return motions.ravel()
