"""An arm's joints as a CSV table: instants, then position, speed and acceleration of every joint in SI."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from uq.plan.motion_design.commanded import JointCommand
from uq.plan.motion_design.motion_formats import MotionFormat

SUFFIXES = ("q", "qd", "qdd")
"""Suffixes of a joint's columns: position, speed and acceleration."""


def write(motion: JointCommand) -> bytes:
    """Return the table, ten decimals."""
    head = ["t_s", *(f"{name}.{end}" for end in SUFFIXES for name in motion.names)]
    rows = np.hstack([motion.t[:, None], *motion.joints])
    return "\n".join([",".join(head), *(",".join(f"{x:.10f}" for x in row) for row in rows.tolist()), ""]).encode()


def compared(content: bytes, motion: JointCommand) -> Iterable[tuple[Any, Any]]:
    """Return instants and joints of a table beside the command."""
    rows = np.loadtxt(content.decode().splitlines(), delimiter=",", skiprows=1, ndmin=2)
    return zip((rows[:, 0], *np.split(rows[:, 1:], 3, axis=1)), (motion.t, *motion.joints), strict=True)


FORMAT = MotionFormat(
    ending="csv", description="joints", command=JointCommand, write=write, compared=compared
)  # fmt: skip
