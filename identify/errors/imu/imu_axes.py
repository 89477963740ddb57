"""The whole IMU is rotated against the load cell.

Looks like: motion and weight turned alike. Matters: products of inertia err by the turn times the difference of the
moments. Do: correct ``imu_rotation_to_body``.
"""

from dataclasses import replace

import numpy as np

from identify.errors.error_model import CauseWords, ErrorModel, Numbers, Stage
from identify.errors.load_cell.load_cell_axes import TYPICAL
from identify.errors.priors_of_size import fixed
from identify.errors.rig_state import RigState
from identify.errors.written_sizes import every
from identify.rigid_body.rotation import exponential


def act(state: RigState, turn: Numbers) -> RigState:
    """Return the state of an IMU that is turned from where it is believed by a rotation vector [rad]."""
    to_imu = exponential(turn)
    names = ("gyro", "gyro_slope", "accelerometer", "vertical", "imu_turn")
    return replace(state, **{name: getattr(state, name) @ to_imu for name in names})


IMU_AXES = ErrorModel(
    name="imu_axes", count=3, act=act, stage=Stage.IMU_AXES, part="imu", unknowns=("rotation",), by_hand=True,
    prior=fixed(*[TYPICAL.figure] * 3),
    words=CauseWords(
        "rotation", "the IMU were rotated against the load cell by {}", "correct imu_rotation_to_body",
        every(180 / np.pi, "deg"),
    ),
)  # fmt: skip
