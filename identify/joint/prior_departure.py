"""Unknowns that the runs place far from what was declared of them: the first thing a reader should know."""

from typing import NamedTuple

import numpy as np

from identify.joint.joint_model import SIZES, SLICES
from identify.rounding import rounded, with_uncertainty

FAR = 3.0
"""Standard uncertainties of the prior from which a departure is told."""


class Quantity(NamedTuple):
    """Name, unit and cure of an unknown in texts."""

    words: str
    scale: float
    unit: str
    advice: str


QUANTITIES = {
    "rotation": Quantity("rotation vector of the IMU", 180 / np.pi, "°", "check the frames of load cell and IMU"),
    "mass": Quantity("mass", 1.0, "kg", "check the load cell's gain and the accelerometer's place (imu_position)"),
    "r_cg": Quantity("centre of gravity", 1e3, "mm", "check r_cg_from_q, and the load cell's zero and gain"),
    "force_offset": Quantity("zero of the force", 1.0, "N", "check that the load cell was not tared in between"),
    "moment_offset": Quantity("zero of the moment", 1.0, "N·m", "check that the load cell was not tared in between"),
    "gyro_bias": Quantity("zero of the gyro", 1e3, "mrad/s", "check its unit, or declare sigma_gyro_bias wider"),
    "delay": Quantity("delay", 1e3, "ms", "check the clocks, or declare the delay"),
    "accelerometer_bias": Quantity(
        "zero of the accelerometer", 1.0, "m/s²", "check its place (imu_position), its scale and its axes"
    ),
    "cg_from_still": Quantity(
        "distance of the centre of gravity from the point at rest", 1e3, "mm",
        'the centre of gravity is not still: declare r_cg_from_omb with its uncertainty, or remove cg_motion = "still"',
    ),
    "gravity": Quantity("error of gravity", 1.0, "m/s²", "check platform.gravity and the load cell's gain"),
    "gyro_scale": Quantity("scale error of the gyro", 100.0, "%", "declare it wider, or calibrate"),
    "cell_matrix": Quantity("error of the load cell's matrix", 100.0, "%", "declare it wider, or calibrate"),
}  # fmt: skip
"""Name, unit and cure of each unknown of :data:`identify.joint.joint_model.SIZES`, the rotation first, as all
others are in its axes.

Unknowns that are missing here only absorb slow errors."""


def departures(theta: np.ndarray, mean: np.ndarray, beforehand: np.ndarray) -> list[str]:
    """Return a line for each unknown that is more than three standard uncertainties of its prior from it.

    Args:
        theta: the estimate of all unknowns, in their order.
        mean: of the prior.
        beforehand: covariance of the prior; zero for what is exact or has none.
    """
    sigma = np.sqrt(np.diag(beforehand))
    distance = np.abs(theta - mean) / np.where(sigma > 0, sigma, np.inf)
    lines = []
    for name, quantity in QUANTITIES.items():
        here = SLICES[name]
        worst = here.start + int(np.argmax(distance[here]))
        if distance[worst] > FAR:
            axis = f" on axis {worst - here.start + 1}" if SIZES[name] == 3 else ""
            value, before, spread = (quantity.scale * array[worst] for array in (theta, mean, sigma))
            lines.append(
                f"the {quantity.words}{axis} comes to {rounded(value, spread)} {quantity.unit}, {distance[worst]:.1f} "
                f"standard uncertainties from what was declared ({with_uncertainty(before, spread)}): "
                f"{quantity.advice}"
            )
    return lines
