"""Axes of the gyro come late, each by its own time.

Looks like: a delay on one axis. Matters: products of the axes mix. Do: give its axes the same filter, or declare the
delay.
"""

from dataclasses import replace

import numpy as np

from identify.errors.error_model import CauseWords, ErrorModel, Numbers, Stage
from identify.errors.priors_of_size import fixed
from identify.errors.rig_state import RigState
from identify.errors.written_sizes import every


def act(state: RigState, seconds: Numbers) -> RigState:
    """Return the state of a gyro whose axes come so late, one time each."""

    def late(signal: np.ndarray) -> np.ndarray:
        axes = np.split(signal, 3, axis=1)
        return np.hstack(
            [state.delayed(axis, time) if time else axis for axis, time in zip(axes, seconds, strict=True)]
        )

    return replace(state, gyro=late(state.gyro), gyro_slope=late(state.gyro_slope))


GYRO_LATE = ErrorModel(
    name="gyro_late", count=3, act=act, stage=Stage.SENSOR_FILTER, part="gyro", prior=fixed(*[0.003] * 3),
    words=CauseWords(
        "delay", "the gyro's axes lagged by {}", "give its axes the same filter, or declare the delay",
        every(1e3, "ms"),
    ),
)  # fmt: skip
