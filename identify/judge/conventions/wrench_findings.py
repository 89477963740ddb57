"""Contradictions of a run with mechanics, and the line of the experiment file that cures each.

Reversed signs, turned or mirrored axes, weight that is missing, units, a moment taken elsewhere: each is a hypothesis
that must explain the run better than 'as declared' by a factor of exp(30) in likelihood before it is named. What no
sensor tells is compared with what the experiment declares: mass, centre of gravity.

With force and moment in units of u_F and u_M, the mass is u_F m, the centre of gravity u_M / u_F r, the tensor u_M I by
what the numbers alone show. Three statements compare: the declared mass and centre of gravity; the lever from the IMU,
which the force tells in metres; and a body's density, between that of air and that of the heaviest element. The load
cell's zeros are free. Without a declared mass a factor that force and moment share leaves no trace but in the density.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from identify.judge.conventions import convention_fit
from identify.judge.conventions.axis_hypotheses import (
    DECISIVE,
    EQUAL,
    Hypothesis,
    Scales,
    best_axes,
    misalignment,
    scales,
)
from identify.judge.conventions.convention_fit import (
    ALPHA,
    FORCE,
    FORCE_TERMS,
    MASS_AT,
    MOMENT,
    MOMENT_TERMS,
    SPECIFIC,
    ConventionSums,
    DeclaredRig,
    ImuSignal,
    Matrix,
    Vector,
    WrenchSignal,
    convention_sums,
)
from identify.judge.conventions.free_rotation import (
    CERTAIN_SHIFT,
    LEAST_TURN,
    FreeRotation,
    axes_text,
    explains,
    oblique_rotation,
    rotation_finding,
    small_turn_text,
)
from identify.judge.conventions.gravity_findings import AttitudeSignal, run_gravity
from identify.judge.conventions.imu_conventions import in_free_fall, in_si
from identify.judge.conventions.removed_weight import (
    AIR,
    CERTAIN,
    PARTLY,
    ApparentMass,
    apparent_mass,
    density,
    mass_by_motion,
    missing_weight,
)
from identify.judge.findings import Contradiction, Finding
from identify.rigid_body.rotation import exponential
from identify.rounding import significant

POUND_FORCE, KILOGRAM_FORCE, INCH, FOOT = 4.4482216152605, 9.80665, 0.0254, 0.3048
SYSTEMS = {
    ("N", 1.0): {"N*m": 1.0, "N*mm": 1e-3, "N*cm": 1e-2},
    ("lbf", POUND_FORCE): {"lbf*inch": POUND_FORCE * INCH, "lbf*ft": POUND_FORCE * FOOT},
    ("kgf", KILOGRAM_FORCE): {"kgf*m": KILOGRAM_FORCE, "kgf*cm": KILOGRAM_FORCE * 1e-2},
    ("kN", 1e3): {"kN*m": 1e3},
}
"""Units of moment beside those of force, with their size in SI.

Definition: NIST SP 811, B.8.
"""
LEVER_ALIKE = 1.5
"""Factor between the levers of two pairs of units within which units of two systems are not named.

Choice: a drawing of the centre of gravity may be as wrong.
"""
COSTS = {"one system": 2.0, "two systems": 6.0}
"""Chi-square that other units must gain before they count as equally good.

Choice: the order alone counts, the likelier mistake first; all are far below ``DECISIVE``.
"""
CONSISTENT = 30.0
"""Chi-square, of up to seven degrees of freedom, above which units explain nothing.

Chance: 1e-4. Of the right units 1 to 7.
"""
FARTHEST = 0.5
"""Choice: distance of another point up to which it is a rival of another unit of the moment; no rig is larger [m]."""
UNIT_TOLERANCE = 0.1
"""Departure of a ratio from that of a unit, as a standard deviation.

Choice: as a gain error and a rounded mass have together; no two units of force are so near.
"""
DRAWN = 3e-3
"""Standard deviation of a declared centre of gravity, beside the stated one, and of a declared IMU's place [m].

Choice: a drawing is no better.
"""
IMU_AT_Q = 15e-3
"""Distance of an IMU from Q where no position is declared, as a standard deviation of each coordinate [m].

Prior: our choice; the estimate takes it to be at Q.
"""
HEAVIEST = 25e3
"""Mass over the cube of twice the gyration radius above which no body is [kg/m³].

Definition: that of a ball of osmium, 22,590 kg/m³ times 1.13.
"""


@dataclass(frozen=True)
class UnitReading:
    """A pair of units, by the factors from the numbers as declared to SI."""

    force: str
    moment: str
    force_factor: float
    moment_factor: float
    cost: float = 0.0

    @property
    def declared(self) -> bool:
        """Whether these are the units that are declared."""
        return self.cost == 0.0

    @property
    def lever_factor(self) -> float:
        """Factor of every lever that force and moment tell."""
        return self.moment_factor / self.force_factor

    def applied(self, sums: ConventionSums) -> ConventionSums:
        """The sums as they would be."""
        return sums.scaled(FORCE, self.force_factor).scaled(MOMENT, self.moment_factor)

    def lines(self) -> str:
        """The keys of the units that differ from those declared."""
        units = {"force": (self.force, self.force_factor), "moment": (self.moment, self.moment_factor)}
        return " and ".join(f'{key}_unit = "{name}"' for key, (name, factor) in units.items() if factor != 1.0)


def unit_readings(force_unit: float, moment_unit: float) -> Iterator[UnitReading]:
    """Return all pairs of units, those declared first.

    Args:
        force_unit: newtons in the declared unit of force.
        moment_unit: newton metres in the declared unit of moment.
    """
    yield UnitReading("", "", 1.0, 1.0)
    moments = [(force, name, size) for (force, _), group in SYSTEMS.items() for name, size in group.items()]
    for force, force_size in SYSTEMS:
        for system, moment, moment_size in moments:
            factors = _rounded(force_size / force_unit), _rounded(moment_size / moment_unit)
            alike = 1 / LEVER_ALIKE < factors[1] / factors[0] < LEVER_ALIKE
            if factors != (1.0, 1.0) and (system == force or (1.0 in factors and not alike)):
                cost = COSTS["one system" if system == force else "two systems"]
                yield UnitReading(force, moment, *factors, cost)


def _rounded(factor: float) -> float:
    """A factor of units, free of rounding where it is one."""
    return 1.0 if abs(factor - 1.0) < 1e-9 else factor


@dataclass(frozen=True, eq=False)
class BodyByWrench:
    """The body that force and moment show, in the units as declared."""

    sums: ConventionSums
    given: Scales
    mass: float
    """Mass whose weight the force is [kg]."""
    uncertainty: float
    """Expanded uncertainty of the mass [kg]."""
    by_motion: bool = False
    """Whether the force's changes determine the mass, and so the lever."""

    @cached_property
    def _lever(self) -> tuple[Vector, Matrix] | None:
        """Centre of gravity from the IMU, by the force alone, and its covariance; None: the force does not tell it."""
        if not self.by_motion:
            return None
        priors = replace(self.given, offset=np.inf, lever=np.inf).priors
        fit = convention_fit.solve(self.sums, FORCE_TERMS, FORCE, variance=self.given.force, priors=priors)
        lever, mass = slice(MASS_AT.stop, MASS_AT.stop + 3), float(fit.values[0])
        return fit.values[lever] / mass, fit.covariance[lever, lever] / mass**2

    @cached_property
    def _trace(self) -> tuple[float, float]:
        """The tensor's trace, and its standard uncertainty."""
        return convention_fit.solve(self.sums, MOMENT_TERMS, MOMENT, variance=self.given.moment).trace

    def misfit(self, reading: UnitReading, declared: DeclaredRig) -> float:
        """Chi-square of what is declared against the body in other units; infinite where no body is so."""
        mass = reading.force_factor * self.mass
        if self._impossible(reading, mass):
            return np.inf
        chi_square, factor = reading.cost, reading.lever_factor
        if declared.mass is not None:
            relative = np.hypot(UNIT_TOLERANCE, self.uncertainty / self.mass)
            chi_square += float(np.log(mass / declared.mass) / relative) ** 2
        r, covariance = factor * self.sums.centre.r, factor**2 * self.sums.centre.covariance
        if declared.r_cg is not None:
            chi_square += self._distance(declared.r_cg - r, covariance + np.diag(declared.sigma_r_cg**2 + DRAWN**2))
        if self._lever is not None:
            lever, spread = self._lever
            at, sigma_at = (np.zeros(3), IMU_AT_Q) if declared.imu_position is None else (declared.imu_position, DRAWN)
            chi_square += self._distance(at + lever - r, covariance + spread + sigma_at**2 * np.eye(3))
        return chi_square

    def _distance(self, shift: Vector, covariance: Matrix) -> float:
        seen = shift - self.sums.centre.undetermined @ shift
        return float(seen @ np.linalg.solve(covariance, seen))

    def _impossible(self, reading: UnitReading, mass: float) -> bool:
        """Whether no body has this mass with these moments."""
        trace, spread = self._trace
        smallest, largest = (reading.moment_factor * (trace + sign * CERTAIN * spread) for sign in (-1, 1))
        return bool(density(mass, smallest) < AIR or density(mass, largest) > HEAVIEST)


def other_units(body: BodyByWrench, declared: DeclaredRig, elsewhere: bool) -> list[UnitReading]:
    """Return the units that explain the run far better than those declared, the best first; none where none do.

    ``elsewhere``: another point does as well, with three free coordinates: a unit of the moment must do so entirely.
    """
    readings = list(unit_readings(*declared.units))
    scores = [body.misfit(reading, declared) for reading in readings]
    least = min(scores)
    rival = elsewhere and readings[scores.index(least)].force_factor == 1.0
    if not least < min(scores[0] - DECISIVE, EQUAL if rival else CONSISTENT):
        return []
    order = [k for k in np.argsort(scores) if scores[k] < least + EQUAL]
    return [readings[k] for k in order]


MASS_TOLERANCE = 0.15
"""Departure of the force at rest from the declared weight that is no finding.

Choice: an error of gain or zero is smaller. In 40 clean runs at most 0.04 (``tests.helpers.judge_margins``).
"""
LEAST_GRAVITY = 2.0
"""Specific force without which nothing is judged [m/s²].

Choice: a fifth of gravity: there is no accelerometer, or its unit is g.
"""
LEAST_SHIFT = 3e-3
"""Distance below which no other point is named [m].

Choice: a drawing's centre of gravity is no better. In 40 clean runs at most 0.5 mm (``tests.helpers.judge_margins``).
"""
TOLD = 0.25
"""Part of an axis in directions that the run does not determine, below which its coordinate is stated.

Choice: the axis lies within 30° of what is determined.
"""


def wrench_findings(
    wrench: WrenchSignal,
    imu: ImuSignal,
    declared: DeclaredRig,
    *,
    wrench_topic: str,
    imu_topic: str,
    attitude: AttitudeSignal | None = None,
) -> list[Contradiction]:
    """Judge a run's wrench on the body and motion together, both in the body frame and SI as far as declared.

    ``attitude``: at the IMU's instants; None: that of its gyro.
    """
    if min(len(wrench.time), len(imu.time)) < 10 or not all((np.diff(s.time) > 0).all() for s in (wrench, imu)):
        return []
    imu = in_si(imu)
    sums = convention_sums(wrench, imu)
    if sums is None or sums.size(SPECIFIC) < LEAST_GRAVITY or in_free_fall(imu):
        return []
    if min(float(sums.changes(columns)) for columns in (FORCE, MOMENT, ALPHA)) < 1e-20:
        return []
    verdict = run_gravity(wrench, imu, attitude, declared, wrench_topic)
    if verdict.final:
        return verdict.findings
    if verdict.gravity is not None and attitude is not None and attitude.gravity is not None:
        change = np.einsum("nji,j->ni", attitude.to_rest, attitude.gravity - verdict.gravity)
        sums = convention_sums(wrench, imu._replace(specific_force=imu.specific_force + change)) or sums
    return [*verdict.findings, *_Examination(sums, declared, wrench_topic, imu_topic).findings()]


SIGN_DOUBT = (
    "; the other sign of the accelerometer, or of force and moment, fits as well: this motion does not distinguish them"
)


def _reversed(fit: Hypothesis) -> bool:
    return fit.sensor == "wrench" and abs(float(np.trace(fit.matrix))) == 3


def _or(lines: list[str]) -> str:
    """Return a text on lines that would be as good."""
    return "".join(f"; or {line}, which fits as well" for line in lines)


class _Examination:
    """A run's findings in order: each step corrects the sums for its finding before the next looks at them."""

    def __init__(self, sums: ConventionSums, declared: DeclaredRig, wrench: str, imu: str) -> None:
        self.sums, self.declared, self.wrench, self.imu = sums, declared, wrench, imu
        self.units_instead: list[str] = []

    def findings(self) -> Iterator[Contradiction]:
        """All findings, the gravest first."""
        weight = apparent_mass(self.sums, self.declared.mass)
        weighed = self.declared.weighed and not weight.missing
        given = scales(self.sums, weight=weighed)
        rotation = oblique_rotation(self.sums, given, weighed=weighed)
        if rotation is not None:
            yield self._rotated(rotation)
            given = rotation.given
        force, moment = explains(self.sums, FORCE, given.force), explains(self.sums, MOMENT, given.moment)
        if rotation is None and (force or moment):
            yield from self._axes(best_axes(self.sums, given, measured=self.declared.measured))
        if not self.declared.weighed or not (force and moment):
            return
        if weight.missing:
            mass = self.declared.mass
            body = "a body with such moments" if mass is None else f"the declared {significant(mass)} kg"
            yield Finding.WEIGHT_MISSING.on(
                self.wrench, mass=significant(weight.mass, 2), body=body, lines=self._weight_cure(given)
            )
            return
        yield from self._units(weight, given)
        yield from self._partly_missing(given)
        yield from self._turned(scales(self.sums, weight=True, terms=MOMENT_TERMS))
        yield from self._point()

    # Axes and signs

    def _axes(self, fits: list[Hypothesis]) -> Iterator[Contradiction]:
        best = fits[0]
        before, self.sums = self.sums, best.applied(self.sums)
        doubt = SIGN_DOUBT * any(_reversed(fit) and fit.accelerometer != best.accelerometer for fit in fits[1:])
        if best.accelerometer < 0:
            yield Finding.ACCELEROMETER_REVERSED.on(self.imu, doubt=doubt)
        if np.array_equal(best.matrix, np.eye(3)):
            return
        if best.sensor == "imu":
            yield Finding.IMU_MIRRORED.on(self.imu, axes=axes_text(best.matrix)[1:-1])
        elif np.array_equal(best.matrix, -np.eye(3)):
            yield Finding.WRENCH_REVERSED.on(self.wrench, doubt=doubt)
        elif np.linalg.det(best.matrix) < 0:
            axes = axes_text(-best.matrix @ self.declared.wrench_rotation)
            yield Finding.WRENCH_MIRRORED.on(self.wrench, axes=axes)
        else:
            yield self._turned_axes(before, fits)

    def _rotated(self, rotation: FreeRotation) -> Contradiction:
        """Any rotation, and what is reversed besides."""
        before, undone = rotation.reversed.applied(self.sums), rotation.matrix.T
        sensor, cure = self._rotation_cure(before, undone)
        self.sums = before.turned(wrench=undone) if sensor == "wrench" else before.turned(imu=rotation.matrix)
        return rotation_finding(rotation, self._topic(sensor), cure)

    def _rotation_cure(self, before: ConventionSums, matrix: Matrix) -> tuple[str, str]:
        """The sensor that is turned, where that is decided, and the line or lines that undo it."""
        cell = f"wrench_rotation_to_body = {axes_text(matrix @ self.declared.wrench_rotation)}"
        imu = f"imu_rotation_to_body = {axes_text(matrix.T @ self.declared.imu_rotation)}"
        sensor = self._turned_sensor(before, matrix)
        cure = {"wrench": cell, "imu": imu}.get(sensor, f"{imu} if the IMU is the rotated one, otherwise {cell},")
        return sensor, cure

    def _topic(self, sensor: str) -> str:
        return self.wrench if sensor == "wrench" else self.imu

    def _turned_axes(self, before: ConventionSums, fits: list[Hypothesis]) -> Contradiction:
        matrix = fits[0].matrix
        sensor, cure = self._rotation_cure(before, matrix)
        others = [axes_text(fit.matrix.T)[1:-1] for fit in fits[1:4] if fit.sensor == "wrench"]
        doubt = f"; ({'), ('.join(others)}) fit as well" if others else ""
        axes = axes_text(matrix.T)[1:-1]
        return Finding.OTHER_AXES.on(self._topic(sensor), axes=axes, doubt=doubt, lines=cure)

    def _turned_sensor(self, before: ConventionSums, matrix: Matrix) -> str:
        """Return the sensor that is turned, by the declared centre of gravity; '' where that does not decide."""
        if self.declared.r_cg is None:
            return ""
        _, as_wrench = self._shift(before.turned(wrench=matrix))
        _, as_imu = self._shift(before.turned(imu=matrix.T))
        if abs(as_wrench - as_imu) < DECISIVE / 2:
            return ""
        return "wrench" if as_wrench < as_imu else "imu"

    # Weight

    def _weight_cure(self, given: Scales) -> str:
        """Return how the weight was removed, as far as the run shows, and the line that restores it."""
        missing = missing_weight(self.sums, given, self.declared)
        cures = ['zeroed with the body on it? set zero = "loaded" in [recording]'] if missing.zeroed else []
        if missing.removed is not None:
            key = "gravity_from_force" if missing.removed == "force" else "gravity"
            doubt = ', or "gravity_from_force" if the moment still has it: this motion does not distinguish them'
            cure = f'removed by the driver? set compensated = "{key}" in [recording]'
            cures.append(cure + doubt * (missing.removed == "undetermined"))
        return "; or ".join(cures)

    def _partly_missing(self, given: Scales) -> Iterator[Contradiction]:
        """Yield the finding on a weight that is partly missing, where the changes of the force determine the mass."""
        motion = mass_by_motion(self.sums)
        if motion is not None and motion.missing > PARTLY + 3 * motion.sigma / motion.mass:
            figures = {"mass": significant(motion.mass, 2), "share": motion.missing}
            yield Finding.WEIGHT_PARTLY_MISSING.on(self.wrench, lines=self._weight_cure(given), **figures)

    # Units

    def _units(self, weight: ApparentMass, given: Scales) -> Iterator[Contradiction]:
        """Yield the finding on units, with its rivals, or that on a declared mass which no unit explains."""
        motion = mass_by_motion(self.sums)
        mass, sigma = (weight.mass, weight.uncertainty) if motion is None else (motion.mass, CERTAIN * motion.sigma)
        body = BodyByWrench(self.sums, given, mass=mass, uncertainty=sigma, by_motion=motion is not None)
        distance, where = self._elsewhere() or (np.inf, "")
        readings, declared = other_units(body, self.declared, distance < FARTHEST), self.declared.mass
        two_systems = bool(readings) and readings[0].cost == COSTS["two systems"]
        if two_systems and readings[0].force_factor == 1.0 and distance < FARTHEST:  # rarer than another point
            self.units_instead = [reading.lines() for reading in readings]
        elif readings:
            best, *rivals = readings
            self.sums = best.applied(self.sums)
            lines = [rival.lines() for rival in rivals]
            if best.force_factor == 1.0 and distance < FARTHEST:
                lines.append(f"wrench_point = [{where}]")
            doubt = _or(lines)
            weighs = significant(best.force_factor * mass, 3)
            shown = significant(mass, 3)
            yield Finding.UNITS.on(self.wrench, shown=shown, mass=weighs, doubt=doubt, lines=best.lines())
        elif declared is not None and abs(mass - declared) > MASS_TOLERANCE * declared + sigma:
            masses = {"weighs": significant(mass), "stated": significant(declared)}
            yield Finding.WEIGHT_OF_ANOTHER_MASS.on(self.wrench, **masses)

    # Small turns, and the moment's point

    def _turned(self, given: Scales) -> Iterator[Contradiction]:
        turn, chi_square, covariance = misalignment(self.sums, given)
        if chi_square > CERTAIN_SHIFT and float(np.linalg.norm(turn)) > LEAST_TURN:
            before, rotation = self.sums, exponential(turn)
            sensor, cure = self._rotation_cure(before, rotation.T)
            self.sums = before.turned(wrench=rotation.T) if sensor == "wrench" else before.turned(imu=rotation)
            both = covariance + np.diag(self.declared.turn**2)
            if turn @ np.linalg.solve(both, turn) > CERTAIN_SHIFT:
                vector = small_turn_text(turn, covariance)
                yield Finding.TURNED_A_LITTLE.on(self._topic(sensor), turn=vector, lines=cure)

    def _shift(self, sums: ConventionSums) -> tuple[Vector, float]:
        """Return the shift from the centre of gravity that some sums show to the declared one [m], its chi-square."""
        assert self.declared.r_cg is not None  # noqa: S101
        shift = self.declared.r_cg - sums.centre.r
        shift = shift - sums.centre.undetermined @ shift
        covariance = sums.centre.covariance + np.diag(self.declared.sigma_r_cg**2) + 1e-6 * np.eye(3)
        return shift, float(shift @ np.linalg.solve(covariance, shift))

    def _point(self) -> Iterator[Contradiction]:
        place = self._elsewhere()
        if place is not None:
            distance, where = place
            unknown = "; the motion does not determine coordinates marked ?" * ("?" in where)
            figures = {"distance": 1e3 * distance, "where": where, "unknown": unknown}
            yield Finding.OTHER_POINT.on(self.wrench, doubt=_or(self.units_instead), **figures)

    def _elsewhere(self) -> tuple[float, str] | None:
        """Distance [m] and coordinates of the point that the moment is about, if not Q, by the declared r_CG."""
        if self.declared.r_cg is None:
            return None
        shift, chi_square = self._shift(self.sums)
        certain = np.diag(self.sums.centre.undetermined) < TOLD
        distance = float(np.linalg.norm(shift[certain]))
        if chi_square < CERTAIN_SHIFT or distance < LEAST_SHIFT:
            return None
        point = zip(shift + self.declared.wrench_point, certain, strict=True)
        where = ", ".join(f'"{1e3 * x:.1f} mm"' if sure else "?" for x, sure in point)
        return distance, where
