"""A MATLAB script: mass, centre of gravity and tensor as matrices."""

from uq.bodies.export_formats import ExportFormat
from uq.bodies.exported_body import ExportedBody, commented, number, numbers


def matlab(body: ExportedBody) -> str:
    """Return the script."""
    xx, xy, xz, yy, yz, zz = map(number, body.inertia)
    lines = [
        f"mass = {number(body.mass)}; % kg",
        f"r_cg = [{numbers(body.r_cg)}]; % m",
        f"inertia = [{xx} {xy} {xz}; {xy} {yy} {yz}; {xz} {yz} {zz}]; % kg*m^2, about the centre of gravity",
    ]
    return "\n".join([*commented(body, "% "), *lines, ""])


FORMAT = ExportFormat("body.m", "MATLAB script", matlab)
