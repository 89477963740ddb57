"""Inertial parameters as simulators and ROS read them: URDF, MJCF, SDF, geometry_msgs/Inertia, JSON.

All take the tensor about the centre of gravity, in axes parallel to the body frame's, with the tensor's own entries off
the diagonal (no integral's sign), in kg, m and kg·m². Only their order differs: MJCF's ``fullinertia`` has the diagonal
first (MuJoCo's XML reference, ``inertial``).
"""

import json
from xml.sax.saxutils import quoteattr

from uq.bodies.exported_body import ExportedBody, number, numbers


def urdf(body: ExportedBody) -> str:
    """Return a robot of one link (URDF, ``inertial``)."""
    entries = " ".join(f'{name}="{number(value)}"' for name, value in body.named.items())
    return _xml(
        body,
        f"<robot name={quoteattr(body.name)}>",
        f"  <link name={quoteattr(body.name)}>",
        "    <inertial>",
        f'      <origin xyz="{numbers(body.r_cg)}" rpy="0 0 0"/>',
        f'      <mass value="{number(body.mass)}"/>',
        f"      <inertia {entries}/>",
        "    </inertial>",
        "  </link>",
        "</robot>",
    )


def mjcf(body: ExportedBody) -> str:
    """Return a model of one free body (MuJoCo's MJCF)."""
    diagonal_first = body.inertia[[0, 3, 5, 1, 2, 4]]
    return _xml(
        body,
        f"<mujoco model={quoteattr(body.name)}>",
        "  <worldbody>",
        f"    <body name={quoteattr(body.name)}>",
        "      <freejoint/>",
        f'      <inertial pos="{numbers(body.r_cg)}" mass="{number(body.mass)}"'
        f' fullinertia="{numbers(diagonal_first)}"/>',
        "    </body>",
        "  </worldbody>",
        "</mujoco>",
    )


def sdf(body: ExportedBody) -> str:
    """Return a model of one link (SDFormat 1.7)."""
    entries = "".join(f"<{name}>{number(value)}</{name}>" for name, value in body.named.items())
    return _xml(
        body,
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
    )


def ros(body: ExportedBody) -> str:
    """Return a geometry_msgs/Inertia as YAML, as ``ros2 topic pub`` takes it; a bare y is a truth value in YAML 1.1."""
    com = ", ".join(f'"{axis}": {number(value)}' for axis, value in zip("xyz", body.r_cg, strict=True))
    entries = [f"{name}: {number(value)}" for name, value in body.named.items()]
    return "\n".join([*commented(body, "# "), f"m: {number(body.mass)}", f"com: {{{com}}}", *entries, ""])


def json_(body: ExportedBody) -> str:
    """Return everything that is known, with covariance and provenance."""
    moments, axes = body.principal()
    content = {
        "name": body.name,
        "mass": {"value": body.mass, "unit": "kg"},
        "cg": {"value": body.r_cg.tolist(), "unit": "m", "from": "origin of the frame"},
        "inertia": {**body.named, "unit": "kg*m^2", "about": "CG"},
        "principal": {"moments": moments.tolist(), "axes": axes.T.tolist()},
        **body.content,
    }
    return json.dumps(content, indent=2, ensure_ascii=False, allow_nan=False) + "\n"


def commented(body: ExportedBody, mark: str) -> list[str]:
    """Return the body's notes as comment lines."""
    return [f"{mark}{note}" for note in body.notes]


def _xml(body: ExportedBody, *lines: str) -> str:
    notes = [f"     {note.replace('--', '- -').rstrip('-')}" for note in body.notes]
    comment = ["<!--", *notes, "-->"] if notes else []
    return "\n".join(['<?xml version="1.0"?>', *comment, *lines, ""])
