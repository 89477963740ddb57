"""The body has another mass than stated.

Looks like: the force is in proportion to the motion, but too large or too small; gains of the load cell, a part beside
the body, gravity or air do the same. Matters: the moment of the weight about Q is taken for inertia by as much. Do:
weigh the body, with all that turns with it.
"""

import numpy as np

from identify.errors.error_model import CauseWords, Columns, ErrorModel, Numbers, Stage, TypicalSize
from identify.errors.rig_state import RigState
from identify.errors.written_sizes import every

# a shop scale
TYPICAL = TypicalSize(
    figure=0.001, key_unit="%", text="error of the mass", unit="%", per_si=100.0,
    about="Error of the mass, where it counts as exact.",
)  # fmt: skip


def act(state: RigState, kilograms: Numbers) -> RigState:
    """Return the state of a body that has so much more mass than is believed."""
    return state.with_less("mass", kilograms)


def _prior(state: RigState, columns: Columns) -> Numbers:
    return np.array([TYPICAL.figure * abs(state.true.mass)])


MASS = ErrorModel(
    name="mass", count=1, act=act, linear=True, stage=Stage.BODY,
    part="body", unknowns=("mass",), by_hand=True, typical=TYPICAL, prior=_prior,
    words=CauseWords("mass", "the mass were off by {}", "weigh the body", every(-1.0, "kg")),
)  # fmt: skip
