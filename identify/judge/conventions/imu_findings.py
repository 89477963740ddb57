"""Findings on the units and axes of an IMU's signals, and the line of the experiment file that cures each."""

from collections.abc import Iterator

from identify.judge.conventions.convention_sums import ImuSignal
from identify.judge.conventions.imu_conventions import accelerometer_axes, wrong_units
from identify.judge.conventions.rotation_findings import axes_text
from identify.judge.findings import Contradiction, Finding

STANDARD_GRAVITY = 9.80665
"""Standard acceleration of gravity [m/s²].

Definition: CGPM 1901.
"""


def imu_findings(imu: ImuSignal, topic: str) -> Iterator[Contradiction]:
    """Findings on an IMU's units and axes from its signals alone."""
    wrong = wrong_units(imu)
    if "g" in wrong:
        yield Finding.ACCELERATION_IN_G.on(topic, median=wrong["g"])
    if "deg/s" in wrong:
        yield Finding.GYRO_IN_DEGREES.on(topic, ratio=wrong["deg/s"])
    axes = accelerometer_axes(imu)
    if axes is not None:
        yield Finding.ACCELEROMETER_AXES.on(topic, axes=axes_text(axes)[1:-1])
