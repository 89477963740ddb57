"""Inertial parameters as robot controllers take a load's: KUKA, ABB, Universal Robots, Franka.

The body frame must be the frame that the controller means (flange, wrist or tool), with its origin there. Principal
moments come with right-handed axes. From the makers' public manuals:

KUKA: centre X, Y, Z [mm] and principal axes A, B, C [deg] from the flange, turned about Z, the new Y, the new X;
principal moments [kg·m²] (KR IONTEC assembly instructions, "Load center of gravity and mass moment of inertia").
ABB: ``loaddata``, centre [mm], axes of moment as a quaternion, scalar first, moments about them [kg·m²] (Technical
reference manual, RAPID instructions, functions and data types).
Universal Robots: ``set_target_payload``, centre [m], tensor about it as Ixx, Iyy, Izz, Ixy, Ixz, Iyz [kg·m²], axes as
the tool flange's (Script manual).
Franka: ``setLoad``, centre from the flange [m], tensor about it, column by column [kg·m²] (libfranka, ``Robot``,
``RobotState::I_load``; franka_msgs/SetLoad).
"""

import numpy as np
import scipy

from uq.bodies.exported_body import ExportedBody, number, numbers
from uq.bodies.simulator_models import commented

MILLIMETRE = 1e3
"""mm in a metre."""


def kuka(body: ExportedBody) -> str:
    """Return KRL load data of tool 1."""
    moments, axes = body.principal()
    centre = dict(zip("XYZABC", [*(MILLIMETRE * body.r_cg), *np.degrees(turns_zyx(axes))], strict=True))
    frame, inertia = (", ".join(f"{k} {number(v)}" for k, v in part.items()) for part in (centre, _xyz(moments)))
    load = f"LOAD_DATA[1]={{M {number(body.mass)}, CM {{{frame}}}, J {{{inertia}}}}}"
    return "\n".join([*commented(body, "; "), load, ""])


def abb(body: ExportedBody) -> str:
    """Return a RAPID module with load data."""
    moments, axes = body.principal()
    quaternion = scipy.spatial.transform.Rotation.from_matrix(axes).as_quat(scalar_first=True, canonical=True)
    parts = [f"[{numbers(part, ',')}]" for part in (MILLIMETRE * body.r_cg, quaternion)]
    load = f"[{number(body.mass)},{','.join(parts)},{numbers(moments, ',')}]"
    name = f"{body.name}_load"
    lines = [*commented(body, "  ! "), f"  PERS loaddata {name}:={load};"]
    return "\n".join([f"MODULE {name}_data", *lines, "ENDMODULE", ""])


def ur(body: ExportedBody) -> str:
    """Return a URScript call."""
    diagonal_first = body.inertia[[0, 3, 5, 1, 2, 4]]
    arguments = f"{number(body.mass)}, [{numbers(body.r_cg, ', ')}], [{numbers(diagonal_first, ', ')}]"
    return "\n".join([*commented(body, "# "), f"set_target_payload({arguments})", ""])


def franka(body: ExportedBody) -> str:
    """Return the request of franka_msgs/SetLoad as YAML; ``Robot::setLoad`` takes the same three in this order."""
    entries = body.named
    columns = [entries["i" + "".join(sorted(row + column))] for column in "xyz" for row in "xyz"]
    centre, inertia = (numbers(part, ", ") for part in (body.r_cg, np.array(columns)))
    lines = [f"mass: {number(body.mass)}", f"center_of_mass: [{centre}]", f"load_inertia: [{inertia}]"]
    return "\n".join([*commented(body, "# "), *lines, ""])


def turns_zyx(rotation: np.ndarray) -> np.ndarray:
    """Return A, B, C [rad] with ``rotation = Rz(A) Ry(B) Rx(C)``; where B is ±90° and only A ∓ C is told, C is zero."""
    across = float(np.hypot(rotation[0, 0], rotation[1, 0]))
    b = np.arctan2(-rotation[2, 0], across)
    if across < 1e-9:
        return np.array([np.arctan2(-rotation[0, 1], rotation[1, 1]), b, 0.0])
    return np.array([np.arctan2(rotation[1, 0], rotation[0, 0]), b, np.arctan2(rotation[2, 1], rotation[2, 2])])


def _xyz(values: np.ndarray) -> dict[str, float]:
    return dict(zip("XYZ", map(float, values), strict=True))
