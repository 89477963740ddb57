"""A unit is not the declared one: of force, moment, acceleration, angular velocity or attitude.

## What it looks like

In the declared units no body has the mass, the lever or the density that force and moment show. Gravity is 1 where it
should be 9.8. The gyro turns 57 times as fast as gravity or the attitude.

## Why it matters

The tensor is wrong by the factor of the unit, of the moment or of the angular velocity; mass and lever by that of the
force.

## How it is decided

Of force and moment all pairs of common units are compared with the declared mass and centre of gravity, the lever from
the IMU, which the force tells in metres, and a body's density, between that of air and that of the heaviest element.
Another pair must do far better; one that does as well is named beside it. Of accelerometer and gyro: median
acceleration; turns of gravity in the body, which must be as the gyro's. At rest the distance of the centre of gravity
from Q stands for the body's size.

## What to do

Set `force_unit`, `moment_unit`, `acceleration_unit` or `angular_velocity_unit` as the message has it. Where two pairs
fit, the mass decides: weigh the body.
"""

from collections.abc import Iterator, Sequence

import numpy as np

from identify.display.rounding import significant
from identify.judge.conventions.axis_hypotheses import Scales
from identify.judge.conventions.convention_fit import ImuSignal
from identify.judge.conventions.examined_run import ExaminedRun
from identify.judge.conventions.findings.mass import mass_finding
from identify.judge.conventions.findings.point import point_entry
from identify.judge.conventions.imu_conventions import wrong_units
from identify.judge.conventions.removed_weight import CERTAIN, ApparentMass, mass_by_motion
from identify.judge.conventions.wrench_units import (
    COSTS,
    DECLARED,
    FARTHEST,
    BodyByWrench,
    UnitReading,
    body_of_run,
    other_units,
)
from identify.judge.cure import Cure, Entries, as_well
from identify.judge.findings import Finding


class AccelerationInG(Finding):
    """An acceleration that is probably in g."""

    median: float
    """Median of its magnitude."""

    @property
    def looks(self) -> str:
        return f"the median acceleration is {self.median:.3f}: it is probably in g, not m/s^2 (times 9.80665)"

    cure = Cure(choices=[Entries({"acceleration_unit": "g"})])


class GyroInDegrees(Finding):
    """An angular velocity that is probably in deg/s."""

    ratio: float
    """Turn of gravity by the gyro over that by the accelerometer."""

    @property
    def looks(self) -> str:
        return f"the gyro turns {self.ratio:.0f} times faster than gravity does: it is probably in deg/s"

    cure = Cure(choices=[Entries({"angular_velocity_unit": "deg/s"})])


class RateUnit(Finding):
    """An angular velocity in another unit than the attitude shows."""

    ratio: float
    """Turn of the attitude over that by the angular velocity."""
    unit: str
    """Unit that explains it."""

    @property
    def looks(self) -> str:
        return f"the attitude turns {significant(self.ratio, 3)} times as fast as the angular velocity"

    @property
    def cure(self) -> Cure:
        unit = Entries({"angular_velocity_unit": self.unit})
        return Cure(question="degrees taken for radians, or radians for degrees?", choices=[unit])


class WrenchUnits(Finding):
    """Force and moment of a run in other units."""

    mass: float
    """Mass in the declared units [kg]."""
    readings: Sequence[UnitReading]
    """Units that explain it, the best first."""
    fits_as_well: Sequence[Entries] = ()
    """Other settings that fit as well."""

    @property
    def looks(self) -> str:
        mass = significant(self.readings[0].force_factor * self.mass, 3)
        return (
            f"in the declared units no body of {significant(self.mass, 3)} kg fits force and moment; in other units a "
            f"body of {mass} kg does"
        )

    @property
    def cure(self) -> Cure:
        best, *rivals = [reading.entries for reading in self.readings]
        return Cure(choices=[best], then=as_well([*rivals, *self.fits_as_well]))


class WrenchUnitsAtRest(Finding):
    """Force and moment of static poses in other units."""

    mass: float
    """Mass in the declared units [kg]."""
    distance: float
    """Distance of the centre of gravity from Q in the declared units [m]."""
    possible: bool
    """Whether a body may have them, if not the declared one."""
    readings: Sequence[UnitReading]
    """Units that explain it, the best first."""

    @property
    def looks(self) -> str:
        why = "not the declared mass" if self.possible else "no body"
        return (
            f"in the declared units the body has {significant(self.mass, 3)} kg and its centre of gravity "
            f"{significant(1e3 * self.distance, 3)} mm from Q, which is {why}"
        )

    @property
    def cure(self) -> Cure:
        masses = {reading.force_factor for reading in self.readings}
        key = "mass ([scale] or body.mass)" if len(masses) > 1 else "body.r_cg_from_q"
        decides = f"; a declared {key} decides" * (len(self.readings) > 1)
        return Cure(choices=[self._with_body(reading) for reading in self.readings], then=decides)

    def _with_body(self, reading: UnitReading) -> Entries:
        """The units, with mass of the body and distance of its centre of gravity from Q in these."""
        mass, distance = reading.force_factor * self.mass, 1e3 * reading.lever_factor * self.distance
        return Entries(reading.entries.values, remark=f" ({significant(mass, 3)} kg, {significant(distance, 3)} mm)")


_MILLIMETRES = UnitReading("N", "N*mm", 1.0, 1e-3, 2.0)
EXAMPLES = (
    AccelerationInG(topic="/imu", median=1.002),
    GyroInDegrees(topic="/imu", ratio=57.3),
    RateUnit(topic="/imu", ratio=0.01745, unit="deg/s"),
    WrenchUnits(topic="/wrench", mass=19.7, readings=[_MILLIMETRES]),
    WrenchUnitsAtRest(topic="poses.csv", mass=2.1, distance=48.0, possible=False, readings=[_MILLIMETRES]),
)


def imu_unit_findings(imu: ImuSignal, topic: str) -> Iterator[Finding]:
    """Yield the findings on an IMU's units, by its signals alone."""
    wrong = wrong_units(imu)
    if "g" in wrong:
        yield AccelerationInG(topic=topic, median=wrong["g"])
    if "deg/s" in wrong:
        yield GyroInDegrees(topic=topic, ratio=wrong["deg/s"])


def units_finding(
    body: BodyByWrench, readings: Sequence[UnitReading], fits_as_well: Sequence[Entries], topic: str
) -> Finding:
    """Return the finding on other units of force and moment.

    Args:
        body: in the units as declared.
        readings: those that explain it, the best first.
        fits_as_well: other settings that do as well.
        topic: what messages call the data.
    """
    if body.trace is None:
        possible = not body.impossible(DECLARED)
        return WrenchUnitsAtRest(
            topic=topic, mass=body.mass, distance=body.distance(), possible=possible, readings=readings
        )
    return WrenchUnits(topic=topic, mass=body.mass, readings=readings, fits_as_well=fits_as_well)


def unit_findings_of_run(run: ExaminedRun, weight: ApparentMass, given: Scales) -> Iterator[Finding]:
    """Yield the finding on units of force and moment, with its rivals, or that on a mass which no unit explains.

    Args:
        run: under examination; afterwards its sums are those in other units.
        weight: mass whose weight the force is.
        given: scales of the run.
    """
    motion = mass_by_motion(run.sums)
    mass, sigma = (weight.mass, weight.uncertainty) if motion is None else (motion.mass, CERTAIN * motion.sigma)
    body = body_of_run(run.sums, given, mass, sigma, by_motion=motion is not None)
    distance, point = run.elsewhere() or (np.inf, [])
    readings = other_units(body, run.declared, distance < FARTHEST)
    if not readings:
        yield from mass_finding(mass, sigma, run.declared.mass, run.wrench)
        return
    near = readings[0].force_factor == 1.0 and distance < FARTHEST  # another point may explain the moment instead
    if near and readings[0].cost == COSTS["two systems"]:  # rarer than another point
        run.units_instead = [reading.entries for reading in readings]
        return
    run.sums = readings[0].applied(run.sums)
    yield units_finding(body, readings, [point_entry(point)] if near else [], run.wrench)
