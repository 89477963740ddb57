"""The reference trajectory that a design is to beat: a known one, as fast and as large as the same limits allow."""

from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from identify.motion.leg_limits import Limits
from identify.motion.multisine import Multisine
from identify.motion.trajectory import Sphere
from identify.signals.estimator_spec import EstimatorSpec
from uq.excitation.design_goal import Measure, expanded
from uq.excitation.designed_experiment import NAME
from uq.excitation.rig_limits import FROM_LIMIT, largest_size, largest_use
from uq.experiment.experiment import Experiment, TrajectorySpec
from uq.files.document import ExperimentError
from uq.propagation.prediction import predicted

SPEEDS = 8
"""Factors of speed that are tried beside the given one, up to the bandwidth."""
COARSE = 12
"""Instants in a period of the highest frequency at which amplitudes are sought."""
PREDICTED = 10
"""Instants in a period of the highest frequency at which the covariance is predicted."""
WEIGHT = 3.0
"""Factor on a limit's excess by which a motion is reduced: a leg's force, which includes the weight, shrinks less."""


@dataclass(frozen=True, eq=False)
class PredictedTrajectory:
    """A trajectory and the uncertainty that it promises."""

    spec: TrajectorySpec
    mean_error: Float[np.ndarray, "6"]
    """Mean error of the packed tensor [kg·m²], with a differentiator matched to the trajectory's highest frequency."""
    covariance: Float[np.ndarray, "6 6"]
    """Covariance of the packed tensor [(kg·m²)²]."""

    @classmethod
    def of(cls, experiment: Experiment, spec: TrajectorySpec, bandwidth: float) -> "PredictedTrajectory":
        """Predict both from ``PREDICTED`` instants in a period of the bandwidth [Hz].

        Raises:
            ExperimentError: the motion leaves a component of the tensor undetermined.
        """
        gain = differentiator(min(highest_frequency(spec), bandwidth)).alpha_noise_gain(spec.rate)
        mean_error, covariance = predicted(experiment, spec, PREDICTED * bandwidth, gain)
        if not np.isfinite(covariance).all():
            raise ExperimentError("the reference trajectory does not tell all six components: choose another")
        return cls(spec, np.asarray(mean_error), np.asarray(covariance))

    @property
    def expanded(self) -> Float[np.ndarray, "6"]:
        """Three standard deviations of each component [kg·m²]."""
        return np.asarray(expanded(jnp.asarray(self.covariance)))

    def measured_by(self, measure: Measure) -> float:
        """Return what is to be small."""
        return float(measure(jnp.asarray(self.covariance), jnp.asarray(self.mean_error)))


def differentiator(band: float) -> EstimatorSpec:
    """Return the estimator of a trajectory whose highest frequency is ``band`` [Hz], named as the designed one."""
    return EstimatorSpec(NAME, "savitzky-golay", band)


def scaled(spec: TrajectorySpec, size: float, speed: float, duration: float | None = None) -> TrajectorySpec:
    """Return a trajectory of ``size`` times its angle and displacement, ``speed`` times as fast."""
    old: Any = spec.trajectory
    longer = 1.0 if duration is None else duration / spec.duration
    common = {"duration": np.array(longer * spec.duration), "ramp": np.array(longer * old.ramp)}
    if isinstance(old, Multisine):
        start = None if old.start is None else longer * np.asarray(old.start)
        new: Any = replace(
            old, frequency=speed * old.frequency, cosine=size * old.cosine, sine=size * old.sine, start=start, **common
        )
    else:
        new = replace(
            old,
            angular_velocity=np.array(size * speed * old.angular_velocity),
            angular_acceleration=np.array(size * speed**2 * old.angular_acceleration),
            **common,
        )
    return replace(spec, trajectory=new, duration=longer * spec.duration)


def highest_frequency(spec: TrajectorySpec) -> float:
    """Return the highest frequency of a trajectory [Hz], apart from its ramps."""
    trajectory: Any = spec.trajectory
    if isinstance(trajectory, Multisine):
        return float(np.max(trajectory.frequency))
    fast = float(trajectory.angular_acceleration / trajectory.angular_velocity) / (2 * np.pi)
    return fast + (float(trajectory.precessions / trajectory.duration) if isinstance(trajectory, Sphere) else 0.0)


def best_reference(
    experiment: Experiment, spec: TrajectorySpec, limits: Limits, measure: Measure, rate: float
) -> PredictedTrajectory:
    """Return a trajectory at the size and speed that promise most under the limits.

    Args:
        experiment: with platform, body and sources.
        spec: the trajectory; a Sphere, Harmonic or Multisine.
        limits: to be met at every instant.
        measure: what is to be small.
        rate: of the instants at which the limits must be met in the end [Hz].

    Raises:
        ExperimentError: no size of it meets the limits.
    """
    band = limits.bandwidth
    candidates = []
    top = band / highest_frequency(spec) * (1 - 1e-9)
    for speed in [1.0, *np.geomspace(min(1.0, top) * 0.8, max(1.0, top), SPEEDS)]:
        faster = scaled(spec, 1 / speed**2, speed)
        if highest_frequency(faster) <= band:
            of_size = partial(scaled, faster, speed=1.0)
            size = largest_size(experiment, of_size, limits, COARSE * band)
            candidates.append(PredictedTrajectory.of(experiment, of_size(size), band))
    if not candidates:
        raise ExperimentError("the reference trajectory is faster than platform.limits.bandwidth: choose another")
    best = min(candidates, key=lambda candidate: candidate.measured_by(measure))
    return _within_limits(experiment, best, limits, rate)


def _within_limits(
    experiment: Experiment, best: PredictedTrajectory, limits: Limits, rate: float
) -> PredictedTrajectory:
    """Make a trajectory smaller until a finer look finds it within the limits."""
    spec = best.spec
    for _ in range(5):
        share = largest_use(experiment, spec, limits, rate)
        if share <= 1 + FROM_LIMIT:
            return best if spec is best.spec else PredictedTrajectory.of(experiment, spec, limits.bandwidth)
        spec = scaled(spec, 1 / (1 + WEIGHT * (share - 1)), 1.0)
    raise ExperimentError("the reference trajectory does not meet platform.limits at any size: choose another")
