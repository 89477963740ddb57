"""The accelerometer's samples are older than the gyro's.

Looks like: specific force that lags behind angular velocity and load cell. Matters: weight mixes with inertia. Do: set
``accelerometer_delay`` in [recording], or give both the same filter.
"""

from dataclasses import replace

from identify.errors.error_model import CauseWords, ErrorModel, Numbers, Stage
from identify.errors.priors_of_size import fixed
from identify.errors.rig_state import RigState
from identify.errors.written_sizes import every


def act(state: RigState, seconds: Numbers) -> RigState:
    """Return the state of an accelerometer that lags behind the gyro by so much."""
    return replace(state, accelerometer=state.delayed("accelerometer", seconds[0]))


ACCELEROMETER_DELAY = ErrorModel(
    name="accelerometer_delay", count=1, act=act, stage=Stage.SENSOR_FILTER,
    part="accelerometer", needs=frozenset({"accelerometer"}),
    prior=fixed(0.005),
    words=CauseWords(
        "accelerometer delay", "the accelerometer lagged behind the gyro by {}",
        "set accelerometer_delay in [recording], or give both the same filter", every(1e3, "ms"),
    ),
)  # fmt: skip
