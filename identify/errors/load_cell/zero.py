"""The load cell reads force and moment where there are none.

Looks like: a constant. Matters: not, where offsets are estimated. Do: let the estimator have them (``offsets``).
"""

import numpy as np
from jaxtyping import Float

from identify.errors.error_model import ErrorModel, Numbers, Stage
from identify.errors.rig_state import RigState


def along_zero_axes(state: RigState, zero: Float[np.ndarray, "n 6"]) -> Float[np.ndarray, "n 6"]:
    """Return a zero of force and moment in B, from the axes along which it is constant."""
    axes = state.true.zero_axes
    return zero if axes is None else np.einsum("nji,nkj->nki", axes, zero.reshape(-1, 2, 3)).reshape(-1, 6)


def act(state: RigState, zero: Numbers) -> RigState:
    """Return the state of a load cell that adds a constant force and moment [N], [N·m]."""
    return state.with_added(along_zero_axes(state, np.broadcast_to(zero, state.wrench.shape)))


ZERO = ErrorModel(
    name="zero", count=6, act=act, linear=True,
    stage=Stage.CELL_ZERO, part="load cell", scope="run", needs=frozenset({"zero"}),
    unknowns=("force_offset", "moment_offset"), by_hand=True,
)  # fmt: skip
