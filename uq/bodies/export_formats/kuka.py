"""KUKA: load data in KRL.

Centre X, Y, Z [mm] and principal axes A, B, C [deg] from the flange, turned about Z, the new Y, the new X; principal
moments [kg·m²] (KR IONTEC assembly instructions, "Load center of gravity and mass moment of inertia"). The body frame
must be the controller's, with its origin there.
"""

import numpy as np

from uq.bodies.export_formats import ExportFormat
from uq.bodies.exported_body import MILLIMETRE, ExportedBody, commented, number


def kuka(body: ExportedBody) -> str:
    """Return KRL load data of tool 1."""
    moments, axes = body.principal()
    centre = dict(zip("XYZABC", [*(MILLIMETRE * body.r_cg), *np.degrees(turns_zyx(axes))], strict=True))
    about = dict(zip("XYZ", map(float, moments), strict=True))
    frame, inertia = (", ".join(f"{k} {number(v)}" for k, v in part.items()) for part in (centre, about))
    load = f"LOAD_DATA[1]={{M {number(body.mass)}, CM {{{frame}}}, J {{{inertia}}}}}"
    return "\n".join([*commented(body, "; "), load, ""])


def turns_zyx(rotation: np.ndarray) -> np.ndarray:
    """Return A, B, C [rad] with ``rotation = Rz(A) Ry(B) Rx(C)``; where B is ±90° and only A ∓ C is told, C is zero."""
    across = float(np.hypot(rotation[0, 0], rotation[1, 0]))
    b = np.arctan2(-rotation[2, 0], across)
    if across < 1e-9:
        return np.array([np.arctan2(-rotation[0, 1], rotation[1, 1]), b, 0.0])
    return np.array([np.arctan2(rotation[1, 0], rotation[0, 0]), b, np.arctan2(rotation[2, 1], rotation[2, 2])])


FORMAT = ExportFormat("body.kuka.dat", "KUKA load data (KRL)", kuka)
