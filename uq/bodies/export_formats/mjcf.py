"""MJCF (MuJoCo): a free body; ``fullinertia`` has the diagonal first (MuJoCo's XML reference, ``inertial``)."""

from xml.sax.saxutils import quoteattr

from uq.bodies.export_formats import ExportFormat
from uq.bodies.exported_body import ExportedBody, number, numbers, xml_document


def mjcf(body: ExportedBody) -> str:
    """Return a model of one free body."""
    diagonal_first = body.inertia[[0, 3, 5, 1, 2, 4]]
    lines = [
        f"<mujoco model={quoteattr(body.name)}>",
        "  <worldbody>",
        f"    <body name={quoteattr(body.name)}>",
        "      <freejoint/>",
        f'      <inertial pos="{numbers(body.r_cg)}" mass="{number(body.mass)}"'
        f' fullinertia="{numbers(diagonal_first)}"/>',
        "    </body>",
        "  </worldbody>",
        "</mujoco>",
    ]
    return xml_document(body, lines)


FORMAT = ExportFormat("body.xml", "MuJoCo's MJCF, a free body", mjcf)
