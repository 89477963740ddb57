"""What a design is to beat: a known trajectory, as fast and as large as the same limits allow."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import jax.numpy as jnp
import numpy as np

from identify.motion.leg_limits import Limits
from identify.motion.trajectory import Multisine, Sphere, sample
from uq.excitation.design_goal import Measure
from uq.excitation.rig_limits import uses
from uq.experiment.experiment import Experiment, TrajectorySpec
from uq.files.document import ExperimentError
from uq.propagation.prediction import Prediction, jerk_of

SPEEDS = 8
"""Factors of speed that are tried beside the given one, up to the bandwidth."""
HALVINGS = 11
"""Of the interval in which the largest amplitude is sought."""
COARSE = 12
"""Instants in a period of the highest frequency at which amplitudes are sought."""
WEIGHT = 3.0
"""How much slower than the motion a share of a limit may shrink: a leg's force, of which the weight is part."""
FROM_LIMIT = 1e-9
"""Relative distance from a limit that counts as met: the rounding of an integrated attitude."""


OfSize = Callable[[float], TrajectorySpec]


@dataclass(frozen=True, eq=False)
class Promise:
    """A trajectory and what it promises."""

    spec: TrajectorySpec
    covariance: np.ndarray
    """Of the tensor, packed [(kg·m²)²]."""


def promise(experiment: Experiment, spec: TrajectorySpec, rate: float) -> Promise:
    """Return the covariance that a trajectory promises over its whole run, from instants of a rate [Hz]."""
    still = np.zeros(3) if spec.still == "cg" else experiment.r_cg_from_omb
    t = jnp.arange(0.0, spec.duration, 1 / rate)
    motion = sample(spec.trajectory, t, r_cg_from_still=still, gravity=np.array(experiment.gravity))
    covariance = Prediction.of(experiment, spec).covariance(motion, jerk_of(spec, motion))
    if not np.isfinite(covariance).all():
        raise ExperimentError("the reference trajectory does not tell all six components: choose another")
    return Promise(spec, np.asarray(covariance))


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


def largest(experiment: Experiment, of_size: OfSize, limits: Limits, rate: float) -> float:
    """Return the largest size, from 0 to 2, at which a trajectory meets the limits.

    Args:
        experiment: with platform and body.
        of_size: the trajectory at a size.
        limits: to be met.
        rate: of the instants that are looked at [Hz].
    """

    def met(size: float) -> bool:
        return worst_use(experiment, of_size(size), limits, rate) <= 1 + FROM_LIMIT

    low, high = (1.0, 1.2) if met(1.0) else (0.8, 1.0)
    if not met(low):
        low, high = 0.0, low
    elif met(high):
        low, high = high, 2.0
    for _ in range(HALVINGS):
        middle = (low + high) / 2
        low, high = (middle, high) if met(middle) else (low, middle)
    return low


def worst_use(experiment: Experiment, spec: TrajectorySpec, limits: Limits, rate: float) -> float:
    """Return the largest share of any limit over a trajectory's whole run."""
    listed = uses(experiment, spec, limits, rate)
    return listed[0].share if listed else 0.0


def best_reference(
    experiment: Experiment, spec: TrajectorySpec, limits: Limits, measure: Measure, rate: float
) -> Promise:
    """Return a trajectory at the size and speed that promise most under the limits.

    Args:
        experiment: with platform, body and sources.
        spec: the trajectory; a Sphere, Harmonic or Multisine.
        limits: to be met at every instant.
        measure: what is to be small, of the covariance.
        rate: of the instants at which the limits must be met in the end [Hz].

    Raises:
        ExperimentError: no size of it meets the limits.
    """
    band = limits.bandwidth
    found = []
    top = band / highest_frequency(spec) * (1 - 1e-9)
    for speed in [1.0, *np.geomspace(min(1.0, top) * 0.8, max(1.0, top), SPEEDS)]:
        faster = scaled(spec, 1 / speed**2, speed)
        if highest_frequency(faster) <= band:
            of_size = partial(scaled, faster, speed=1.0)
            size = largest(experiment, of_size, limits, COARSE * band)
            found.append(promise(experiment, of_size(size), 10 * band))
    if not found:
        raise ExperimentError("the reference trajectory is faster than platform.limits.bandwidth: choose another")
    best = min(found, key=lambda one: float(measure(jnp.asarray(one.covariance))))
    return _within(experiment, best, limits, rate)


def _within(experiment: Experiment, best: Promise, limits: Limits, rate: float) -> Promise:
    """Make a trajectory smaller until a finer look finds it within the limits."""
    spec, band = best.spec, limits.bandwidth
    for _ in range(5):
        share = worst_use(experiment, spec, limits, rate)
        if share <= 1 + FROM_LIMIT:
            return best if spec is best.spec else promise(experiment, spec, 10 * band)
        spec = scaled(spec, 1 / (1 + WEIGHT * (share - 1)), 1.0)
    raise ExperimentError("the reference trajectory does not meet platform.limits at any size: choose another")
