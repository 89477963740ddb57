"""geometry_msgs/Inertia as YAML, as ``ros2 topic pub`` takes it; a bare y is a truth value in YAML 1.1."""

from uq.bodies.export_formats import ExportFormat
from uq.bodies.exported_body import ExportedBody, commented, number


def ros(body: ExportedBody) -> str:
    """Return the message."""
    com = ", ".join(f'"{axis}": {number(value)}' for axis, value in zip("xyz", body.r_cg, strict=True))
    entries = [f"{name}: {number(value)}" for name, value in body.named.items()]
    return "\n".join([*commented(body, "# "), f"m: {number(body.mass)}", f"com: {{{com}}}", *entries, ""])


FORMAT = ExportFormat("body.yaml", "geometry_msgs/Inertia as YAML", ros)
