"""Universal Robots: a program of ``servoj`` rows in URScript, for six joints that turn."""

import re
from collections.abc import Iterable
from typing import Any

import numpy as np

from uq.plan.motion_design.commanded import JointCommand
from uq.plan.motion_design.motion_formats import MotionFormat

JOINTS = 6


def write(motion: JointCommand) -> bytes:
    """Return the program; it ends at once unless the arm is at home already, within 0.01 rad."""
    rows = [", ".join(f"{x:.10f}" for x in row) for row in motion.joints.position.tolist()]
    step = float(motion.t[1] - motion.t[0])
    lines = [
        "def inertia_motion():",
        f"  home = [{rows[0]}]",
        "  q = get_actual_joint_positions()",
        "  k = 0",
        f"  while k < {JOINTS}:",
        "    if norm(q[k] - home[k]) > 0.01:",
        '      popup("Move the arm to the motion\'s home first.", title="inertia", error=True, blocking=True)',
        "      halt",
        "    end",
        "    k = k + 1",
        "  end",
        *(f"  servoj([{row}], t={step:.10g}, lookahead_time=0.03, gain=300)" for row in rows),
        "  stopj(2.0)",
        "end",
        "inertia_motion()",
        "",
    ]
    return "\n".join(lines).encode()


def compared(content: bytes, motion: JointCommand) -> Iterable[tuple[Any, Any]]:
    """Return time step and positions of a program's ``servoj`` rows beside the command."""
    rows = re.findall(r"servoj\(\[([^\]]*)\], t=([\d.e-]+)", content.decode())
    position = np.array([[float(x) for x in row.split(",")] for row, _ in rows])
    return (float(rows[0][1]), motion.t[1] - motion.t[0]), (position, motion.joints.position)


FORMAT = MotionFormat(
    ending="script", description="URScript", command=JointCommand, write=write, compared=compared,
    suits=lambda motion: len(motion.names) == JOINTS and motion.turning,
)  # fmt: skip
