"""Franka: a load for franka_msgs/SetLoad, as YAML.

Centre from the flange [m], tensor about it, column by column [kg·m²] (libfranka, ``Robot``, ``RobotState::I_load``).
"""

import numpy as np

from uq.bodies.export_formats import ExportFormat
from uq.bodies.exported_body import ExportedBody, commented, number, numbers


def franka(body: ExportedBody) -> str:
    """Return the request; ``Robot::setLoad`` takes the same three in this order."""
    entries = body.named
    columns = [entries["i" + "".join(sorted(row + column))] for column in "xyz" for row in "xyz"]
    centre, inertia = (numbers(part, ", ") for part in (body.r_cg, np.array(columns)))
    lines = [f"mass: {number(body.mass)}", f"center_of_mass: [{centre}]", f"load_inertia: [{inertia}]"]
    return "\n".join([*commented(body, "# "), *lines, ""])


FORMAT = ExportFormat("body.franka.yaml", "Franka load (franka_msgs/SetLoad)", franka)
