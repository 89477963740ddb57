"""What the sensors of a recorded or simulated run show at any time."""

import numpy as np
from numpy.typing import NDArray

from rig.channels import Recording
from rig.devices.line import IMU, WRENCH


class Signals:
    """What the sensors of an experiment show, by linear interpolation between the samples of a run.

    ``time`` (n,) [s] from 0, ``values`` (n, 12): wrench on the body [N, N·m], angular velocity [rad/s], specific force
    [m/s²].
    """

    NAMES = WRENCH + IMU

    def __init__(self, time: NDArray[np.float64], values: NDArray[np.float64]) -> None:
        self.time, self.values = time, values

    @property
    def duration(self) -> float:
        """Time of the last sample [s]."""
        return float(self.time[-1])

    @classmethod
    def of(cls, run: Recording) -> "Signals":
        """The signals of a recorded run, by header stamps, from the first to the last time that both channels cover."""
        start = max(run.wrench.stamp[0], run.imu.stamp[0])
        t_wrench, t_imu = ((channel.stamp - start) * 1e-9 for channel in (run.wrench, run.imu))
        wrench = np.concatenate([run.wrench.force, run.wrench.moment], axis=1)
        imu = np.concatenate([run.imu.angular_velocity, run.imu.linear_acceleration], axis=1)
        time = t_imu if len(t_imu) >= len(t_wrench) else t_wrench
        time = time[(time >= 0) & (time <= min(t_wrench[-1], t_imu[-1]))]
        columns = [np.interp(time, t_wrench, column) for column in wrench.T]
        columns += [np.interp(time, t_imu, column) for column in imu.T]
        return cls(time, np.stack(columns, axis=1))

    def sample(self, times: NDArray[np.float64], names: tuple[str, ...], matrix: NDArray[np.float64]) -> NDArray:
        """The named values at ``times`` (m,) as the sensor reads them, (m, len(names)); ``matrix``: sensor to body."""
        columns = {name: np.interp(times, self.time, self.values[:, i]) for i, name in enumerate(self.NAMES)}
        chosen = np.stack([columns.get(name, np.zeros(len(times))) for name in names], axis=1)
        if names in (WRENCH, IMU):
            return np.concatenate([chosen[:, :3] @ matrix, chosen[:, 3:] @ matrix], axis=1)
        return chosen
