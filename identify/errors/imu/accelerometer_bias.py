"""The accelerometer reads a specific force where there is none.

Looks like: weight along an axis of the body. Matters: little, where the attitude changes. Do: level it at rest.
"""

from dataclasses import replace

from identify.errors.error_model import ErrorModel, Numbers, Stage
from identify.errors.rig_state import RigState


def act(state: RigState, bias: Numbers) -> RigState:
    """Return the state of an accelerometer that adds a constant on each of its axes [m/s²]."""
    return replace(state, accelerometer=state.accelerometer + bias)


ACCELEROMETER_BIAS = ErrorModel(
    name="accelerometer_bias", count=3, act=act, linear=True, stage=Stage.SENSOR_ZERO,
    part="accelerometer", scope="run", needs=frozenset({"accelerometer"}),
    unknowns=("accelerometer_bias",), by_hand=True,
)  # fmt: skip
