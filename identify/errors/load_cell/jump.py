"""The load cell's zeros jump during a run.

Looks like: another offset from one instant on. Matters: as a drift. Do: record again.
"""

from identify.errors.error_model import CauseWords, ErrorModel, Numbers, Stage
from identify.errors.priors_of_size import part_of_wrench
from identify.errors.rig_state import RigState
from identify.errors.sudden import STEPS, after_steps


def act(state: RigState, jumps: Numbers) -> RigState:
    """Return the state of a load cell whose zeros jump at each of three instants [N], [N·m]."""
    return state.with_added(after_steps(state.true) @ jumps.reshape(len(STEPS), 6))


JUMP = ErrorModel(
    name="jump", count=6 * len(STEPS), act=act, linear=True, stage=Stage.CELL_ZERO,
    part="load cell", scope="run", needs=frozenset({"zero"}),
    prior=part_of_wrench(0.02), words=CauseWords("jump", "the load cell's zeros jumped", "record again"),
)  # fmt: skip
