"""An accelerometer's readings hold no gravity.

## What it looks like

At rest the accelerometer reads zero: several drivers publish the "linear acceleration", from which their filter has
taken gravity out.

## Why it matters

Mass, centre of gravity and the axes follow from the specific force, which at rest is gravity. Without it the mass is
wrong by tens of percent, and cable, cross-talk or a rotation seem to explain the force.

## How it is decided

Readings are carried along axes at rest by the gyro and averaged over 5 s: whatever the motion and the unit, gravity is
left over, where it is in them. A body that a lever explains may be in free fall; then the force must show its weight.

## What to do

Set `accelerometer_at_rest = "zero"`, in the map for a run that was imported. An attitude in the messages or in the
table then puts gravity back, with its own errors. So do columns of the vector that the driver took out, `gravity` in
the map, which tell no heading. With neither the acceleration is not used, and the mass is not determined. Better
record the accelerometer as it reads.
"""

from collections.abc import Iterator

import numpy as np

from identify.judge.conventions.axis_hypotheses import DECISIVE
from identify.judge.conventions.carried_attitude import carried_by_gyro
from identify.judge.conventions.convention_fit import SMOOTHING, ImuSignal, WrenchSignal, smoothed
from identify.judge.conventions.imu_conventions import in_free_fall, without_gravity
from identify.judge.conventions.posed_force import PosedForce, PosedMotion, at_instants
from identify.judge.cure import Cure, Entries
from identify.judge.findings import Finding

LEFT = 0.25
"""Part of the force's misfit that a weight may leave over, where it is named.

Choice: a gyro without its bias taken out turns it by some degrees.
"""


class GravityRemoved(Finding):
    """An accelerometer whose readings are zero at rest."""

    looks = "the accelerometer reads nothing at rest: gravity was taken out of its readings"
    cure = Cure(
        choices=[Entries({"accelerometer_at_rest": "zero"})],
        then="; a recorded attitude, or a table's columns of gravity, then puts it back, without them the mass is not "
        "determined",
    )


EXAMPLES = (GravityRemoved(topic="/imu"),)


def gravity_removed(imu: ImuSignal, topic: str, wrench: WrenchSignal | None = None) -> Iterator[Finding]:
    """Yield the finding on an accelerometer without gravity.

    Args:
        imu: signals of the IMU.
        topic: of the IMU.
        wrench: of the load cell, which tells a fall from gravity that was removed; None: there is none.
    """
    if without_gravity(imu) and (not in_free_fall(imu) or (wrench is not None and _weighs(wrench, imu))):
        yield GravityRemoved(topic=topic)


def _weighs(wrench: WrenchSignal, imu: ImuSignal) -> bool:
    """Whether the force holds a weight that stays where it is while the gyro turns."""
    time, omega, specific = imu
    step = float(np.median(np.diff(time)))
    if not 0 < step <= SMOOTHING:
        return False
    motion = PosedMotion(carried_by_gyro(step, omega), specific, time=time, smooth=lambda x: smoothed(step, x))
    posed = PosedForce(at_instants(time, wrench.time, wrench.force), motion)
    plain, weighed = posed.fit(lift=False), posed.fit()
    return weighed.misfit < LEFT * plain.misfit and posed.excess(plain, weighed) > DECISIVE
