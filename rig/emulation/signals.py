"""Readings of the sensors of a recorded or simulated run at any time."""

import numpy as np
from numpy.typing import NDArray

from rig.channels import ImuChannel, MotionChannel, Recording
from rig.devices.base import IMU, WRENCH


class Signals:
    """Signals of an experiment's sensors, by linear interpolation between the samples of a run.

    ``time`` (n,) [s] from 0, ``columns`` (n,) by name: wrench on the body [N, N·m], angular velocity [rad/s] and
    specific force [m/s²], or positions and velocities of joints [rad, rad/s].
    """

    def __init__(self, time: NDArray[np.float64], columns: dict[str, NDArray[np.float64]]) -> None:
        self.time, self.columns = time, columns

    @property
    def duration(self) -> float:
        """Time of the last sample [s]."""
        return float(self.time[-1])

    @classmethod
    def of(cls, run: Recording) -> "Signals":
        """The signals of a recorded run, by header stamps, from the first to the last time that both channels cover."""
        start = max(run.wrench.stamp[0], run.motion.stamp[0])
        t_wrench, t_motion = ((channel.stamp - start) * 1e-9 for channel in (run.wrench, run.motion))
        time = t_motion if len(t_motion) >= len(t_wrench) else t_wrench
        time = time[(time >= 0) & (time <= min(t_wrench[-1], t_motion[-1]))]
        wrench = np.concatenate([run.wrench.force, run.wrench.moment], axis=1)
        columns = {name: np.interp(time, t_wrench, column) for name, column in zip(WRENCH, wrench.T, strict=True)}
        motion = {name: np.interp(time, t_motion, column) for name, column in _motion(run.motion).items()}
        return cls(time, columns | motion)

    def sample(self, times: NDArray[np.float64], names: tuple[str, ...], matrix: NDArray[np.float64]) -> NDArray:
        """The named values at ``times`` (m,) as the sensor reads them, (m, len(names)); ``matrix``: sensor to body.

        What the run does not hold is zero.
        """
        columns = [np.interp(times, self.time, self.columns[n]) if n in self.columns else 0 * times for n in names]
        chosen = np.stack(columns, axis=1)
        if names[:6] in (WRENCH, IMU):
            chosen[:, :3], chosen[:, 3:6] = chosen[:, :3] @ matrix, chosen[:, 3:6] @ matrix
        return chosen


def _motion(channel: ImuChannel | MotionChannel) -> dict[str, NDArray[np.float64]]:
    if isinstance(channel, ImuChannel):
        rows = np.concatenate([channel.angular_velocity, channel.linear_acceleration], axis=1)
        return dict(zip(IMU, rows.T, strict=True))
    columns: dict[str, NDArray[np.float64]] = {}
    for kind, numbers in (("position", channel.position), ("velocity", channel.velocity)):
        if numbers is not None and numbers.shape[1]:
            columns |= {f"{kind} {name}": column for name, column in zip(channel.names, numbers.T, strict=True)}
    return columns
