"""The gyro reads a turn where there is none.

Looks like: an attitude that turns away. Matters: the vertical is lost, where it follows from the gyro. Do: keep the
body still for a while before the run.
"""

from dataclasses import replace

from identify.errors.error_model import ErrorModel, Numbers, Stage
from identify.errors.rig_state import RigState


def act(state: RigState, bias: Numbers) -> RigState:
    """Return the state of a gyro that adds a constant on each of its axes [rad/s]."""
    return replace(state, gyro=state.gyro + bias)


GYRO_BIAS = ErrorModel(
    name="gyro_bias",
    count=3,
    act=act,
    linear=True,
    stage=Stage.SENSOR_ZERO,
    part="gyro",
    scope="run",
    unknowns=("gyro_bias",),
    by_hand=True,
)
