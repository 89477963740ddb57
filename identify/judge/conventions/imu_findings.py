"""Findings on the units and axes of an IMU's signals, and the line of the experiment file that cures each."""

from collections.abc import Iterator

from identify.judge.conventions.contradiction import Contradiction
from identify.judge.conventions.convention_sums import ImuSignal
from identify.judge.conventions.imu_conventions import accelerometer_axes, wrong_units
from identify.judge.conventions.rotation_findings import axes_text

STANDARD_GRAVITY = 9.80665  # m/s²


def imu_findings(imu: ImuSignal, topic: str) -> Iterator[Contradiction]:
    """Findings on an IMU's units and axes from its signals alone."""
    wrong = wrong_units(imu)
    if "g" in wrong:
        yield Contradiction(
            "unit",
            topic,
            f"acceleration is {wrong['g']:.3f} in the median: it is probably in g, not m/s^2 (times "
            f'{STANDARD_GRAVITY}): set acceleration_unit = "g" in [recording]',
        )
    if "deg/s" in wrong:
        yield Contradiction(
            "unit",
            topic,
            f"the gyro turns {wrong['deg/s']:.0f} times faster than gravity does: it is probably in deg/s: "
            'set angular_velocity_unit = "deg/s" in [recording]',
        )
    axes = accelerometer_axes(imu)
    if axes is not None:
        yield Contradiction(
            "axes",
            topic,
            "gravity turns as the gyro says only if the accelerometer's axes are the gyro's "
            f"({axes_text(axes)[1:-1]}): swapped axes",
        )
