"""The gyro's scale factors change as it warms up.

Looks like: a gyro's scale that is right at the start and wrong at the end. Matters: as half of it. Do: let it warm up.
"""

from dataclasses import replace

from identify.errors.error_model import CauseWords, ErrorModel, Numbers, Stage, TypicalSize
from identify.errors.priors_of_size import fixed
from identify.errors.rig_state import RigState
from identify.errors.written_sizes import every

# 100 ppm/K over 20 K
TYPICAL = TypicalSize(
    figure=0.002, key_unit="%", text="warming of the gyro", unit="%", per_si=100.0,
    about="Change of the scale of each axis of the gyro over a run.",
)  # fmt: skip


def act(state: RigState, change: Numbers) -> RigState:
    """Return the state of a gyro that reads so much more at the end than at the start, in parts of one."""
    true = state.true
    scale = 1 + (true.progress + 0.5)[:, None] * change
    slope = state.gyro_slope * scale + state.gyro * change / true.duration
    return replace(state, gyro=state.gyro * scale, gyro_slope=slope)


GYRO_WARMING = ErrorModel(
    name="gyro_warming", count=3, act=act, linear=True, stage=Stage.SENSOR_GAIN, part="gyro", scope="run",
    unknowns=("gyro_warming",), declared_as=("omega", "warming"), typical=TYPICAL, prior=fixed(*[TYPICAL.figure] * 3),
    words=CauseWords(
        "gyro warming", "the gyro's scale factors changed by {} over the run", "let it warm up", every(100.0, "%")
    ),
)  # fmt: skip
