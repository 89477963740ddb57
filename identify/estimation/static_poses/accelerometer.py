"""An accelerometer at rest: its offset and gain from the length of gravity, and the direction of gravity from it."""

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import scipy
from jaxtyping import Float

from identify.signals.run import RunError

FEWEST = 6
"""Least number of poses for offset and gain: four unknowns, one equation a pose."""
LEAST_SPREAD = 0.1
"""Spread of the readings in their third direction, as a part of gravity, below which the offset is not determined."""


@dataclass(frozen=True)
class Accelerometer:
    """Calibration of an accelerometer; ``reading = gain · specific force + offset``."""

    offset: np.ndarray
    """Offset on each axis [m/s²]."""
    gain: float
    """Gain, one for all axes."""
    fitted: bool
    """Whether the offset was estimated; otherwise the readings were only scaled."""
    covariance: np.ndarray = field(default_factory=lambda: np.zeros((3, 3)))
    """Covariance of ``offset``, from the residuals of the lengths [(m/s²)²]; zero where it was not estimated."""

    def specific_force(self, readings: Float[np.ndarray, "n 3"], gravity: float) -> Float[np.ndarray, "n 3"]:
        """Return the specific force at rest [m/s²]: the readings' direction behind the offset, as long as gravity."""
        direction = readings - self.offset
        return gravity * direction / np.linalg.norm(direction, axis=1, keepdims=True)


def calibrate(
    readings: Float[np.ndarray, "n 3"], gravity: float, *, method: Literal["offset", "scale"] | None = None
) -> Accelerometer:
    """Estimate offset and gain of an accelerometer from static readings: ``|reading - offset| = gain · gravity``.

    Least squares in the readings' lengths, from the linear solution of their squares.

    Args:
        readings: in m/s², shape (n, 3), one per pose.
        gravity: local gravity [m/s²].
        method: ``offset`` estimates offset and gain, ``scale`` the gain alone; None: the offset, if the poses allow.

    Raises:
        RunError: a reading of zero; the offset is asked for, and the poses are too few or too similar.
    """
    lengths = np.linalg.norm(readings, axis=1)
    if not (lengths > 0).all():
        raise RunError(f"the accelerometer reads zero at pose {int(np.argmin(lengths)) + 1}: remove that pose")
    spread = np.linalg.svd(readings - readings.mean(axis=0), compute_uv=False)
    determined = len(readings) >= FEWEST and spread[2] > LEAST_SPREAD * lengths.mean() * np.sqrt(len(readings))
    if method == "offset" and not determined:
        raise RunError(
            "the poses do not determine the accelerometer's offset: give six or more in all orientations, "
            'or write accelerometer = "scale"'
        )
    if method == "scale" or not determined:
        return Accelerometer(np.zeros(3), float(lengths.mean() / gravity), fitted=False)
    linear, *_ = np.linalg.lstsq(np.column_stack([2 * readings, np.ones(len(readings))]), lengths**2, rcond=None)
    start = [*linear[:3], np.sqrt(max(linear[3] + linear[:3] @ linear[:3], 0.0))]
    solution = scipy.optimize.least_squares(
        lambda x: np.linalg.norm(readings - x[:3], axis=1) - x[3], start, method="lm"
    )
    variance = 2 * solution.cost / max(len(readings) - 4, 1)
    covariance = variance * np.linalg.inv(solution.jac.T @ solution.jac)[:3, :3]
    return Accelerometer(solution.x[:3], float(solution.x[3] / gravity), fitted=True, covariance=covariance)
