"""The IMU's samples are older than their stamps say.

Looks like: a motion that lags behind force and moment. Matters: inertia mixes with friction, products of inertia err.
Do: declare the delay, or let method joint estimate it.
"""

import numpy as np

from identify.errors.error_model import CauseWords, ErrorModel, Numbers, Stage, TypicalSize
from identify.errors.priors_of_size import fixed
from identify.errors.rig_state import RigState
from identify.errors.written_sizes import every

# a frame of USB 2.0
TYPICAL = TypicalSize(
    figure=0.001, key_unit="s", text="delay of the gyro", unit="ms", per_si=1e3,
    about="Delay of the gyro against the load cell.",
)  # fmt: skip


def act(state: RigState, seconds: Numbers) -> RigState:
    """Return the state of an IMU whose samples are so old when they are stamped."""
    return state.with_late_imu(np.repeat(seconds, len(state.true.t)))


DELAY = ErrorModel(
    name="delay", count=1, act=act, stage=Stage.STAMPS,
    part="imu", unknowns=("delay",), by_hand=True, declared_as=("omega", "delay"),
    typical=TYPICAL, replaced_by_cause=True, prior=fixed(TYPICAL.figure),
    words=CauseWords(
        "delay", "the angular velocity lagged by {}", "declare the delay, or let method joint estimate it",
        every(1e3, "ms"),
    ),
)  # fmt: skip
