"""Components of the load cell leak into each other.

Looks like: a channel that follows another component. Matters: a moment that follows a large force errs by much. Do: use
the calibration matrix, or declare the ``cross_talk``.
"""

from dataclasses import replace

import numpy as np

from identify.errors.error_model import CELL_MATRIX, CauseWords, Columns, ErrorModel, Numbers, Stage, TypicalSize
from identify.errors.priors_of_size import full_scale
from identify.errors.rig_state import RigState

# of the largest force and moment
TYPICAL = TypicalSize(
    figure=0.0015, key_unit="%", text="cross-talk of the load cell", unit="%", per_si=100.0,
    about="Cross-talk to each channel from every other component, in parts of the largest recorded force and moment.",
)  # fmt: skip


def act(state: RigState, elements: Numbers) -> RigState:
    """Return the state of a load cell whose channels (rows) add such parts of each component (columns), row by row."""
    return replace(state, wrench=state.wrench @ (np.eye(6) + elements.reshape(6, 6)).T)


def _prior(state: RigState, columns: Columns) -> Numbers:
    size = full_scale(state)
    over = np.divide(1.0, size, out=np.zeros(6), where=size > 0)
    return np.ravel(TYPICAL.figure * np.outer(size, over) * (1 - np.eye(6)))  # the diagonal is the gains'


CROSS_TALK = ErrorModel(
    name="cross_talk", count=36, act=act, linear=True, stage=Stage.CELL_CROSS_TALK,
    part="load cell", unknowns=CELL_MATRIX, declared_as=("wrench", "cross_talk"),
    typical=TYPICAL, prior=_prior,
    words=CauseWords(
        "cross-talk", "components of the load cell leaked into each other",
        "use its calibration matrix, or declare the cross_talk",
    ),
)  # fmt: skip
