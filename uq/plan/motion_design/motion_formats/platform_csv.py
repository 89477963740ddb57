"""A platform's poses and leg lengths as a CSV table in SI, ten decimals."""

from collections.abc import Iterator
from typing import Any

import numpy as np
import scipy

from identify.motion.euler_angles import attitude_of, roll_pitch_yaw
from uq.plan.motion_design.commanded import PlatformCommand
from uq.plan.motion_design.motion_formats import MotionFormat

COLUMNS = (
    "t_s", "x_m", "y_m", "z_m", "roll_rad", "pitch_rad", "yaw_rad", "q_w", "q_x", "q_y", "q_z",
    *(f"leg{k}_m" for k in range(1, 7)),
)  # fmt: skip
RATE = 100


def write(motion: PlatformCommand) -> bytes:
    """Return the table with the columns ``COLUMNS``."""
    turn = scipy.spatial.transform.Rotation.from_matrix(motion.rotation)
    quaternion = np.roll(turn.as_quat(canonical=True), 1, axis=1)
    rows = np.hstack([motion.t[:, None], motion.position, roll_pitch_yaw(motion.rotation), quaternion, motion.length])
    lines = [",".join(f"{value:.10f}" for value in row) for row in (np.round(rows, 10) + 0.0).tolist()]  # no -0
    return "\n".join([",".join(COLUMNS), *lines, ""]).encode()


def read(content: bytes) -> tuple[np.ndarray, ...]:
    """Return instants, positions, attitudes by the angles, attitudes by the quaternions, and leg lengths.

    Raises:
        ValueError: it is no such table.
    """
    head, *lines = content.decode().split()
    if tuple(head.split(",")) != COLUMNS:
        raise ValueError("other columns")
    rows = np.array([[float(cell) for cell in line.split(",")] for line in lines])
    by_quaternion = scipy.spatial.transform.Rotation.from_quat(np.roll(rows[:, 7:11], -1, axis=1)).as_matrix()
    return rows[:, 0], rows[:, 1:4], attitude_of(rows[:, 4:7]), by_quaternion, rows[:, 11:]


def compared(content: bytes, motion: PlatformCommand) -> Iterator[tuple[Any, Any]]:
    """Yield what a table says beside the command; its poses give the leg lengths, too, by the inverse kinematics."""
    t, position, by_angles, by_quaternion, length = read(content)
    yield from ((t, motion.t), (position, motion.position), (length, motion.length))
    yield from ((by_angles, motion.rotation), (by_quaternion, motion.rotation))
    yield motion.legs(position, by_quaternion), motion.length


FORMAT = MotionFormat(
    ending="csv", description=f"poses and leg lengths, {RATE} Hz", command=PlatformCommand, write=write,
    compared=compared, rate=RATE, meaning={"columns": list(COLUMNS)},
)  # fmt: skip
