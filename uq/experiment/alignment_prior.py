"""What is known of the IMU against the load cell before a run: keys of ``[recording]`` for the joint estimate."""

from typing import Any

import numpy as np

from identify.joint.priors import Alignment
from uq.files.document import ExperimentError, Table

ONE = {"delay": "s", "sigma_delay": "s", "sigma_tilt": "rad"}
"""Keys of one value, and its unit."""
EACH_AXIS = {
    "sigma_rotation": "rad", "sigma_gyro_bias": "rad/s", "sigma_accelerometer_bias": "m/s^2", "sigma_force_drift": "N",
    "sigma_moment_drift": "N*m",
}  # fmt: skip
"""Keys of one value, or of one an axis."""
LONGEST_DELAY = 10.0
"""Seconds of delay, or of its standard uncertainty, beyond which clocks are to be repaired instead."""
WIDEST_ANGLE = np.pi / 6
"""Standard uncertainty of the rotation [rad] beyond which the frames are to be declared instead."""


def parse_alignment(table: Table) -> Alignment:
    """Return what ``[recording]`` says of delay, rotation and slow errors; what it does not say is left wide.

    Raises:
        ExperimentError: a wrong unit or length, an uncertainty below zero, a delay or a rotation beyond sense.
    """
    given: dict[str, Any] = {key: table.quantity(key, unit, None) for key, unit in ONE.items()}
    given |= {key: _each(table, key, unit) for key, unit in EACH_AXIS.items()}
    given = {key: value for key, value in given.items() if value is not None}
    for key, value in given.items():
        if key.startswith("sigma") and np.min(value) < 0:
            raise ExperimentError(f"{table.path(key)} is {table.content[key]!r}: write zero or more")
        if key in ("delay", "sigma_delay") and abs(value) > LONGEST_DELAY:
            raise ExperimentError(f"{table.path(key)} is {table.content[key]!r}: repair the clocks first")
        if key == "sigma_rotation" and np.max(value) > WIDEST_ANGLE:
            raise ExperimentError(
                f"{table.path(key)} is {table.content[key]!r}: declare imu_rotation_to_body, then at most 30 deg"
            )
    return Alignment(**given)


def _each(table: Table, key: str, unit: str) -> Any:
    """One value for all axes, or three."""
    if isinstance(table.content.get(key), list):
        return tuple(map(float, table.vector(key, unit)))
    return table.quantity(key, unit, None)
