"""The accelerometer's scale factors are wrong.

Looks like: specific force in proportion to the load cell's. Matters: mass, and the weight's moment that is taken for
inertia. Do: calibrate it.
"""

from dataclasses import replace

from identify.errors.error_model import CauseWords, ErrorModel, Numbers, Stage, TypicalSize
from identify.errors.priors_of_size import fixed
from identify.errors.rig_state import RigState
from identify.errors.written_sizes import every

# as the gyro
TYPICAL = TypicalSize(
    figure=0.003, key_unit="%", text="scale of the accelerometer", unit="%", per_si=100.0,
    about="Scale error of each axis of the accelerometer, where the estimate takes the specific force from it.",
)  # fmt: skip


def act(state: RigState, scale: Numbers) -> RigState:
    """Return the state of an accelerometer that reads so much more on each of its axes, in parts of one."""
    return replace(state, accelerometer=state.accelerometer * (1 + scale))


ACCELEROMETER_SCALE = ErrorModel(
    name="accelerometer_scale", count=3, act=act, linear=True, stage=Stage.SENSOR_GAIN,
    part="accelerometer", needs=frozenset({"accelerometer"}), unknowns=("accelerometer_scale",),
    declared_as=("accelerometer", "scale"),
    typical=TYPICAL, replaced_by_cause=True, prior=fixed(*[TYPICAL.figure] * 3),
    words=CauseWords(
        "accelerometer scale", "the accelerometer's scale factors were wrong by {}", "calibrate it", every(100.0, "%")
    ),
)  # fmt: skip
