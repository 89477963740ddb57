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
    signals = {name: getattr(state, name).copy() for name in ("gyro", "gyro_slope")}
    for name, signal in signals.items():
        for axis in np.flatnonzero(seconds):
            signal[:, axis] = state.delayed(name, seconds[axis])[:, axis]
    return replace(state, **signals)


GYRO_LATE = ErrorModel(
    name="gyro_late", count=3, act=act, stage=Stage.SENSOR_FILTER, part="gyro", prior=fixed(*[0.003] * 3),
    words=CauseWords(
        "delay", "the gyro's axes lagged by {}", "give its axes the same filter, or declare the delay",
        every(1e3, "ms"),
    ),
)  # fmt: skip
