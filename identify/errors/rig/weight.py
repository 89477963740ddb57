"""The weight alone is off, not the inertia of the mass.

Looks like: a force along the vertical, where an accelerometer tells inertia from weight. Matters: the weight's moment
about Q is taken for inertia. Do: look for air or a cable that lifts it, or check the accelerometer's scale.
"""

import numpy as np

from identify.errors.error_model import CauseWords, Columns, ErrorModel, Numbers, Stage
from identify.errors.rig_state import RigState
from identify.errors.written_sizes import every

PART = 0.01
"""Typical size, in parts of the weight."""


def act(state: RigState, newtons: Numbers) -> RigState:
    """Return the state with so much more force along the vertical at the centre of gravity."""
    force = newtons * state.true.up
    return state.with_added(np.hstack([force, np.cross(state.true.r_cg, force)]))


def _prior(state: RigState, columns: Columns) -> Numbers:
    return PART * np.abs(state.true.mass) * np.abs(state.beliefs.gravity[0])


WEIGHT = ErrorModel(
    name="weight", count=1, act=act, linear=True, stage=Stage.SURROUNDINGS,
    part="rig", needs=frozenset({"accelerometer"}), prior=_prior,
    words=CauseWords(
        "weight", "the weight alone, not the inertia, were off by {}",
        "air or a cable that lifts it, or the accelerometer's scale? methods source and gls take the force as it is",
        every(-1.0, "N"),
    ),
)  # fmt: skip
