"""Gains of the load cell, right at the start, change over a run.

Looks like: gains that grow with time. Matters: as half a gain. Do: let it warm up.
"""

from dataclasses import replace

import numpy as np

from identify.errors.error_model import CauseWords, ErrorModel, Numbers, Stage
from identify.errors.priors_of_size import part_of_wrench
from identify.errors.rig_state import RigState
from identify.errors.written_sizes import every


def act(state: RigState, gains: Numbers) -> RigState:
    """Return the state of a load cell whose channels read so much more at the end, in parts of one."""
    return replace(state, wrench=state.wrench * (1 + np.outer(state.true.progress + 0.5, gains)))


GAIN_DRIFT = ErrorModel(
    name="gain_drift", count=6, act=act, linear=True, stage=Stage.CELL_GAIN,
    part="load cell", scope="run", prior=part_of_wrench(0.005),
    words=CauseWords(
        "gain drift", "the load cell's gains changed by {} over the run", "let it warm up", every(100.0, "%")
    ),
)  # fmt: skip
