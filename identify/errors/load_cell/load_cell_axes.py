"""The load cell's axes are turned against the body's.

Looks like: force and moment turned alike, as an IMU that is turned the other way. Matters: products of inertia err by
the turn times the difference of the moments. Do: correct ``wrench_rotation_to_body``, or use dowels.
"""

from dataclasses import replace

from identify.errors.error_model import CELL_MATRIX, ErrorModel, Numbers, Stage, TypicalSize
from identify.errors.rig_state import RigState
from identify.rigid_body.rotation import exponential

# bolts without dowels
TYPICAL = TypicalSize(
    figure=0.005, key_unit="rad", text="misalignment of the load cell", unit="mrad", per_si=1e3,
    about="Misalignment of the load cell with the body, about each axis.",
)  # fmt: skip


def act(state: RigState, turn: Numbers) -> RigState:
    """Return the state of a load cell that is turned from the body's axes by a rotation vector in B [rad]."""
    rows = state.wrench.reshape(-1, 2, 3) @ exponential(turn)
    return replace(state, wrench=rows.reshape(-1, 6))


LOAD_CELL_AXES = ErrorModel(
    name="load_cell_axes", count=3, act=act, stage=Stage.CELL_AXES, part="load cell", unknowns=CELL_MATRIX,
    declared_as=("wrench", "misalignment"), typical=TYPICAL,
)  # fmt: skip
