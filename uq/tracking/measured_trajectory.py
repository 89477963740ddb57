"""The rotation that a platform really ran, as a trajectory: the gyro's angular velocity, low-passed, by splines."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import scipy
from jaxtyping import Array, Float

from identify.motion.trajectory import Scalar, Trajectory
from identify.signals.filters import lowpass
from identify.signals.run import Run
from uq.experiment.experiment import TrajectorySpec
from uq.tracking.followed import Followed

CLOSE = 20.0
"""Samples of the measured motion to a period of its highest frequency."""


class MeasuredRotation(Trajectory):
    """A measured rotation: a cubic spline through its samples, at rest outside of them."""

    pieces: Float[Array | np.ndarray, "4 n 3"]
    """Coefficients of the cubic in each interval, that of the third power first [rad/s]."""
    interval: Scalar
    """Time between samples [s]."""
    duration: Scalar
    """Duration of the motion [s]."""
    ramp: Scalar
    """Ramp of the plan [s]."""
    plan: Trajectory
    """Planned trajectory, whose displacement the measured motion is taken to have."""

    def omega(self, t: Float[Array, ""]) -> Float[Array, "3"]:
        """Return the angular velocity in B at ``t``."""
        count = self.pieces.shape[1]
        number = jnp.clip(jnp.floor(t / self.interval), 0.0, count - 1.0)
        x = jnp.clip(t, 0.0, count * self.interval) - number * self.interval
        a, b, c, d = jnp.asarray(self.pieces)[:, number.astype(int)]
        return ((a * x + b) * x + c) * x + d

    def displacement(self, t: Float[Array, ""]) -> Float[Array, "3"]:
        """Return the plan's displacement."""
        return self.plan.displacement(t)


def measured_trajectory(run: Run, spec: TrajectorySpec, followed: Followed, band: float) -> TrajectorySpec:
    """Return the measured motion as a trajectory: without offset, low-passed above its band, from the plan's start."""
    t = run.t - run.t[0] - followed.common_lag
    omega = run.omega - followed.offset
    nyquist = 3 * band  # flat to 0.4 of it
    if nyquist < run.rate / 2:
        taps = lowpass(run.rate, nyquist)
        half = len(taps) // 2
        omega = scipy.signal.oaconvolve(np.pad(omega, ((half, half), (0, 0))), taps[:, None], mode="valid", axes=0)
    stride = max(1, int(run.rate / (CLOSE * band)))
    interval = stride / run.rate
    at = np.arange(int(np.ceil(spec.duration / interval)) + 1) * interval
    inside = (at >= t[0]) & (at <= t[-1])
    values = np.where(inside[:, None], scipy.interpolate.CubicSpline(t, omega)(np.clip(at, t[0], t[-1])), 0.0)
    pieces = scipy.interpolate.CubicSpline(at, values).c
    ramp = spec.trajectory.ramp  # type: ignore[attr-defined]
    trajectory = MeasuredRotation(
        pieces=pieces, interval=np.array(interval), duration=np.array(spec.duration), ramp=np.asarray(ramp),
        plan=spec.trajectory,
    )  # fmt: skip
    return dataclasses.replace(spec, trajectory=trajectory)
