"""Force and moment come late, each by its own time: the load cell's filter.

Looks like: a delay of the IMU the other way. Matters: inertia and friction mix. Do: give both sensors the same filter,
or declare the delay.
"""

from dataclasses import replace

import numpy as np

from identify.errors.error_model import CauseWords, ErrorModel, Numbers, Stage
from identify.errors.priors_of_size import part_of_wrench
from identify.errors.rig_state import RigState
from identify.errors.written_sizes import every


def act(state: RigState, seconds: Numbers) -> RigState:
    """Return the state of a load cell whose force and moment come so late, one time each."""
    wrench = state.wrench.copy()
    for rows, time in zip((slice(0, 3), slice(3, 6)), seconds, strict=True):
        if time:
            wrench[:, rows] = state.delayed("wrench", time)[:, rows]
    return replace(state, wrench=wrench)


def _lateness(values: np.ndarray, spread: np.ndarray) -> str:
    if (values < 0).all():
        return f"the IMU lagged force and moment by {every(-1e3, 'ms')(values, spread)}"
    return f"force and moment lagged by {every(1e3, 'ms')(values, spread)}"


FILTER = ErrorModel(
    name="filter", count=2, act=act, stage=Stage.CELL_FILTER, part="load cell", prior=part_of_wrench(0.02),
    words=CauseWords(
        "filter", "{}", "give both sensors the same filter, or declare the delay, or let method joint estimate it",
        _lateness,
    ),
)  # fmt: skip
