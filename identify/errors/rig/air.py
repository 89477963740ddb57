"""Air or friction hold the body back.

Looks like: a moment that follows the angular velocity or its square. Matters: it is a quarter of a period away from
inertia, but their products are not. Do: turn more slowly.
"""

import numpy as np

from identify.errors.error_model import CauseWords, ErrorModel, Numbers, Stage
from identify.errors.priors_of_size import part_of_wrench
from identify.errors.rig_state import RigState


def act(state: RigState, factors: Numbers) -> RigState:
    """Return the state with a moment by angular velocity [N·m·s] and its square [N·m·s²], three factors each."""
    omega = state.true.omega
    moment = omega * factors[:3] + np.abs(omega) * omega * factors[3:]
    return state.with_added(np.hstack([np.zeros_like(moment), moment]))


AIR = ErrorModel(
    name="air",
    count=6,
    act=act,
    linear=True,
    stage=Stage.SURROUNDINGS,
    part="rig",
    prior=part_of_wrench(0.02),
    words=CauseWords("air", "air or friction held the body back", "turn more slowly"),
)
