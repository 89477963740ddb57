"""The accelerometer's axes are not the gyro's.

Looks like: a specific force that is turned against the rotation. Matters: mass times distance, by the angle. Do:
calibrate the rig with a known body, or declare it.
"""

from dataclasses import replace

from identify.errors.error_model import ErrorModel, Numbers, Stage, TypicalSize
from identify.errors.rig_state import RigState
from identify.rigid_body.rotation import exponential

# the same turn as the gyro's against the accelerometer, which is the one that counts where neither is declared
TYPICAL = TypicalSize(
    figure=0.005, counts=False, key_unit="rad", text="turn of the accelerometer's axes against the gyro's",
    unit="mrad", per_si=1e3,
    about="Rotation of the accelerometer's axes against the gyro's; missing, `gyro_axes` holds it.",
)  # fmt: skip


def act(state: RigState, turn: Numbers) -> RigState:
    """Return the state of an accelerometer whose axes are turned by a rotation vector [rad]."""
    return replace(state, accelerometer=state.accelerometer @ exponential(turn))


ACCELEROMETER_AXES = ErrorModel(
    name="accelerometer_axes", count=3, act=act, stage=Stage.SENSOR_AXES,
    part="accelerometer", needs=frozenset({"accelerometer"}), unknowns=("accelerometer_axes",),
    declared_as=("accelerometer", "misalignment"), typical=TYPICAL,
)  # fmt: skip
