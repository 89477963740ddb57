"""The load cell's zeros drift as it warms up, faster at the start.

Looks like: exponentials of time. Matters: as a drift. Do: let it warm up, declare a drift, or leave out the start.
"""

import numpy as np

from identify.errors.error_model import CauseWords, ErrorModel, Numbers, Stage
from identify.errors.load_cell.drift import SIZES
from identify.errors.load_cell.zero import along_zero_axes
from identify.errors.priors_of_size import fixed
from identify.errors.rig_state import RigState
from identify.signals.drift_shapes import TIMES, drift_shapes

COUNT = 1 + len(TIMES)


def act(state: RigState, changes: Numbers) -> RigState:
    """Return the state of a load cell whose zeros drift by so much of each shape [N], [N·m], shape by shape."""
    return state.with_added(along_zero_axes(state, drift_shapes(state.true.t) @ changes.reshape(COUNT, 6)))


WARMING = ErrorModel(
    name="warming", count=6 * COUNT, act=act, linear=True, stage=Stage.CELL_ZERO,
    part="load cell", scope="run", needs=frozenset({"zero"}),
    prior=fixed(*np.tile(SIZES, COUNT)),
    words=CauseWords(
        "drift", "the load cell's zeros drifted as it warmed up",
        "let it warm up, declare a drift, or leave out the start of the run by --from",
    ),
)  # fmt: skip
