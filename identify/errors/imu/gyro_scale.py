"""The gyro's scale factors are wrong.

Looks like: angular velocity in proportion to that by gravity or moment. Matters: the tensor errs in proportion. Do:
calibrate the gyro, declare a scale, or check its unit.
"""

from dataclasses import replace

from identify.errors.error_model import CauseWords, ErrorModel, Numbers, Stage, TypicalSize
from identify.errors.priors_of_size import fixed
from identify.errors.rig_state import RigState
from identify.errors.written_sizes import every

# MEMS gyros of rate grade
TYPICAL = TypicalSize(
    figure=0.003, key_unit="%", text="scale of the gyro", unit="%", per_si=100.0,
    about="Scale error of each axis of the gyro.",
)  # fmt: skip


def act(state: RigState, scale: Numbers) -> RigState:
    """Return the state of a gyro that reads so much more on each of its axes, in parts of one."""
    return replace(state, gyro=state.gyro * (1 + scale), gyro_slope=state.gyro_slope * (1 + scale))


GYRO_SCALE = ErrorModel(
    name="gyro_scale", count=3, act=act, linear=True,
    stage=Stage.SENSOR_GAIN, part="gyro", unknowns=("gyro_scale",), by_hand=True,
    declared_as=("omega", "scale"), typical=TYPICAL, replaced_by_cause=True, prior=fixed(*[TYPICAL.figure] * 3),
    words=CauseWords(
        "gyro scale", "the gyro's scale factors were wrong by {}", "calibrate it, declare a scale, or check its unit",
        every(100.0, "%"),
    ),
)  # fmt: skip
