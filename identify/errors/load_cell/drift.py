"""The load cell's zeros drift along a straight line.

Looks like: force and moment that grow with time. Matters: a slow motion is mixed with it. Do: let it warm up, or
declare a drift.
"""

import numpy as np

from identify.errors.error_model import CauseWords, ErrorModel, Numbers, Stage
from identify.errors.load_cell.zero import along_zero_axes
from identify.errors.priors_of_size import fixed
from identify.errors.rig_state import RigState

SIZES = np.repeat([2.0, 0.05], 3)
"""Typical changes over a run: force [N], moment [N·m]."""


def act(state: RigState, change: Numbers) -> RigState:
    """Return the state of a load cell whose zeros change by so much from start to end, half of it before."""
    return state.with_added(along_zero_axes(state, np.outer(state.true.progress, change)))


DRIFT = ErrorModel(
    name="drift", count=6, act=act, linear=True,
    stage=Stage.CELL_ZERO, part="load cell", scope="run", needs=frozenset({"zero"}),
    unknowns=("force_drift", "moment_drift"), by_hand=True, declared_as=("F", "drift"), prior=fixed(*SIZES),
    words=CauseWords("drift", "the load cell's zeros drifted", "let it warm up, or declare a drift"),
)  # fmt: skip
