"""SDFormat 1.7 (Gazebo): a model of one link, its tensor about the centre of gravity."""

from xml.sax.saxutils import quoteattr

from uq.bodies.export_formats import ExportFormat
from uq.bodies.exported_body import ExportedBody, number, numbers, xml_document


def sdf(body: ExportedBody) -> str:
    """Return a model of one link."""
    entries = "".join(f"<{name}>{number(value)}</{name}>" for name, value in body.named.items())
    lines = [
        '<sdf version="1.7">',
        f"  <model name={quoteattr(body.name)}>",
        f"    <link name={quoteattr(body.name)}>",
        "      <inertial>",
        f"        <pose>{numbers(body.r_cg)} 0 0 0</pose>",
        f"        <mass>{number(body.mass)}</mass>",
        f"        <inertia>{entries}</inertia>",
        "      </inertial>",
        "    </link>",
        "  </model>",
        "</sdf>",
    ]
    return xml_document(body, lines)


FORMAT = ExportFormat("body.sdf", "SDFormat, a model of one link", sdf)
