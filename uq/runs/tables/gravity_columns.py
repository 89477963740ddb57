"""Columns of the vector of gravity, which an IMU's driver took out of its acceleration: put back, up or down."""

from typing import Literal

import numpy as np

from identify.rigid_body.gravity import STANDARD_GRAVITY
from identify.signals.run import RunError

CERTAIN = 0.5
"""Agreement of the force's two parts, from -1 to 1, from which it tells where the vectors point.

Choice: 1 without noise; 0 where force or acceleration are noise.
"""
LENGTHS = 0.05
"""Departure of a vector's usual length from that of gravity, or from 1, up to which it is taken for it."""


def pointing(force: np.ndarray, linear: np.ndarray, gravity: np.ndarray) -> Literal["up", "down"] | None:
    """Return where vectors of gravity point by the force, F = m R (a - g): its parts by a and by g have one matrix.

    Neither the force's unit, sign and zero count, nor the axes of either sensor; None: the force does not tell.

    Args:
        force: along the load cell's axes, (n, 3).
        linear: acceleration without gravity, along the IMU's axes, (n, 3).
        gravity: the vectors, of any length, (n, 3).
    """
    columns = np.hstack([linear, gravity, np.ones((len(linear), 1))])
    by_motion, by_weight = np.linalg.lstsq(columns, force, rcond=None)[0][:6].reshape(2, 3, 3)
    size = float(np.linalg.norm(by_motion) * np.linalg.norm(by_weight))
    agreement = float((by_motion * by_weight).sum()) / size if size else 0.0
    return None if abs(agreement) < CERTAIN else "up" if agreement > 0 else "down"


def put_back(linear: np.ndarray, gravity: np.ndarray, scale: float, points: str, name: str) -> tuple[np.ndarray, str]:
    """Return the accelerometer's readings, in the unit of ``linear``, (n, 3), and what was assumed of gravity's size.

    Args:
        linear: acceleration without gravity, (n, 3).
        gravity: what was taken out, (n, 3): in the same unit, or of length 1.
        scale: this unit [m/s²].
        points: where its vectors point, "up" or "down".
        name: what messages call the table.

    Raises:
        RunError: they have neither length.
    """
    length, assumed = float(np.median(np.linalg.norm(gravity, axis=1))), ""
    if abs(length * scale / STANDARD_GRAVITY - 1) < LENGTHS:
        size = 1.0  # what was taken out comes back, whatever the local gravity is
    elif abs(length - 1) < LENGTHS:
        size = STANDARD_GRAVITY / scale
        assumed = f"the driver took gravity of {STANDARD_GRAVITY:g} m/s² out of the acceleration"
    else:
        raise RunError(
            f"gravity in {name} has a length of {length:.4g}, in the acceleration's unit {length * scale:.4g} m/s²: "
            "correct recording.acceleration_unit, or name other columns"
        )
    return linear + gravity * (size if points == "up" else -size), assumed
