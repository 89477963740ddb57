"""Statements of an experiment on body and rig, with which the judge of conventions compares a run."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

Vector = Float[np.ndarray, "3"]
Matrix = Float[np.ndarray, "3 3"]


@dataclass(frozen=True, eq=False)
class DeclaredRig:
    """The experiment's statements of body and rig; None: not stated. SI units, body frame, from Q.

    ``removed``: mass whose weight the driver removed. ``weighed``: whether the body's weight should be in the force,
    which it is not where the zero was taken with it. ``measured``: whether the specific force is an accelerometer's.
    ``units``: newtons and newton metres in the declared units of force and moment. ``rate_unit``: rad/s in that of the
    angular velocity. ``quaternion``: matrix from a quaternion to its recorded fields.
    ``turn``: standard uncertainty of a small turn of the IMU that the estimate finds by itself [rad]: no news.
    """

    mass: float | None = None
    removed: float = 0.0
    r_cg: Vector | None = None
    sigma_r_cg: Vector | None = None
    imu_position: Vector | None = None
    wrench_point: Vector | None = None
    wrench_rotation: Matrix | None = None
    imu_rotation: Matrix | None = None
    weighed: bool = True
    turn: Vector | None = None
    measured: bool = True
    units: tuple[float, float] = (1.0, 1.0)
    rate_unit: float = 1.0
    quaternion: Float[np.ndarray, "4 4"] | None = None

    @property
    def lever(self) -> Vector:
        """Centre of gravity from the IMU [m]; either is taken to be at Q where it is not stated."""
        r_cg, imu = (np.zeros(3) if r is None else r for r in (self.r_cg, self.imu_position))
        return r_cg - imu
