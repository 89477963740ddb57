"""The gyro responds to acceleration.

Looks like: angular velocity that follows the specific force. Matters: the attitude turns away with gravity. Do: use the
gyro's calibration.
"""

from dataclasses import replace

from identify.errors.error_model import CauseWords, ErrorModel, Numbers, Stage
from identify.errors.priors_of_size import fixed
from identify.errors.rig_state import RigState
from identify.errors.written_sizes import largest


def act(state: RigState, sensitivity: Numbers) -> RigState:
    """Return the state of a gyro that reads so much of the specific force, each axis of each [rad/s per m/s²]."""
    matrix, force = sensitivity.reshape(3, 3).T, state.accelerometer
    gyro, slope = state.gyro + force @ matrix, state.gyro_slope + state.slopes("accelerometer")[0] @ matrix
    return replace(state, gyro=gyro, gyro_slope=slope)


GYRO_G = ErrorModel(
    name="gyro_g", count=9, act=act, linear=True, stage=Stage.SENSOR_GAIN, part="gyro", prior=fixed(*[3e-4] * 9),
    words=CauseWords(
        "gyro g-sensitivity", "the gyro responded to acceleration, {}", "use the gyro's calibration",
        largest(1e3, "mrad/s per m/s²"),
    ),
)  # fmt: skip
