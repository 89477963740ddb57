"""ABB: ``loaddata`` in RAPID.

Centre [mm], axes of moment as a quaternion, scalar first, moments about them [kg·m²] (Technical reference manual, RAPID
instructions, functions and data types). The body frame must be the controller's, with its origin there.
"""

import scipy

from uq.bodies.export_formats import ExportFormat
from uq.bodies.exported_body import MILLIMETRE, ExportedBody, commented, number, numbers


def abb(body: ExportedBody) -> str:
    """Return a RAPID module with load data."""
    moments, axes = body.principal()
    quaternion = scipy.spatial.transform.Rotation.from_matrix(axes).as_quat(scalar_first=True, canonical=True)
    parts = [f"[{numbers(part, ',')}]" for part in (MILLIMETRE * body.r_cg, quaternion)]
    load = f"[{number(body.mass)},{','.join(parts)},{numbers(moments, ',')}]"
    name = f"{body.name}_load"
    lines = [*commented(body, "  ! "), f"  PERS loaddata {name}:={load};"]
    return "\n".join([f"MODULE {name}_data", *lines, "ENDMODULE", ""])


FORMAT = ExportFormat("body.abb.mod", "ABB loaddata (RAPID)", abb)
