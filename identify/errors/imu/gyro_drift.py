"""The gyro's zero drifts.

Looks like: an attitude that turns away faster and faster. Matters: the vertical is lost, where it follows from the
gyro. Do: let it warm up, or declare a drift.
"""

from dataclasses import replace

import numpy as np

from identify.errors.error_model import CauseWords, ErrorModel, Numbers, Stage
from identify.errors.priors_of_size import fixed
from identify.errors.rig_state import RigState
from identify.errors.written_sizes import largest


def act(state: RigState, slope: Numbers) -> RigState:
    """Return the state of a gyro whose zero drifts with a slope, counted from the run's middle [rad/s²]."""
    drift = np.outer(state.true.t - state.true.duration / 2, slope)
    return replace(state, gyro=state.gyro + drift, gyro_slope=state.gyro_slope + slope)


GYRO_DRIFT = ErrorModel(
    name="gyro_drift", count=3, act=act, linear=True, stage=Stage.SENSOR_ZERO,
    part="gyro", scope="run", unknowns=("gyro_drift",), by_hand=True,
    declared_as=("omega", "drift"), prior=fixed(*[0.001] * 3),
    words=CauseWords(
        "gyro bias", "the gyro's zero drifted by {}", "let it warm up, or declare a drift", largest(1e3, "mrad/s²")
    ),
)  # fmt: skip
