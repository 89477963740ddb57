"""Contradictions of a run with mechanics, and the line of the experiment file that cures each.

Reversed signs, turned or mirrored axes, weight that is missing, units, a moment taken elsewhere: each is a hypothesis
that must explain the run better than 'as declared' by a factor of exp(30) in likelihood before it is named. What no
sensor tells is compared with what the experiment declares: mass, centre of gravity.
"""

from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from identify.judge.conventions.axis_hypotheses import (
    DECISIVE,
    EQUAL,
    Hypothesis,
    Scales,
    best_axes,
    chi_square,
    misalignment,
    scales,
)
from identify.judge.conventions.convention_fit import (
    ALPHA,
    FORCE,
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
from identify.judge.conventions.euler_rates import euler_rates_finding
from identify.judge.conventions.free_rotation import (
    CERTAIN_SHIFT,
    LEAST_TURN,
    FreeRotation,
    axes_text,
    explains,
    oblique_rotation,
    other_sign,
    rivals_text,
    rotation_finding,
    small_turn_text,
    tensor_about_centre,
)
from identify.judge.conventions.gravity_findings import AttitudeSignal, run_gravity
from identify.judge.conventions.imu_conventions import in_free_fall, in_si
from identify.judge.conventions.removed_weight import (
    CERTAIN,
    PARTLY,
    ApparentMass,
    apparent_mass,
    mass_by_motion,
    missing_weight,
)
from identify.judge.conventions.wrench_units import (
    COSTS,
    DRAWN,
    FARTHEST,
    body_of_run,
    fits_as_well,
    mass_finding,
    other_units,
    units_finding,
)
from identify.judge.findings import CHANNELS, Contradiction, Finding
from identify.rigid_body.rotation import exponential
from identify.rounding import fixed, significant

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
    if declared.measured and (rates := euler_rates_finding(wrench, imu, imu_topic)):
        return rates
    verdict = run_gravity(wrench, imu, attitude, declared, wrench_topic)
    if verdict.final:
        return verdict.findings
    if verdict.gravity is not None and attitude is not None and attitude.gravity is not None:
        change = np.einsum("nji,j->ni", attitude.to_rest, attitude.gravity - verdict.gravity)
        sums = convention_sums(wrench, imu._replace(specific_force=imu.specific_force + change)) or sums
    upward = 0.0 if attitude is None or attitude.source == "gyro" else attitude.upward(imu.specific_force)
    examination = Examination(sums, declared, wrench_topic, imu_topic, upward=upward)
    return [*verdict.findings, *examination.findings()]


class SignReading(NamedTuple):
    """Signals that may have the other sign: force F, moment M and specific force f, of which two alone do not tell.

    (F, f, r) and (-F, -f, -r) obey the same equations.
    """

    words: str
    cure: str
    mirrored: bool = False
    """Whether the centre of gravity lies on the other side of the moment's point."""
    downwards: bool = False
    """Whether the accelerometer reads downwards at rest."""


ON_SENSOR = 'wrench = "on_sensor" ("on_body" if that is already set)'
DOWN = 'accelerometer_at_rest = "down" ("up" if that is already set)'
DECIDES = "the accelerometer's reading at rest, a recorded attitude or a declared body.r_cg_from_q decides"
DECIDES_AT_REST = "the sensors' readings under a known load, or a declared body.r_cg_from_q, decide"
WRENCH = SignReading("force and moment have the reversed sign", ON_SENSOR)
DOWNWARDS = SignReading("the accelerometer reads downwards at rest", DOWN, downwards=True)
BOTH = SignReading(f"{WRENCH.words} and {DOWNWARDS.words}", f"{ON_SENSOR} and {DOWN}", downwards=True)


def _alone(signal: str, declared: DeclaredRig) -> SignReading:
    """The reading that force or moment alone have the other sign."""
    signs = np.where(np.arange(6) // 3 == ("force", "moment").index(signal), -1.0, 1.0)
    rows = ", ".join(f"[{', '.join(f'{x + 0.0:g}' for x in row)}]" for row in signs[:, None] * declared.calibration)
    return SignReading(f"the {signal} alone has the reversed sign", f"calibration = [{rows}]", mirrored=True)


def _proper(matrix: Matrix) -> bool:
    return float(np.linalg.det(matrix)) > 0


def _either_turned(before: ConventionSums, matrix: Matrix) -> dict[str, ConventionSums]:
    """The sums with a rotation of the wrench's axes undone, by the sensor that is turned."""
    return {"imu": before.turned(imu=matrix.T), "wrench": before.turned(wrench=matrix)}


def _without_moment(sums: ConventionSums) -> ConventionSums:
    """The sums of static poses with a moment that any axes explain: nought, and a noise above the arithmetic's."""
    return replace(sums.scaled(MOMENT, 0.0), noise=(0.0, 1e-6), white=1.0)


class Examination:
    """A run's findings in order: each step corrects the sums for its finding before the next looks at them.

    Args:
        sums: of the run.
        declared: of body and rig.
        wrench: topic of force and moment.
        imu: topic of the motion.
        upward: mean of the accelerometer's reading along the upward axis of a recorded attitude [m/s²]; 0: unknown.
    """

    upside_down: SignReading | None = None
    """Reading of the attitudes of static poses with the other sign; None: the sums are those of a run."""

    def __init__(
        self, sums: ConventionSums, declared: DeclaredRig, wrench: str, imu: str, *, upward: float = 0.0
    ) -> None:
        self.sums, self.declared, self.wrench, self.imu = sums, declared, wrench, imu
        self.recorded = sums
        self.upward = upward if abs(upward) > LEAST_GRAVITY else 0.0
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
            yield from self._axes(best_axes(self.sums, given))
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

    def at_rest(self, upside_down: SignReading) -> Iterator[Contradiction]:
        """The findings on static poses, whose force alone tells axes and signs.

        Args:
            upside_down: words and cure where the attitude has the other sign.
        """
        self.upside_down = upside_down
        by_force = _without_moment(self.sums)
        given = scales(by_force, weight=False)
        rotation = oblique_rotation(by_force, given, weighed=False)
        if rotation is not None:
            other = other_sign(by_force, rotation)
            yield self._rotated(rotation, "" if other is None else fits_as_well([self._sign_and_turn(other)]))
        elif explains(by_force, FORCE, given.force):
            yield from self._axes(best_axes(by_force, given, at_rest=True))

    # Axes and signs

    def _axes(self, fits: list[Hypothesis]) -> Iterator[Contradiction]:
        best, matrix = fits[0], fits[0].matrix
        self.sums = best.applied(self.sums)
        if best.sensor == "imu":
            yield Finding.IMU_MIRRORED.on(self.imu, axes=axes_text(matrix)[1:-1])
            return
        if best.accelerometer < 0 or np.array_equal(matrix, -np.eye(3)):
            yield self._sign(fits)
            matrix = matrix if _proper(matrix) else -matrix
        if not _proper(matrix):
            yield self._mirrored(fits)
        elif not np.array_equal(matrix, np.eye(3)):
            yield self._turned_axes(self.sums.turned(wrench=matrix.T), [replace(best, matrix=matrix), *fits[1:]])

    def _sign(self, fits: list[Hypothesis]) -> Contradiction:
        """Return the finding on signals of the other sign: the readings that fit and that no declaration refutes."""
        same = [fit for fit in fits if fit.sensor == "wrench" and np.allclose(abs(fit.matrix), abs(fits[0].matrix))]
        readings = [reading for fit in same for reading in self._sign_readings(fit)]
        readings, why = self._decided(list(dict.fromkeys(readings)))
        several = len(readings) > 1
        words = ", or ".join(f"{reading.words}{f' ({self._place(reading)})' * several}" for reading in readings)
        if readings[0].mirrored:
            self.sums = self.sums.mirrored(self.declared.wrench_point)
        fit = f"fit {'either' if len(readings) == 2 else 'each'}" if several else f"fit only so{why}"
        if several and len(same) == 1 and self.upside_down is None:
            fit += ", with the same tensor"
        decides = f"; {DECIDES if self.upside_down is None else DECIDES_AT_REST}" * several
        lines = ", or ".join(reading.cure for reading in readings) + "," * several
        return Finding.SIGN.on(
            self.imu if readings[0].downwards else self.wrench, words=words, by=self._by, fit=fit,
            doubt=self._rivals([f for f in fits[1:] if f not in same]), lines=lines, decides=decides,
        )  # fmt: skip

    def _sign_readings(self, fit: Hypothesis) -> list[SignReading]:
        """The signs that would make force, moment and specific force fit as a hypothesis does."""
        if self.upside_down is not None:
            return [WRENCH, self.upside_down, _alone("force", self.declared)]
        if fit.accelerometer > 0:
            return [WRENCH] * (not _proper(fit.matrix))
        if _proper(fit.matrix):
            return [DOWNWARDS, _alone("force", self.declared)]
        return [_alone("moment", self.declared), BOTH]

    def _decided(self, readings: list[SignReading]) -> tuple[list[SignReading], str]:
        """The readings that attitude and declared centre of gravity leave, and what refuted the others."""
        kept, why = readings, []
        if not self.declared.measured:
            kept = [reading for reading in kept if not reading.downwards] or kept
        elif self.upward:
            kept = [reading for reading in kept if reading.downwards == (self.upward < 0)] or kept
            why += ["the attitude"]
        mirrored, certain = self._mirrored_as_declared()
        if certain and any(reading.mirrored == mirrored for reading in kept):
            kept = [reading for reading in kept if reading.mirrored == mirrored]
            why += ["the declared centre of gravity"]
        kept.sort(key=lambda reading: mirrored is not None and reading.mirrored != mirrored)  # the likelier ones first
        return kept, f", by {' and '.join(why)}" * (len(kept) < len(readings) and bool(why))

    def _mirrored_as_declared(self) -> tuple[bool | None, bool]:
        """Whether the mirrored centre is nearer to the declared one, None where there is none; and if for certain."""
        if self.declared.r_cg is None:
            return None, False
        plain, mirrored = (self._shift(self.sums, mirrored=turned)[1] for turned in (False, True))
        return mirrored < plain, abs(plain - mirrored) > DECISIVE / 2

    def _place(self, reading: SignReading) -> str:
        """The centre of gravity by a reading."""
        centre = self.sums.centre
        r = 2 * self.declared.wrench_point - centre.r if reading.mirrored else centre.r
        sure = np.diag(centre.undetermined) < TOLD
        at = ", ".join(fixed(1e3 * x, 1) if known else "?" for x, known in zip(r, sure, strict=True))
        return f"centre of gravity at ({at}) mm"

    @property
    def _by(self) -> str:
        """Words for the signals that force and moment are compared with."""
        return "gravity and the motion" if self.upside_down is None else "the attitudes"

    def _rivals(self, fits: list[Hypothesis]) -> str:
        """Text on other axes of the wrench that fit as well."""
        return fits_as_well([self._wrench_cure(fit.matrix) for fit in fits if fit.sensor == "wrench"][:3])

    def _wrench_cure(self, matrix: Matrix) -> str:
        if np.array_equal(matrix, -np.eye(3)):
            return ON_SENSOR
        if _proper(matrix):
            return self._rotation_cure(self.recorded, matrix).rstrip(",")
        return f"{ON_SENSOR} and {self._rotation_cure(self.recorded, -matrix).rstrip(',')}"

    def _mirrored(self, fits: list[Hypothesis]) -> Contradiction:
        """Return the finding on axes that are left-handed, or turned and reversed."""
        turn = -fits[0].matrix
        # a left-handed cell is one reversed and turned by half a turn; any other turn may be the IMU's
        cell = f"wrench_rotation_to_body = {axes_text(turn @ self.declared.wrench_rotation)}"
        lines = cell if np.allclose(turn, turn.T) else self._rotation_cure(self.recorded, turn).rstrip(",")
        doubt = self._rivals(fits[1:])
        if self.upside_down is not None and self.declared.measured:
            imu = "; or the accelerometer's axes are left-handed, or its sign is reversed and its axes turned"
            doubt += f"{imu} ({self._place(WRENCH)}): {CHANNELS}"
        return Finding.WRENCH_MIRRORED.on(self.wrench, lines=lines, doubt=doubt)

    def _sign_and_turn(self, rotation: FreeRotation) -> str:
        """The lines that undo a rotation, and what is reversed besides."""
        return self._wrench_cure(rotation.reversed.matrix @ rotation.matrix.T)

    def _rotated(self, rotation: FreeRotation, doubt: str = "") -> Contradiction:
        """Any rotation, and what is reversed besides; ``doubt``: what fits as well."""
        before, undone = rotation.reversed.applied(self.sums), rotation.matrix.T
        return rotation_finding(rotation, *self._turned_back(before, undone), doubt)

    def _turned_back(self, before: ConventionSums, matrix: Matrix) -> tuple[str, str]:
        """Turn back the sensor that is turned, as far as known; return its topic, and the line or lines that do it."""
        turned = _either_turned(before, matrix)
        likelier, certain = self._turned_sensor(turned)
        self.sums = turned[likelier]
        if certain or self.upside_down is not None:
            return (self.wrench if likelier == "wrench" else self.imu), self._rotation_cure(before, matrix)
        as_imu, as_wrench = (tensor_about_centre(turned[sensor], self.declared.r_cg) for sensor in ("imu", "wrench"))
        lines = self._rotation_lines(matrix)
        return self.imu, rivals_text(lines["imu"], lines["wrench"], as_imu, as_wrench)

    def _rotation_cure(self, before: ConventionSums, matrix: Matrix) -> str:
        """The line that undoes a rotation, or the two lines where either sensor may be turned."""
        sensor, certain = self._turned_sensor(_either_turned(before, matrix))
        lines = self._rotation_lines(matrix)
        either = f"{lines['imu']} if the IMU is the rotated one, otherwise {lines['wrench']},"
        return lines[sensor] if certain else either

    def _rotation_lines(self, matrix: Matrix) -> dict[str, str]:
        """The line that undoes a rotation, by the sensor that is turned."""
        return {
            "imu": f"imu_rotation_to_body = {axes_text(matrix.T @ self.declared.imu_rotation)}",
            "wrench": f"wrench_rotation_to_body = {axes_text(matrix @ self.declared.wrench_rotation)}",
        }

    def _turned_sensor(self, turned: dict[str, ConventionSums]) -> tuple[str, bool]:
        """The sensor that is likelier turned, and whether the declared centre of gravity decides."""
        misfits = {sensor: self._shift(sums, drawn=DRAWN)[1] for sensor, sums in turned.items()}
        likelier, other = sorted(misfits, key=misfits.__getitem__)
        return likelier, misfits[other] - misfits[likelier] > DECISIVE / 2

    def _turned_axes(self, before: ConventionSums, fits: list[Hypothesis]) -> Contradiction:
        matrix = fits[0].matrix
        topic, cure = self._turned_back(before, matrix)
        rivals = [fit for fit in fits[1:4] if fit.sensor == "wrench" and not np.allclose(abs(fit.matrix), abs(matrix))]
        others = [axes_text(fit.matrix.T)[1:-1] for fit in rivals]
        doubt = f"; ({'), ('.join(others)}) fit as well" if others else ""
        if self.upside_down is not None:
            doubt = self._rivals(fits[1:])
        return Finding.OTHER_AXES.on(topic, axes=axes_text(matrix.T)[1:-1], doubt=doubt, lines=cure)

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
        body = body_of_run(self.sums, given, mass, sigma, by_motion=motion is not None)
        distance, where = self._elsewhere() or (np.inf, "")
        readings = other_units(body, self.declared, distance < FARTHEST)
        two_systems = bool(readings) and readings[0].cost == COSTS["two systems"]
        if two_systems and readings[0].force_factor == 1.0 and distance < FARTHEST:  # rarer than another point
            self.units_instead = [reading.lines() for reading in readings]
        elif readings:
            point = [f"wrench_point = [{where}]"] if readings[0].force_factor == 1.0 and distance < FARTHEST else []
            self.sums = readings[0].applied(self.sums)
            yield units_finding(body, readings, point, self.wrench)
        else:
            yield from mass_finding(mass, sigma, self.declared.mass, self.wrench)

    # Small turns, and the moment's point

    def _turned(self, given: Scales) -> Iterator[Contradiction]:
        turn, certainty, covariance = misalignment(self.sums, given)
        if certainty > CERTAIN_SHIFT and float(np.linalg.norm(turn)) > LEAST_TURN:
            topic, cure = self._turned_back(self.sums, exponential(turn).T)
            both = covariance + np.diag(self.declared.turn**2)
            if turn @ np.linalg.solve(both, turn) > CERTAIN_SHIFT:
                vector = small_turn_text(turn, covariance)
                yield Finding.TURNED_A_LITTLE.on(topic, turn=vector, lines=cure)

    def _shift(self, sums: ConventionSums, *, mirrored: bool = False, drawn: float = 1e-3) -> tuple[Vector, float]:
        """Return the shift from the centre of gravity that some sums show to the declared one [m], its chi-square.

        ``mirrored``: from that on the other side of the moment's point. ``drawn``: standard deviation of the declared
        one, beside the stated [m].
        """
        if self.declared.r_cg is None:
            return np.zeros(3), 0.0
        r = 2 * self.declared.wrench_point - sums.centre.r if mirrored else sums.centre.r
        shift = self.declared.r_cg - r
        shift = shift - sums.centre.undetermined @ shift
        covariance = sums.centre.covariance + np.diag(self.declared.sigma_r_cg**2) + drawn**2 * np.eye(3)
        return shift, float(shift @ np.linalg.solve(covariance, shift))

    def _point(self) -> Iterator[Contradiction]:
        place = self._elsewhere()
        if place is not None:
            distance, where = place
            unknown = "; the motion does not determine coordinates marked ?" * ("?" in where)
            figures = {"distance": 1e3 * distance, "where": where, "unknown": unknown}
            lines = [*self.units_instead, *self._moment_alone()]
            yield Finding.OTHER_POINT.on(self.wrench, doubt=fits_as_well(lines), **figures)

    def _moment_alone(self) -> list[str]:
        """The line that gives the moment alone the other sign, where this puts the centre of gravity as declared."""
        if self._shift(self.sums, mirrored=True)[1] > CERTAIN_SHIFT:
            return []
        given, other = scales(self.sums, weight=True), Hypothesis("wrench", -np.eye(3), 0.0, accelerometer=-1.0)
        worse = chi_square(other.applied(self.sums), given) - chi_square(self.sums, given)
        alone = _alone("moment", self.declared)
        return [f"{alone.cure} ({alone.words})"] if worse < EQUAL else []

    def _elsewhere(self) -> tuple[float, str] | None:
        """Distance [m] and coordinates of the point that the moment is about, if not Q, by the declared r_CG."""
        if self.declared.r_cg is None:
            return None
        shift, certainty = self._shift(self.sums)
        certain = np.diag(self.sums.centre.undetermined) < TOLD
        distance = float(np.linalg.norm(shift[certain]))
        if certainty < CERTAIN_SHIFT or distance < LEAST_SHIFT:
            return None
        point = zip(shift + self.declared.wrench_point, certain, strict=True)
        where = ", ".join(f'"{1e3 * x:.1f} mm"' if sure else "?" for x, sure in point)
        return distance, where
