"""The reference trajectory that a design is to beat: a known one, as fast and as large as the same limits allow."""

from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from identify.motion.leg_limits import Limits
from identify.signals.estimator_spec import EstimatorSpec
from uq.analysis.propagation.prediction import predicted
from uq.experiment.experiment import Experiment, TrajectorySpec
from uq.files.mistakes import ExperimentError
from uq.plan.motion_design.design_goal import Measure, expanded
from uq.plan.motion_design.hexapod.designed_experiment import NAME
from uq.plan.motion_design.hexapod.rig_limits import FROM_LIMIT, largest_size, reduced

SPEEDS = 8
"""Factors of speed that are tried beside the given one, up to the bandwidth."""
COARSE = 12
"""Instants in a period of the highest frequency at which amplitudes are sought."""
PREDICTED = 10
"""Instants in a period of the highest frequency at which the covariance is predicted."""


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
        gain = differentiator(min(spec.trajectory.highest_frequency, bandwidth)).alpha_noise_gain(spec.rate)
        mean_error, covariance = predicted(experiment, spec, PREDICTED * bandwidth, gain)
        if not np.isfinite(covariance).all():
            raise ExperimentError("the reference trajectory does not determine all six components: choose another")
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


def scaled(spec: TrajectorySpec, size: float, speed: float = 1.0) -> TrajectorySpec:
    """Return a trajectory of ``size`` times its angle and displacement, ``speed`` times as fast."""
    return replace(spec, trajectory=spec.trajectory.scaled(size, speed))


def stretched(spec: TrajectorySpec, duration: float) -> TrajectorySpec:
    """Return a trajectory of another duration [s], its ramps and stages in proportion."""
    old: Any = spec.trajectory
    times = {name: getattr(old, name, None) for name in ("duration", "ramp", "start")}
    longer = duration / spec.duration
    new = {name: np.array(longer * time) for name, time in times.items() if time is not None}
    return replace(spec, trajectory=replace(old, **new), duration=longer * spec.duration)


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
    top = band / spec.trajectory.highest_frequency * (1 - 1e-9)
    for speed in [1.0, *np.geomspace(min(1.0, top) * 0.8, max(1.0, top), SPEEDS)]:
        faster = scaled(spec, 1 / speed**2, speed)
        if faster.trajectory.highest_frequency <= band:
            spec_at = partial(scaled, faster)
            size = largest_size(experiment, spec_at, limits, COARSE * band)
            candidates.append(PredictedTrajectory.of(experiment, spec_at(size), band))
    if not candidates:
        raise ExperimentError("the reference trajectory is faster than platform.limits.bandwidth: choose another")
    best = min(candidates, key=lambda candidate: candidate.measured_by(measure))
    smaller = reduced(experiment, partial(scaled, best.spec), 1.0, limits, rate, met=1 + FROM_LIMIT)
    if smaller is None:
        raise ExperimentError("the reference trajectory does not meet platform.limits at any size: choose another")
    return PredictedTrajectory.of(experiment, smaller, band)
