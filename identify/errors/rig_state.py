"""A run as it is, as its sensors read it, and what the estimator believes: what errors of the rig change.

In NumPy, samples first, in SI. The wrench and the IMU's signals pass from error to error, each of which changes them as
that part of the rig does; what is in :class:`TrueMotion` stays. What is believed errs with the opposite sign: a mass
that is larger than stated is a belief that is smaller than the mass.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float

from identify.rigid_body.rotation import exponential
from identify.signals.resample import UniformSpline, uniform_spline

Signal = Float[np.ndarray, "n 3"]


@dataclass(frozen=True, kw_only=True, eq=False)
class TrueMotion:
    """Motion, vertical and body of a run as they are, at uniform instants; vectors in B."""

    t: Float[np.ndarray, " n"]
    """Instants from the run's start [s]."""
    duration: float
    """Time from start to end [s]."""
    omega: Signal
    alpha: Signal
    specific_force: Signal
    """Specific force at the centre of gravity [m/s²]."""
    up: Signal
    """Direction opposite to gravity."""
    turning: Signal
    """Rotation vector from the mean attitude [rad]."""
    mass: float
    r_cg: Float[np.ndarray, "3"]
    """Centre of gravity from Q [m]."""
    inertia: Float[np.ndarray, "6"]
    """Packed tensor about the centre of gravity [kg·m²]."""
    zero_axes: Float[np.ndarray, "n 3 3"] | None = None
    """Rotations from B to the axes along which the load cell's zero is constant; None: B's."""

    @property
    def progress(self) -> Float[np.ndarray, " n"]:
        """Progress of the run, from -1/2 to 1/2."""
        return self.t / self.duration - 0.5

    @property
    def interval(self) -> float:
        """Seconds between samples."""
        return float(self.t[-1] - self.t[0]) / (len(self.t) - 1)


@dataclass(frozen=True, kw_only=True, eq=False)
class Beliefs:
    """Quantities that the estimator takes as known, at each instant; names are those of the joint model's unknowns."""

    mass: Float[np.ndarray, "n 1"]
    r_cg: Signal
    inertia: Float[np.ndarray, "n 6"]
    gravity: Float[np.ndarray, "n 1"]
    cg_from_still: Signal
    """Centre of gravity from the point that is at rest, in B [m]."""
    imu_position: Signal
    """The accelerometer, from Q, in B [m]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RigState:
    """A run on its way through the rig."""

    true: TrueMotion
    beliefs: Beliefs
    wrench: Float[np.ndarray, "n 6"]
    """Force [N] and moment about Q [N·m]: on the body, and so on until the load cell has read them."""
    gyro: Signal
    """Angular velocity in the IMU's axes [rad/s]."""
    gyro_slope: Signal
    """Derivative of ``gyro`` by time [rad/s²]."""
    accelerometer: Signal
    """Specific force in the IMU's axes, at the IMU or, where nothing reads it, at the centre of gravity [m/s²]."""
    vertical: Float[np.ndarray, "3"]
    """Direction opposite to gravity in the IMU's axes, at the run's start."""
    imu_turn: Float[np.ndarray, "3 3"]
    """Rotation from the IMU's axes to B."""

    @property
    def parts(self) -> dict[str, np.ndarray]:
        """Arrays that errors change, by name; beliefs under the names of :class:`Beliefs`."""
        signals = {name: getattr(self, name) for name in ("wrench", "gyro", "gyro_slope", "accelerometer", "vertical")}
        return signals | vars(self.beliefs)

    def slopes(self, signal: str, orders: int = 1) -> list[Float[np.ndarray, "n k"]]:
        """Return the first derivatives by time of the signal of a name in :attr:`parts`, as many as are asked for."""
        return [self._slope(signal, order) for order in range(1, orders + 1)]

    def delayed(self, signal: str, seconds: np.ndarray | float) -> Float[np.ndarray, "n k"]:
        """Return the signal of a name in :attr:`parts` as it was so many seconds before."""
        spline, at = self._spline(signal)
        return spline(at - seconds)

    def _spline(self, signal: str) -> tuple[UniformSpline, np.ndarray]:
        """The quintic spline through a signal, made once, and the samples' instants."""
        step, values = self.true.interval, self.parts[signal]
        if signal not in self._splines:
            self._splines[signal] = uniform_spline(values, step, degree=5)
        return self._splines[signal], step * np.arange(len(values))

    def _slope(self, signal: str, order: int) -> Float[np.ndarray, "n k"]:
        """A derivative of a signal, computed once."""
        if (signal, order) not in self._slopes:
            spline, at = self._spline(signal)
            self._slopes[signal, order] = spline(at, order)
        return self._slopes[signal, order]

    @cached_property
    def _slopes(self) -> dict[tuple[str, int], np.ndarray]:
        return {}

    @cached_property
    def _splines(self) -> dict[str, UniformSpline]:
        return {}

    def with_late_imu(self, seconds: Float[np.ndarray, " n"]) -> "RigState":
        """Return the state with all signals of the IMU late by so many seconds, stamped as if they were not."""
        gyro, slope, accelerometer = (self.delayed(name, seconds) for name in ("gyro", "gyro_slope", "accelerometer"))
        rate = 1 - np.gradient(seconds, self.true.interval)  # of the IMU's clock, by which the slope is taken
        turn_since = seconds[0] * self.true.omega[0] @ self.imu_turn
        vertical = exponential(turn_since) @ self.vertical
        return replace(
            self, gyro=gyro, gyro_slope=slope * rate[:, None], accelerometer=accelerometer, vertical=vertical
        )

    def with_added(self, wrench: Float[np.ndarray, "n 6"]) -> "RigState":
        """Return the state with more force and moment."""
        return replace(self, wrench=self.wrench + wrench)

    def with_less(self, name: str, error: np.ndarray) -> "RigState":
        """Return the state whose belief is less than the truth by an error, (k,) or (n, k)."""
        return replace(self, beliefs=replace(self.beliefs, **{name: getattr(self.beliefs, name) - error}))
