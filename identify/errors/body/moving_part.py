"""Something in the body moves, so that its tensor changes during a run.

Looks like: inertia that grows or falls from the start to the end. Matters: there is no one tensor. Do: fix what moves.
"""

from identify.errors.error_model import CauseWords, ErrorModel, Numbers, Stage
from identify.errors.priors_of_size import part_of_wrench
from identify.errors.rig_state import RigState


def act(state: RigState, packed: Numbers) -> RigState:
    """Return the state of a body whose tensor changes linearly by so much from start to end, half of it before."""
    return state.with_less("inertia", state.true.progress[:, None] * packed)


MOVING_PART = ErrorModel(
    name="moving_part",
    count=6,
    act=act,
    linear=True,
    stage=Stage.BODY,
    part="body",
    scope="run",
    prior=part_of_wrench(0.01),
    words=CauseWords("tensor", "the tensor changed during the run: something moves", "fix what moves"),
)
