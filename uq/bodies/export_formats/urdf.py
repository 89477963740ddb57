"""URDF (ROS): a robot of one link; its tensor is about the centre of gravity, in axes parallel to the body frame's."""

from xml.sax.saxutils import quoteattr

from uq.bodies.export_formats import ExportFormat
from uq.bodies.exported_body import ExportedBody, number, numbers, xml_document


def urdf(body: ExportedBody) -> str:
    """Return a robot of one link."""
    entries = " ".join(f'{name}="{number(value)}"' for name, value in body.named.items())
    lines = [
        f"<robot name={quoteattr(body.name)}>",
        '  <mujoco><compiler fusestatic="false"/></mujoco>',  # else MuJoCo merges the link with the world
        f"  <link name={quoteattr(body.name)}>",
        "    <inertial>",
        f'      <origin xyz="{numbers(body.r_cg)}" rpy="0 0 0"/>',
        f'      <mass value="{number(body.mass)}"/>',
        f"      <inertia {entries}/>",
        "    </inertial>",
        "  </link>",
        "</robot>",
    ]
    return xml_document(body, lines)


FORMAT = ExportFormat("body.urdf", "URDF, a robot of one link", urdf)
