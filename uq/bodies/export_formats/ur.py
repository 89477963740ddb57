"""Universal Robots: a payload in URScript.

``set_target_payload``: centre [m], tensor about it as Ixx, Iyy, Izz, Ixy, Ixz, Iyz [kg·m²], axes as the tool flange's
(Script manual).
"""

from uq.bodies.export_formats import ExportFormat
from uq.bodies.exported_body import ExportedBody, commented, number, numbers


def ur(body: ExportedBody) -> str:
    """Return a URScript call."""
    diagonal_first = body.inertia[[0, 3, 5, 1, 2, 4]]
    arguments = f"{number(body.mass)}, [{numbers(body.r_cg, ', ')}], [{numbers(diagonal_first, ', ')}]"
    return "\n".join([*commented(body, "# "), f"set_target_payload({arguments})", ""])


FORMAT = ExportFormat("body.ur.script", "Universal Robots payload (URScript)", ur)
