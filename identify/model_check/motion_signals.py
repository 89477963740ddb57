"""A run's signals in its band, with the attitude that the gyro integrates to: what a check of the model needs.

In NumPy: the joint model is compiled anew for every length of run, which takes longer than all that is done here.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import scipy
from jaxtyping import Float

from identify.joint.joint_model import WANDER
from identify.rigid_body.regressor import cross_matrices
from identify.rigid_body.rotation import (
    closest_rotation,
    cumulative_product,
    exponential,
    exponentials,
    rotation_vectors,
)
from identify.signals.band_limited_run import InBand, in_band
from identify.signals.resample import UniformSpline
from identify.signals.run import Run

LEFT_OUT = 0.001
"""Largest share of a run's rows that is left out for speed."""


@dataclass(frozen=True)
class MotionSignals:
    """Rows of a run that count, samples first, in B, SI."""

    t: Float[np.ndarray, " n"]
    """Instants from the first node [s]."""
    force: Float[np.ndarray, "n 3"]
    moment: Float[np.ndarray, "n 3"]
    omega: Float[np.ndarray, "n 3"]
    """Angular velocity from the gyro, its slow errors removed [rad/s]."""
    alpha: Float[np.ndarray, "n 3"]
    jerk: Float[np.ndarray, "n 3"]
    """Derivative of alpha [rad/s³]."""
    accelerometer: Float[np.ndarray, "n 3"] | None
    """Specific force at the IMU [m/s²]."""
    accelerometer_slope: Float[np.ndarray, "n 3"] | None
    turns: Float[np.ndarray, "n 3 3"]
    """Rotation from B at each row to B at the first node."""
    interval: float
    """Time from row to row [s]."""
    band: float
    """Highest frequency of the motion [Hz]."""

    @property
    def progress(self) -> np.ndarray:
        """Progress of the run, from -1/2 to 1/2."""
        return (self.t - self.t.mean()) / max(np.ptp(self.t), 1e-300)

    @property
    def attitude(self) -> np.ndarray:
        """Rotation vector from the mean attitude, in B [rad]."""
        return rotation_vectors(closest_rotation(self.turns.mean(axis=0)).T @ self.turns)

    @cached_property
    def spin(self) -> Float[np.ndarray, "n 3 3"]:
        """``omega ×``, as matrices."""
        return cross_matrices(self.omega)

    @cached_property
    def levers(self) -> Float[np.ndarray, "n 3 3"]:
        """``alpha × + omega × (omega ×``, as matrices: the acceleration by a lever arm in B."""
        return cross_matrices(self.alpha) + self.spin @ self.spin

    def turned(self, rate: Float[np.ndarray, "n 3 p"]) -> Float[np.ndarray, "n 3 p"]:
        """Return the rotation of the attitude, in B at the first node, that changes of the angular velocity cause."""
        steps = self.turns @ rate
        return np.asarray(self.interval * (np.cumsum(steps, axis=0) - (steps + steps[0]) / 2))


class ReducedRun:
    """A run reduced to its band, from which signals are taken for one alignment and one slow error of the gyro."""

    def __init__(self, run: Run, band: float, *, reach: float) -> None:
        """Reduce a run; RunError where it is too short."""
        self.rows: InBand = in_band(run, band, reach=reach, accelerometer=run.specific_force is not None)
        used = np.asarray(self.rows.used) > 0
        self.used = used & (np.cumsum(used) <= _fast_count(int(used.sum())))
        self.motion = UniformSpline(np.asarray(self.rows.motion), self.rows.step)

    def slow_basis(self, t: np.ndarray) -> Float[np.ndarray, "n terms"]:
        """Return one and the slow terms of the gyro's random walk, at some instants."""
        duration = self.rows.duration
        half_waves = (np.arange(WANDER) + 0.5) * np.pi / duration
        walk = np.sqrt(2 / duration) * np.cos(np.outer(t, half_waves))
        return np.column_stack([np.ones(len(t)), walk])

    def signals(self, slow: Float[np.ndarray, "terms 3"], x: Mapping[str, np.ndarray]) -> MotionSignals:
        """Return the signals for these slow errors of the gyro, and the delay, rotation, drift and scale of x."""
        rows, used, scale = self.rows, self.used, 1 + x["gyro_scale"]
        turn = exponential(x["rotation"])
        t = np.asarray(rows.t)
        value, slope, second = (self.motion(t + float(x["delay"][0]), order)[used] for order in range(3))
        omega = (value[:, :3] - self._slow(t, slow, x)[used]) / scale
        read = value.shape[1] > 3
        later = exponentials(float(x["delay"][0]) * omega)
        alpha, jerk = (slope[:, :3] - x["gyro_drift"]) / scale, second[:, :3] / scale
        return MotionSignals(
            t=t[used],
            force=np.asarray(rows.force).T[used],
            moment=np.asarray(rows.moment).T[used],
            omega=omega @ turn.T,
            alpha=alpha @ turn.T,
            jerk=jerk @ turn.T,
            accelerometer=value[:, 3:] @ turn.T if read else None,
            accelerometer_slope=slope[:, 3:] @ turn.T if read else None,
            turns=turn @ self._attitude(slow, x)[rows.at_rows][used] @ later @ turn.T,
            interval=rows.interval,
            band=rows.band,
        )

    def _slow(self, t: np.ndarray, slow: np.ndarray, x: Mapping[str, np.ndarray]) -> Float[np.ndarray, "n 3"]:
        return np.asarray(self.slow_basis(t) @ slow + np.outer(t - 0.5 * self.rows.duration, x["gyro_drift"]))

    def _attitude(self, slow: np.ndarray, x: Mapping[str, np.ndarray]) -> Float[np.ndarray, "nodes 3 3"]:
        """Fourth-order Magnus steps on two Gauss points each, from node to node, in the IMU's axes."""
        step = self.rows.step
        starts = step * np.arange(self.rows.motion.shape[1])
        points = [starts + (0.5 + sign * np.sqrt(3) / 6) * step for sign in (-1, 1)]
        first, second = ((self.motion(t)[:, :3] - self._slow(t, slow, x)) / (1 + x["gyro_scale"]) for t in points)
        turns = exponentials(step / 2 * (first + second) + np.sqrt(3) / 12 * step**2 * np.cross(first, second))
        return cumulative_product(np.concatenate([np.eye(3)[None], turns]))


def _fast_count(rows: int) -> int:
    """Return the number of rows that count: a few less of a long run, for a three times faster transform."""
    fast = int(scipy.fft.prev_fast_len(rows)) if rows else 0
    return fast if rows - fast <= LEFT_OUT * rows else rows
