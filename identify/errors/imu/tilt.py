"""The attitude at the start is not what is believed.

Looks like: weight turned throughout. Matters: the weight's moment is taken for inertia. Do: level the base, or let the
joint estimate have it.
"""

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from identify.errors.error_model import ErrorModel, Numbers, Stage
from identify.errors.rig_state import RigState
from identify.rigid_body.rotation import exponential


def tilt_axes(up: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3 2"]:
    """Return two axes at right angles to a vertical: x and y where it is vertical."""
    first = np.cross([0.0, 1.0, 0.0] if abs(up[1]) < 0.9 else [0.0, 0.0, 1.0], up)
    first = first / np.linalg.norm(first)
    return np.stack([first, np.cross(up, first)], axis=1)


def act(state: RigState, tilt: Numbers) -> RigState:
    """Return the state where the believed vertical lacks a tilt about :func:`tilt_axes` [rad]."""
    return replace(state, vertical=exponential(-tilt_axes(state.vertical) @ tilt) @ state.vertical)


TILT = ErrorModel(
    name="tilt", count=2, act=act, stage=Stage.START, part="imu", scope="run", unknowns=("tilt",), by_hand=True
)
