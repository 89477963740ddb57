"""The IMU's clock drifts against the load cell's.

Looks like: a delay that grows over the run. Matters: as the mean delay, which is any. Do: check the stamps.
"""

from identify.errors.error_model import CauseWords, ErrorModel, Numbers, Stage
from identify.errors.priors_of_size import fixed
from identify.errors.rig_state import RigState
from identify.errors.written_sizes import first


def act(state: RigState, seconds: Numbers) -> RigState:
    """Return the state of an IMU whose delay changes over the run by the first number about the second."""
    growth, middle = seconds  # any in the middle: clocks agree at the start rather than midway
    return state.with_late_imu(growth * state.true.progress + middle)


CLOCK = ErrorModel(
    name="clock",
    count=2,
    act=act,
    stage=Stage.STAMPS,
    part="imu",
    scope="run",
    prior=fixed(0.02, 0.01),
    words=CauseWords("clock", "the IMU's clock drifted by {} over the run", "check the stamps", first(1e3, "ms")),
)
