"""Gains of the load cell are wrong: those of all channels, or one that channels have in common.

Looks like: a channel in proportion to its component; a common gain is no other mass than stated. Matters: the tensor
errs in proportion. Do: calibrate the load cell, or declare a scale of F and M.
"""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from identify.errors.error_model import CELL_MATRIX, CauseWords, Columns, ErrorModel, Numbers, Stage, TypicalSize
from identify.errors.priors_of_size import full_scale
from identify.errors.rig_state import RigState
from identify.errors.written_sizes import every

PART = 0.0025
"""Typical gain error, common and by axis: makers of six-axis load cells state 0.75 to 1.5 % of full scale at 95 %."""


def act(state: RigState, gains: Numbers) -> RigState:
    """Return the state of a load cell whose channels read so much more, in parts of one."""
    return replace(state, wrench=state.wrench * (1 + gains))


def _on(rows: slice) -> Callable[[RigState, Numbers], RigState]:
    def act_on_three(state: RigState, gains: Numbers) -> RigState:
        every_row = np.zeros(6)
        every_row[rows] = gains
        return act(state, every_row)

    return act_on_three


def _prior(state: RigState, columns: Columns) -> Numbers:
    return np.hypot(PART, PART) * (full_scale(state) > 0)


GAIN = ErrorModel(
    name="gain", count=6, act=act, linear=True, stage=Stage.CELL_GAIN, part="load cell", unknowns=CELL_MATRIX,
    declared_as=("F", "scale"), prior=_prior,
    words=CauseWords(
        "gain", "the load cell's gains were wrong by {}", "calibrate it, or declare a scale", every(100.0, "%")
    ),
)  # fmt: skip
FORCE_GAIN, FORCE_GAIN_BY_AXIS, MOMENT_GAIN, MOMENT_GAIN_BY_AXIS = (
    ErrorModel(
        name=name, count=count, act=_on(rows), linear=True, stage=Stage.CELL_GAIN,
        part="load cell", unknowns=CELL_MATRIX, declared_as=(target, "scale"),
        typical=TypicalSize(figure=PART, key_unit="%", text=text, unit="%", per_si=100.0, about=about),
    )
    for name, count, rows, target, text, about in (
        ("force_gain", 1, slice(0, 3), "F", "common gain of the force",
         "Gain error common to the three channels of the force."),
        ("force_gain_by_axis", 3, slice(0, 3), "F", "gain of each force",
         "Gain error of each channel of the force beside the common one."),
        ("moment_gain", 1, slice(3, 6), "M", "common gain of the moment",
         "Gain error common to the three channels of the moment."),
        ("moment_gain_by_axis", 3, slice(3, 6), "M", "gain of each moment",
         "Gain error of each channel of the moment beside the common one."),
    )
)  # fmt: skip
