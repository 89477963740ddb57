"""The gyro is rotated against the accelerometer.

Looks like: motion turned, the weight not; without an accelerometer it is the IMU that turns. Matters: as a rotation of
the IMU. Do: calibrate it, or declare a misalignment.
"""

from dataclasses import replace

import numpy as np

from identify.errors.error_model import CauseWords, ErrorModel, Numbers, Stage, TypicalSize
from identify.errors.priors_of_size import fixed
from identify.errors.rig_state import RigState
from identify.errors.written_sizes import every
from identify.rigid_body.rotation import exponential

# a package on a board
TYPICAL = TypicalSize(
    figure=0.005, key_unit="rad", text="misalignment of the gyro", unit="mrad", per_si=1e3,
    about="Misalignment of the gyro with the accelerometer, about each axis.",
)  # fmt: skip


def act(state: RigState, turn: Numbers) -> RigState:
    """Return the state of a gyro that is turned from its axes by a rotation vector [rad]."""
    to_gyro = exponential(turn)
    return replace(state, gyro=state.gyro @ to_gyro, gyro_slope=state.gyro_slope @ to_gyro)


GYRO_AXES = ErrorModel(
    name="gyro_axes", count=3, act=act, stage=Stage.SENSOR_AXES,
    part="gyro", needs=frozenset({"accelerometer"}), unknowns=("rotation",),
    declared_as=("omega", "misalignment"), typical=TYPICAL, replaced_by_cause=True, prior=fixed(*[TYPICAL.figure] * 3),
    words=CauseWords(
        "gyro axes", "the gyro were rotated against the accelerometer by {}",
        "calibrate it, or declare a misalignment", every(180 / np.pi, "deg"),
    ),
)  # fmt: skip
