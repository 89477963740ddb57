"""What contradicts mechanics in a run, and the line of the experiment file that cures it.

Reversed signs, turned or mirrored axes, weight that is missing, units, a moment taken elsewhere: each is a hypothesis
that must explain the run better than 'as declared' by a factor of exp(30) in likelihood before it is named. What no
sensor tells is compared with what the experiment declares: mass, centre of gravity.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from rig.channels import ImuChannel, WrenchChannel
from rig.inspection import mechanics
from rig.inspection.axes import DECISIVE, Hypothesis, Scales, as_axes, best_axes, misalignment, rotation, scales
from rig.inspection.features import ALPHA, FORCE, MOMENT, SPECIFIC, Array, Features, features
from rig.inspection.suspicions import STANDARD_GRAVITY, Finding, wrong_units
from rig.inspection.weight import Body, Weight, weigh

FORCE_UNITS = {"lbf": 4.4482216, "kgf": 9.80665, "kN": 1000.0}  # N in the unit
MOMENT_UNITS = {"N*mm": 1e-3, "N*cm": 1e-2, "lbf*inch": 0.11298483, "lbf*ft": 1.3558179, "kgf*cm": 0.0980665}
MASS_TOLERANCE = 0.15  # departure of the rest force from the weight: a gain error or a zero is smaller
UNIT_TOLERANCE = 0.1  # departure of a ratio from that of a unit
LEAST_TURN = np.radians(0.5)
LEAST_GRAVITY = 2.0  # m/s² of mean specific force: in flight, or without accelerometer, nothing is judged
TURNED = 40.0  # chi-square of a small turn, on three degrees of freedom; 2e-8 by chance
LEAST_SHIFT = 3e-3  # metres
SHIFTED = 40.0  # chi-square of a centre of gravity elsewhere, likewise
UNEXPLAINED = 0.15  # of the changes, or three times white noise: more left over is no rigid body
ZERO_LEVER = 5e-3  # metres: times the weight, the moment that may be the load cell's zero


@dataclass(frozen=True, eq=False)
class Declared:
    """What the experiment says of the body and the rig; None: nothing. SI units, body frame, from Q.

    ``weighed``: whether the body's weight should be in the force, which it is not where the zero was taken with it.
    """

    mass: float | None = None
    r_cg: Array | None = None
    sigma_r_cg: Array | None = None
    imu_position: Array | None = None
    wrench_point: Array | None = None
    wrench_rotation: Array | None = None
    imu_rotation: Array | None = None
    weighed: bool = True


def detect(wrench: WrenchChannel, imu: ImuChannel, declared: Declared | None = None) -> list[Finding]:
    """Judge a run's wrench on the body and motion, both in the body frame and SI as far as declared.

    Args:
        wrench: force [N] and moment [N·m].
        imu: angular velocity [rad/s] and specific force [m/s²].
        declared: what else is known.
    """
    if min(len(wrench.stamp), len(imu.stamp)) < 10 or not _moving_clocks(wrench, imu):
        return []
    known = declared or Declared()
    sums = features(wrench, _in_si(imu, set(wrong_units(imu))))
    if sums is None or float(np.linalg.norm(sums.mean(SPECIFIC))) < LEAST_GRAVITY:
        return []
    if min(float(np.trace(sums.covariance(part))) for part in (FORCE, MOMENT, ALPHA)) < 1e-20:
        return []
    return list(_Case(sums, known, wrench.topic, imu.topic).findings())


def _moving_clocks(wrench: WrenchChannel, imu: ImuChannel) -> bool:
    """Whether both sensors have stamps that increase and overlap: otherwise there is nothing to compare."""
    return all(channel.stamp[-1] > channel.stamp[0] and (np.diff(channel.stamp) > 0).all() for channel in (wrench, imu))


def _in_si(imu: ImuChannel, wrong: set[str]) -> ImuChannel:
    acceleration = STANDARD_GRAVITY if "g" in wrong else 1.0
    rate = np.pi / 180 if "deg/s" in wrong else 1.0
    return replace(
        imu,
        angular_velocity=imu.angular_velocity * rate,
        linear_acceleration=imu.linear_acceleration * acceleration,
    )


class _Case:
    """One run on trial: each step puts right what it found before the next looks."""

    def __init__(self, sums: Features, known: Declared, wrench: str, imu: str) -> None:
        self.sums, self.known, self.wrench, self.imu = sums, known, wrench, imu

    def findings(self) -> Iterator[Finding]:
        """All findings, the gravest first."""
        weight = weigh(self.sums, self.known.mass)
        given = scales(self.sums, weight=self.known.weighed and not weight.missing)
        force, moment = self._explained(FORCE, given.force), self._explained(MOMENT, given.moment)
        if force or moment:
            yield from self._axes(best_axes(self.sums, given))
        if not self.known.weighed or not (force and moment):
            return
        if weight.missing:
            yield Finding("weight", self.wrench, f"{weight.reason}: {weight.cure(self.sums, given, self._body())}")
            return
        yield from self._units(weight)
        yield from self._partly_missing(weight, given)
        given = scales(self.sums, weight=True, terms=mechanics.MOMENT_TERMS)
        yield from self._turned(given)
        yield from self._point()

    def _explained(self, part: slice, left: float) -> bool:
        """Whether some rigid body, or white noise, explains force or moment: hands on the body are not judged."""
        white = self.sums.noise[part.start // 3] ** 2 * self.sums.white
        changes = float(np.trace(self.sums.covariance(part))) / 3
        return bool(left < max(9 * white, UNEXPLAINED**2 * changes))

    # Axes and signs

    def _axes(self, fits: list[Hypothesis]) -> Iterator[Finding]:
        best = fits[0]
        if np.array_equal(best.matrix, np.eye(3)):
            return
        before, self.sums = self.sums, best.applied(self.sums)
        if best.sensor == "imu":
            yield Finding(
                "mirror",
                self.imu,
                f"the IMU's axes are left-handed: only ({as_axes(best.matrix)[1:-1]}) of them fit the wrench: correct "
                "order and signs of its channels where they are recorded; no rotation in [recording] can",
            )
        elif np.array_equal(best.matrix, -np.eye(3)):
            yield Finding(
                "sign",
                self.wrench,
                "force and moment have the reversed sign: gravity and the motion fit only the wrench on the sensor: "
                'set wrench = "on_sensor" in [recording] ("on_body" where it says so already)',
            )
        elif np.linalg.det(best.matrix) < 0:
            yield self._mirrored_wrench(best)
        else:
            yield self._turned_axes(before, fits)

    def _mirrored_wrench(self, best: Hypothesis) -> Finding:
        turn = as_axes(self._compound(-best.matrix, self.known.wrench_rotation))
        return Finding(
            "mirror",
            self.wrench,
            f"the load cell's axes are left-handed, or its sign is reversed and its axes turned: both are undone by "
            f'wrench = "on_sensor" (the other one where it is declared) and wrench_rotation_to_body = {turn} in '
            "[recording]",
        )

    def _turned_axes(self, before: Features, fits: list[Hypothesis]) -> Finding:
        matrix = fits[0].matrix
        cell = f"wrench_rotation_to_body = {as_axes(self._compound(matrix, self.known.wrench_rotation))}"
        imu = f"imu_rotation_to_body = {as_axes(self._compound(matrix.T, self.known.imu_rotation))}"
        guilty = self._guilty(before, matrix)
        cure = {"wrench": cell, "imu": imu}.get(guilty, f"{imu} where the IMU is the one turned, or else {cell},")
        others = [as_axes(one.matrix.T)[1:-1] for one in fits[1:4] if one.sensor == "wrench"]
        doubt = f"; ({'), ('.join(others)}) fit as well" if others else ""
        return Finding(
            "axes",
            self.wrench if guilty == "wrench" else self.imu,
            "load cell and IMU have different axes: gravity and the motion fit in both only if the load cell's x, y, z "
            f"are the IMU's ({as_axes(matrix.T)[1:-1]}){doubt}: set {cure} in [recording]",
        )

    def _compound(self, matrix: Array, before: Array | None) -> Array:
        return matrix if before is None else matrix @ before

    def _guilty(self, before: Features, matrix: Array) -> str:
        """Which of the two is turned against the body, by the declared centre of gravity; '' where it does not tell."""
        if self.known.r_cg is None:
            return ""
        as_wrench, as_imu = self._misplaced(before.turned(wrench=matrix)), self._misplaced(before.turned(imu=matrix.T))
        if abs(as_wrench - as_imu) < DECISIVE / 2:
            return ""
        return "wrench" if as_wrench < as_imu else "imu"

    # Weight

    def _body(self) -> Body:
        """What is declared of the body; an IMU whose place is not declared is taken to be at Q."""
        r_cg, imu = (np.zeros(3) if r is None else r for r in (self.known.r_cg, self.known.imu_position))
        return Body(self.known.mass, self.known.r_cg, r_cg - imu)

    def _partly_missing(self, weight: Weight, given: Scales) -> Iterator[Finding]:
        """Where the force's changes tell the mass by themselves: is its offset that of a weight taken off?"""
        free = replace(given, offset=np.inf)
        fit = mechanics.solve(self.sums, mechanics.FORCE_TERMS, FORCE, variance=given.force, priors=free.priors)
        mass, sure = float(fit.values[0]), float(np.sqrt(fit.covariance[0, 0]))
        offset = fit.values[mechanics.OFFSET_AT]
        mean = self.sums.mean(SPECIFIC)
        part = float(-offset @ mean / (mean @ mean)) / mass if mass > 0 else 0.0
        if mass > 8 * sure and part > 0.5 + 3 * sure / mass:
            yield Finding(
                "weight",
                self.wrench,
                f"the force changes as that of some {mass:.2g} kg, but {part:.0%} of its weight is missing throughout: "
                f"{weight.cure(self.sums, given, self._body())}",
            )

    # Units

    def _units(self, weight: Weight) -> Iterator[Finding]:
        yield from self._force_unit(weight)
        before = self.sums
        if weight.too_light(before):
            self.sums = self.sums.scaled(MOMENT, MOMENT_UNITS["N*mm"])
            yield Finding(
                "unit",
                self.wrench,
                f"the moments are those of a body of {weight.density(before):.2g} kg/m^3, "
                'lighter than air: in N·mm? set moment_unit = "N*mm" in [recording]',
            )

    def _force_unit(self, weight: Weight) -> Iterator[Finding]:
        mass = self.known.mass
        if mass is None or abs(weight.mass - mass) < MASS_TOLERANCE * mass + weight.uncertainty:
            return
        ratio = mass / weight.mass
        margin = UNIT_TOLERANCE + weight.uncertainty / weight.mass
        unit = next((name for name, size in FORCE_UNITS.items() if abs(ratio / size - 1) < margin), None)
        text = f"the mean force is the weight of {weight.mass:.3g} kg, the declared mass is {mass:.3g} kg"
        if unit is None:
            yield Finding("mass", self.wrench, f"{text}: correct body.mass, force_unit or the load cell's calibration")
        else:
            self.sums = self.sums.scaled(FORCE, FORCE_UNITS[unit])
            yield Finding("unit", self.wrench, f'{text}: force in {unit}? set force_unit = "{unit}" in [recording]')

    # Small turns, and the moment's point

    def _turned(self, given: Scales) -> Iterator[Finding]:
        turn, chi_square = misalignment(self.sums, given)
        angle = float(np.linalg.norm(turn))
        if chi_square > TURNED and angle > LEAST_TURN:
            matrix = self._compound(rotation(turn), self.known.imu_rotation)
            self.sums = self.sums.turned(imu=rotation(turn))
            x, y, z = np.degrees(turn)
            yield Finding(
                "turned",
                self.imu,
                f"the IMU is turned against the load cell by ({x:.1f}, {y:.1f}, {z:.1f}) deg about x, y, z, or its "
                f"stamps are late: set imu_rotation_to_body = {as_axes(matrix)} in [recording], or correct the clock",
            )

    def _arm(self, sums: Features) -> mechanics.Arm:
        offset = ZERO_LEVER * float(np.linalg.norm(sums.mean(FORCE))) + sums.noise[1] / 2
        left = mechanics.variance_left(sums, mechanics.MOMENT_TERMS, MOMENT)
        return mechanics.arm(sums, force=mechanics.force_noise(sums), moment=left, offset=max(offset, 1e-9))

    def _misplaced(self, sums: Features, size: float = 1.0) -> float:
        """Chi-square of the declared centre of gravity against that which force and moment show."""
        shift, covariance = self._shift(self._arm(sums.scaled(MOMENT, size)))
        return float(shift @ np.linalg.solve(covariance, shift))

    def _shift(self, arm: mechanics.Arm) -> tuple[Array, Array]:
        sigma = np.zeros(3) if self.known.sigma_r_cg is None else self.known.sigma_r_cg
        assert self.known.r_cg is not None  # noqa: S101
        shift = self.known.r_cg - arm.r
        return shift - arm.blind @ shift, arm.covariance + np.diag(sigma**2) + 1e-6 * np.eye(3)

    def _point(self) -> Iterator[Finding]:
        if self.known.r_cg is None:
            return
        arm = self._arm(self.sums)
        shift, covariance = self._shift(arm)
        certain = np.diag(arm.blind) < 0.25
        chi_square = float(shift @ np.linalg.solve(covariance, shift))
        if chi_square < SHIFTED or float(np.linalg.norm(shift[certain])) < LEAST_SHIFT:
            return
        far = float(np.linalg.norm(self.known.r_cg[certain])) > LEAST_SHIFT
        for name, size in MOMENT_UNITS.items() if far else ():
            if self._misplaced(self.sums, size) < chi_square / 10:
                yield Finding(
                    "unit",
                    self.wrench,
                    f"force and moment put the centre of gravity {1 / size:.4g} times as far from Q as declared: "
                    f'set moment_unit = "{name}" in [recording]',
                )
                return
        point = shift if self.known.wrench_point is None else shift + self.known.wrench_point
        where = ", ".join(f'"{1e3 * x:.1f} mm"' if sure else "?" for x, sure in zip(point, certain, strict=True))
        unknown = "" if certain.all() else "; what is ? the motion does not tell"
        yield Finding(
            "point",
            self.wrench,
            f"force and moment put the centre of gravity {1e3 * np.linalg.norm(shift[certain]):.1f} mm from the "
            f"declared one: moment taken at another point than Q? set wrench_point = [{where}] in [recording]"
            f"{unknown}, or correct body.r_cg_from_q",
        )
