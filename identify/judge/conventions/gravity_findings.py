"""Findings on attitude, gravity and the axes of the wrench, by the weight alone, gravity free along the axes at rest.

With specific force f, attitude R from B to axes at rest, a lever's part L b and the load cell's zero, least squares fit

    F = m f + Rᵀ p + L b + F0(t)

p is zero where all is as declared. Weight that a driver removed and gravity along other axes are each a vector p of
their own; a wrench along axes at rest fits only when R turns it back, an attitude written the other way only inverted.
Each reading of the recording has a fit; what fits as well as the best is told beside it. A run's zero may drift.
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Literal, NamedTuple

import numpy as np
from jaxtyping import Float

from identify.judge.conventions.attitude_findings import ORDERS, order_cure, read_as
from identify.judge.conventions.axis_hypotheses import COSTS, DECISIVE, EQUAL
from identify.judge.conventions.convention_fit import (
    LEAST_MISFIT,
    NOT_RIGID,
    SMOOTHING,
    STEP,
    WINDOW,
    DeclaredRig,
    ImuSignal,
    Vector,
    WrenchSignal,
    carried_attitude,
    drift_shapes,
    smoothed,
)
from identify.judge.conventions.free_rotation import COVERAGE, axes_text
from identify.judge.conventions.removed_weight import CERTAIN, LEAST_WEIGHT, MASS_OVER_SIGMA
from identify.judge.findings import Contradiction, Finding
from identify.rigid_body.regressor import FIRST_MOMENT_OF_FEATURES, features
from identify.rigid_body.rotation import exponential
from identify.rounding import fixed, with_uncertainty

YAWS = 3600
"""Turns about the vertical that are tried where the axes at rest are not those of the wrench.

Numerical: a tenth of a degree apart.
"""

RIDGE = 1e-9
"""Part of the normal matrix that keeps the mass of a single sample determined.

Numerical: rounding of doubles in the solution.
"""

LIFT, ZERO = slice(1, 4), slice(4, 7)
"""Places of p and the zero among the columns of a fit, behind the mass's."""

Rotations = Float[np.ndarray, "n 3 3"]
Smooth = Callable[[np.ndarray], np.ndarray]
"""Filter over the samples, first, of some columns."""


def unchanged(values: np.ndarray) -> np.ndarray:
    """Return the samples as they are: of static poses."""
    return values


@dataclass(frozen=True, eq=False)
class GravityFit:
    """The unknowns of one reading, and what it leaves."""

    values: Float[np.ndarray, " p"]
    """Mass m [kg], p [N], then zero and lever; m is zero where no specific force is given."""
    covariance: Float[np.ndarray, "p p"]
    misfit: float
    """Mean square of what is left of the force, per component [N²]."""

    @property
    def mass(self) -> float:
        """Mass by the specific force [kg]."""
        return float(self.values[0])

    @property
    def sigma_mass(self) -> float:
        """Standard uncertainty of the mass [kg]; infinite where no specific force tells it."""
        return float(np.sqrt(self.covariance[0, 0]))

    @property
    def lift(self) -> Float[np.ndarray, "3"]:
        """The vector p [N]."""
        return self.values[1:4]


class MassStep(NamedTuple):
    """A mass that is another from some sample on."""

    sample: int
    """Index of the first smoothed sample with the other mass."""
    before: float
    """Mass before it [kg]."""
    after: float
    """Mass from it on [kg]."""
    misfit: float
    """Mean square of what is left of the force, per component [N²]."""


@dataclass(frozen=True, eq=False)
class PosedForce:
    """Forces with attitudes, n samples, all in B and SI."""

    force: Float[np.ndarray, "n 3"]
    to_rest: Rotations
    """Rotations R from B to axes at rest."""
    specific: Float[np.ndarray, "n 3"] | None = None
    """Specific force [m/s²]; None: not known, or of poses at rest, where R tells it."""
    levers: Float[np.ndarray, "n 3 3"] | None = None
    """Specific force of a lever's unit vectors [1/s²]; None: at rest."""
    time: Float[np.ndarray, " n"] | None = None
    """Instants over which the zero may drift [s]; None: it is constant."""
    smooth: Smooth = unchanged
    independent: float = 1.0
    """Part of the smoothed samples that are independent."""

    def turned_back(self, yaw: float) -> "PosedForce":
        """The force as it would be in B, had it been recorded along axes at rest, turned by a yaw from R's."""
        return self._turned_back(np.array([[np.cos(yaw), -np.sin(yaw), 0], [np.sin(yaw), np.cos(yaw), 0], [0, 0, 1]]))

    def _turned_back(self, turn: np.ndarray) -> "PosedForce":
        return replace(self, force=np.einsum("nji,nj->ni", self.to_rest, self.force @ turn.T))

    def turned_to_rest(self) -> "PosedForce":
        """The force along axes at rest, as it was recorded where it was turned back by mistake."""
        return replace(self, force=np.einsum("nij,nj->ni", self.to_rest, self.force))

    @cached_property
    def _answer(self) -> np.ndarray:
        return self.smooth(self.force)

    @property
    def changes(self) -> float:
        """Variance of the smoothed force, per component [N²]."""
        return float(self._answer.var(axis=0).mean())

    @property
    def independent_values(self) -> float:
        """Number of independent components of force."""
        return self.independent * self._answer.size

    def explained(self, fit: "GravityFit | MassStep") -> bool:
        """Whether a rigid body explains the force, so that something may be named."""
        return fit.misfit < NOT_RIGID**2 * self.changes

    def excess(self, fit: GravityFit, best: GravityFit) -> float:
        """Chi-square of a fit over that of the best one."""
        variance = max(best.misfit, LEAST_MISFIT**2 * self.changes)
        return (fit.misfit - best.misfit) * self.independent_values / variance

    def fit(self, *, lift: bool = True, zero: bool = True, turned: bool = False) -> GravityFit:
        """Fit the force.

        Args:
            lift: whether p is free, otherwise zero.
            zero: whether the load cell's zero F0 is free, beside its drift.
            turned: whether the specific force may also be turned and stretched, by a free matrix instead of m.
        """
        rows, answer = self._rows(lift, zero, turned), self._answer.reshape(-1)
        values, _, rank, _ = np.linalg.lstsq(rows, answer, rcond=1e-9)
        misfit = float(np.mean((answer - rows @ values) ** 2))
        free = max(1 - rank / self.independent_values, 0.1)
        variance = max(misfit / free, LEAST_MISFIT**2 * self.changes)
        covariance = variance / self.independent * np.linalg.pinv(rows.T @ rows, rcond=1e-12, hermitian=True)
        if self.specific is None:
            covariance[0, 0] = np.inf
        return GravityFit(values, covariance, misfit)

    @cached_property
    def _columns(self) -> np.ndarray:
        """Smoothed columns of m, p, zero and lever, (k, 3, columns)."""
        n = len(self.force)
        specific = np.zeros((n, 3)) if self.specific is None else self.specific
        levers = np.zeros((n, 3, 0)) if self.levers is None else self.levers
        zero = np.broadcast_to(np.eye(3), (n, 3, 3))
        return self._smooth(np.concatenate([specific[:, :, None], self.to_rest.swapaxes(1, 2), zero, levers], axis=2))

    @cached_property
    def _drift(self) -> np.ndarray:
        """Smoothed columns of each zero's drift, (k, 3, columns)."""
        shapes = np.zeros((len(self.force), 0)) if self.time is None else drift_shapes(self.time)
        return np.kron(self.smooth(shapes)[:, None], np.eye(3))

    def _smooth(self, columns: np.ndarray) -> np.ndarray:
        return self.smooth(columns.reshape(len(columns), -1)).reshape(-1, 3, columns.shape[2])

    def _rows(self, lift: bool, zero: bool, turned: bool) -> np.ndarray:
        """Rows of a fit, what is not free as zeros; ``turned``: with nine columns of a matrix on the specific force."""
        columns = self._columns.copy()
        columns[:, :, LIFT] *= lift
        columns[:, :, ZERO] *= zero
        columns = np.concatenate([columns, self._drift], axis=2)
        if turned and self.specific is not None:
            matrix = np.einsum("ij,nk->nijk", np.eye(3), self.specific).reshape(-1, 3, 9)
            columns = np.concatenate([columns, self._smooth(matrix)], axis=2)
        return columns.reshape(-1, columns.shape[2])

    def mass_step(self) -> MassStep:
        """Fit the force by the load cell's zero and a mass with its lever, both of which change once."""
        rows, unit = np.delete(self._columns, np.r_[LIFT, ZERO], axis=2), np.eye(3)
        count = rows.shape[2]
        answer, n = self._answer, len(rows)
        grams = np.einsum("nij,nik->njk", rows, rows)
        loose = RIDGE * grams.sum(axis=0) * np.eye(count)
        normal, right = np.zeros((n - 1, 2 * count + 3, 2 * count + 3)), np.zeros((n - 1, 2 * count + 3))
        normal[:, -3:, -3:], right[:, -3:] = n * unit, answer.sum(axis=0)
        products = np.einsum("nij,ni->nj", rows, answer)
        totals = [np.cumsum(values, axis=0) for values in (grams, rows, products)]
        parts = [x[:-1] for x in totals], [x[-1] - x[:-1] for x in totals]
        for place, (gram, total, product) in zip((0, count), parts, strict=True):
            here = slice(place, place + count)
            normal[:, here, here], right[:, here] = gram + loose, product
            normal[:, -3:, here], normal[:, here, -3:] = total, total.swapaxes(1, 2)
        values = np.linalg.solve(normal, right[:, :, None])[:, :, 0]
        misfit = ((answer**2).sum() - (right * values).sum(axis=1)) / answer.size
        at = int(np.argmin(misfit))
        return MassStep(at + 1, float(values[at, 0]), float(values[at, count]), float(misfit[at]))

    def best_yaw(self) -> float:
        """The yaw from R's axes at rest to those of the wrench under which the force, turned back, fits best [rad]."""
        # the force turned back is linear in (cos, sin, 1) of the yaw, and so is what the rows leave of it
        turns = np.diag([1.0, 1, 0]), np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 0]]), np.diag([0.0, 0, 1])
        answers = np.stack([self._turned_back(turn)._answer.reshape(-1) for turn in turns], axis=1)
        rows = self._rows(lift=True, zero=True, turned=False)
        values, *_ = np.linalg.lstsq(rows, answers, rcond=1e-9)
        residuals = answers - rows @ values
        yaws = np.linspace(-np.pi, np.pi, YAWS, endpoint=False)
        directions = np.stack([np.cos(yaws), np.sin(yaws), np.ones(YAWS)])
        misfits = np.einsum("ik,ij,jk->k", directions, residuals.T @ residuals, directions)
        return float(yaws[int(np.argmin(misfits))])


LEAST_ANGLE = np.radians(3.0)
"""Angle between the weight and the declared gravity from which another gravity is named.

Choice: a smaller lean is the estimate's own warning.
"""
LEAST_SHARE = 0.1
"""Part of the mass that the weight must lack or have too much to be named.

Choice: gain and mass together are better.
"""
LEAST_YAW = np.radians(3.0)
"""Turn about the vertical from which the axes of the wrench are not those of the attitude.

Choice: bases are set up to a degree or two.
"""
HANDLING = 0.5
"""Time about the change of a mass that is left to the gripper [s].

Choice: grippers close in less.
"""
AXIS = np.radians(0.3)
"""Angle within which, beside its uncertainty, gravity lies along an axis.

Choice: a plumb line is no better.
"""

Source = Literal["joints", "poses", "quaternion", "gyro"]
READINGS = {
    "gravity": "gravity along other axes at rest",
    "sensor": "a turn of the load cell's axes against the body's",
    "frame": "a wrench along axes at rest",
}
"""Words for the readings, where one is a rival of another."""


@dataclass(frozen=True, eq=False)
class AttitudeSignal:
    """The attitude of the body at n instants, and what is declared of it."""

    to_rest: Rotations
    """Rotations from B to axes at rest."""
    gravity: Vector | None
    """Gravity along these axes, as declared [m/s²]; None: by the accelerometer."""
    source: Source
    accelerates: bool = True
    """Whether the specific force is known, not only gravity."""
    turned_back: bool = False
    """Whether the wrench was declared along axes at rest, and turned back already."""
    zero_at_rest: bool = False
    """Whether the load cell's zero was declared constant along the axes at rest."""
    up: Vector = field(default_factory=lambda: np.array([0.0, 0.0, 1.0]))
    """Upward direction along the axes at rest, as declared or by convention."""

    def upward(self, specific_force: Float[np.ndarray, "n 3"]) -> float:
        """Return the upward component of a specific force in B, its mean [m/s²]."""
        return float(np.einsum("i,nij,nj->n", self.up, self.to_rest, specific_force).mean())


@dataclass(frozen=True, eq=False)
class GravityVerdict:
    """Findings by the weight, and how the signals are to be read after them."""

    findings: list[Contradiction] = field(default_factory=list)
    gravity: Vector | None = None
    """Gravity along the axes at rest as the weight shows it [m/s²]; None: as declared."""
    final: bool = False
    """Whether nothing else can be judged before this is cured."""


LONGEST = 300.0
"""Seconds of a run that are judged.

Choice: memory; more tell nothing new of the axes.
"""


def run_gravity(
    wrench: WrenchSignal, imu: ImuSignal, attitude: AttitudeSignal | None, declared: DeclaredRig, topic: str
) -> GravityVerdict:
    """Judge the force of a recorded run; without an attitude by that of gyro and accelerometer.

    Args:
        wrench: in B and SI.
        imu: the same.
        attitude: at the IMU's instants, and what is declared of it.
        declared: of body and rig.
        topic: of the load cell.
    """
    step = float(np.median(np.diff(imu.time)))
    within = slice(0, int(LONGEST / step))
    time, omega, specific = imu.time[within], imu.angular_velocity[within], imu.specific_force[within]
    if not np.isfinite(np.hstack([omega, specific])).all() or not 0 < step <= SMOOTHING:
        return GravityVerdict()
    if attitude is None:
        up = np.array([0.0, 0.0, -float(np.median(np.linalg.norm(specific, axis=1)))])
        attitude = AttitudeSignal(carried_attitude(step, omega, specific), up, "gyro")
    levers = np.einsum("kn,kij->nij", features(omega.T, np.gradient(omega, time, axis=0).T), FIRST_MOMENT_OF_FEATURES)
    if not attitude.accelerates and attitude.gravity is not None:
        specific = -np.einsum("nji,j->ni", attitude.to_rest[within], attitude.gravity)
    force = np.stack([np.interp(time, wrench.time, column) for column in wrench.force.T], axis=1)
    posed = PosedForce(
        force=force, to_rest=attitude.to_rest[within], specific=specific,
        levers=levers, time=time, smooth=partial(smoothed, step), independent=STEP / WINDOW,
    )  # fmt: skip
    return _JudgedForce(posed, attitude, declared, topic, time).verdict()


class _JudgedForce:
    def __init__(
        self, posed: PosedForce, attitude: AttitudeSignal, declared: DeclaredRig, topic: str, time: np.ndarray
    ) -> None:
        self.posed, self.attitude, self.declared, self.topic, self.time = posed, attitude, declared, topic, time
        self.plain, self.free = posed.fit(lift=False), posed.fit()

    def verdict(self) -> GravityVerdict:
        """The finding on the most likely reading, and what fits as well."""
        if self.attitude.zero_at_rest:  # it takes up whatever gravity would show
            return GravityVerdict(final=True)
        posed, plain, free = self.posed, self.plain, self.free
        if posed.changes <= 0 or (posed.explained(plain) and posed.excess(plain, free) <= DECISIVE):
            return self._upside_down()
        if self.attitude.turned_back and posed.excess(posed.fit(zero=False), free) < EQUAL:  # p is the zero
            text = ", ".join(fixed(value, 1) for value in free.lift)
            return GravityVerdict([Finding.ZERO_AT_REST.on(self.topic, zero=text)], final=True)
        other, yaw = self._other_frame()
        fits = {"plain": plain, "gravity": free, "sensor": posed.fit(lift=False, turned=True), "frame": other.fit()}
        fits |= {order: self._read_as(order).fit(lift=False) for order in self._orders}
        best = min(fits.values(), key=lambda fit: fit.misfit)
        if not posed.explained(best):
            return self._changed_mass()
        scores = {name: posed.excess(fit, best) + COSTS["turned"] * (fit is not plain) for name, fit in fits.items()}
        least = min(scores.values())
        if scores["plain"] < least + DECISIVE:
            return GravityVerdict()
        likely = sorted((name for name in scores if scores[name] < least + EQUAL), key=scores.__getitem__)
        rivals = [READINGS.get(name, f"a quaternion of ({name})") for name in likely[1:]]
        doubt = f"; {' or '.join(rivals)} fits as well" if rivals else ""
        if likely[0] == "frame":
            return self._frame(yaw, doubt)
        if likely[0] in self._orders:
            how, lines = f"with the quaternion's fields read as ({likely[0]})", order_cure(likely[0], self.declared)
            read = Finding.ATTITUDE_READ_OTHERWISE.on(self.topic, how=how, doubt=doubt, lines=lines)
            return GravityVerdict([read], final=True)
        return self._gravity(free, doubt) if likely[0] == "gravity" else GravityVerdict()

    # Reading of the quaternion, from which poses have their angular velocity, too

    @property
    def _orders(self) -> tuple[str, ...]:
        return ORDERS[1:] if self.attitude.source == "poses" and not self.attitude.turned_back else ()

    def _read_as(self, order: str) -> PosedForce:
        to_rest, as_read = read_as(self.attitude.to_rest[: len(self.time)], order, self.declared), self.posed.to_rest
        assert self.posed.specific is not None  # noqa: S101 - of a run it is known, or that of gravity
        at_rest = np.einsum("nij,nj->ni", as_read, self.posed.specific)
        specific = np.einsum("nji,nj->ni", to_rest, at_rest)
        return replace(self.posed, to_rest=to_rest, specific=specific, levers=None)

    def _other_frame(self) -> tuple[PosedForce, float]:
        """The force along the axes of the other kind, and the yaw between axes at rest."""
        if self.attitude.turned_back:
            return self.posed.turned_to_rest(), 0.0
        yaw = self.posed.best_yaw()
        return self.posed.turned_back(yaw), yaw

    def _frame(self, yaw: float, doubt: str) -> GravityVerdict:
        if self.attitude.turned_back:
            return GravityVerdict([Finding.WRENCH_TURNS.on(self.topic, doubt=doubt)], final=True)
        lines = 'set wrench_frame = "base" in [recording]'
        if abs(yaw) > LEAST_YAW:
            turn = exponential(np.array([0.0, 0.0, self._near_right_angle(yaw)]))
            axes = axes_text(np.round(turn @ self.declared.wrench_rotation, 9))
            lines = lines.replace("in [rec", f"and wrench_rotation_to_body = {axes} in [rec")
        if self.attitude.source == "gyro":
            lines = (
                "record joint states, poses or a quaternion, which turn it back with wrench_frame = "
                '"base" in [recording], or the wrench in the sensor\'s frame'
            )
        return GravityVerdict([Finding.WRENCH_AT_REST.on(self.topic, doubt=doubt, lines=lines)], final=True)

    def _near_right_angle(self, yaw: float) -> float:
        right = np.pi / 2 * round(yaw / (np.pi / 2))
        return float(right if abs(yaw - right) < LEAST_YAW else yaw)

    def _changed_mass(self) -> GravityVerdict:
        """The body was grasped or put down midway, where that explains what no single body does."""
        step = self.posed.mass_step()
        if not self.posed.explained(step):
            return GravityVerdict()
        at = float(self.posed.smooth(self.time[:, None])[step.sample, 0])
        grasped = step.after > step.before
        option = f"--from {at + HANDLING:.1f}" if grasped else f"--to {at - HANDLING:.1f}"
        masses = {"before": fixed(step.before, 2), "after": fixed(step.after, 2)}
        found = Finding.CHANGED_MASS.on(self.topic, time=fixed(at, 1), option=option, **masses)
        return GravityVerdict([found], final=True)

    def _gravity(self, fit: GravityFit, doubt: str) -> GravityVerdict:
        gravity = self.attitude.gravity
        if gravity is None:
            return GravityVerdict()
        size = float(np.linalg.norm(gravity))
        down = gravity / size
        weight = fit.lift - fit.mass * gravity  # upwards
        determined = self.attitude.accelerates and fit.mass > MASS_OVER_SIGMA * fit.sigma_mass
        mass = fit.mass if determined else self.declared.mass
        length = float(np.linalg.norm(weight))
        angle = float(np.arctan2(np.linalg.norm(np.cross(weight, down)), -weight @ down))
        spread = self._spread(fit, gravity) / max(length, 1e-12)
        if mass is not None and length < LEAST_WEIGHT * mass * size:
            return self._removed(mass, float(-weight @ down) / size, spread * length / size, doubt)
        if angle > max(LEAST_ANGLE, CERTAIN * spread) and self.attitude.source != "gyro":
            shown = along_axis(-weight / length, 3 * spread) * size
            degrees = with_uncertainty(np.degrees(angle), COVERAGE * np.degrees(spread))
            lean = Finding.GRAVITY_ELSEWHERE.on(self.topic, angle=degrees, gravity=gravity_text(shown), doubt=doubt)
            return GravityVerdict([lean], gravity=shown)
        if mass is not None and determined:
            sigma = float(np.hypot(spread * length / size, fit.sigma_mass))
            return self._removed(mass, float(-weight @ down) / size, sigma, doubt)
        return GravityVerdict()

    def _upside_down(self) -> GravityVerdict:
        """The weight as declared, but for its sign, which only acceleration tells from that of the wrench."""
        down = self.attitude.gravity
        if self.attitude.accelerates or down is None or self.plain.mass > -CERTAIN * self.plain.sigma_mass:
            return GravityVerdict()
        return GravityVerdict([Finding.POSES_UPSIDE_DOWN.on(self.topic, gravity=gravity_text(-down))])

    def _spread(self, fit: GravityFit, declared: Vector) -> float:
        """Standard uncertainty of the weight across its direction, the largest [N]."""
        change = np.hstack([-declared[:, None], np.eye(3)])
        covariance = fit.covariance[:4, :4].copy()
        covariance[~np.isfinite(covariance)] = 0.0
        return float(np.sqrt(np.linalg.eigvalsh(change @ covariance @ change.T)[-1]))

    def _removed(self, mass: float, weighs: float, sigma: float, doubt: str) -> GravityVerdict:
        """A part of the weight, or all of it, is missing in the force, or there is too much.

        Args:
            mass: by the motion, or as declared [kg].
            weighs: mass whose weight is in the force [kg].
            sigma: standard uncertainty of their difference [kg].
            doubt: what explains the force as well.
        """
        declared, missing = self.declared, mass - weighs
        if abs(missing - (0.0 if declared.weighed else declared.removed)) < max(LEAST_SHARE * mass, CERTAIN * sigma):
            return GravityVerdict()
        if self.attitude.source == "gyro" and weighs < LEAST_WEIGHT * mass:
            return GravityVerdict()  # how the weight was removed is told better where gravity hardly turns
        removed = missing + declared.removed * declared.weighed
        amounts = {"weighs": weighs, "mass": mass, "removed": removed}
        figures = {name: with_uncertainty(value, COVERAGE * sigma) for name, value in amounts.items()}
        other_payload = Finding.WEIGHT_OF_ANOTHER_PAYLOAD.on(self.topic, doubt=doubt, **figures)
        return GravityVerdict([other_payload], final=True)


def along_axis(down: Vector, spread: float) -> Vector:
    """The direction, or the axis that it lies along within its uncertainty."""
    axis = np.zeros(3)
    k = int(np.argmax(np.abs(down)))
    axis[k] = np.sign(down[k])
    return axis if float(np.linalg.norm(np.cross(axis, down))) < np.sin(AXIS + spread) else down


def gravity_text(gravity: Vector) -> str:
    """Return the components of gravity as an experiment file has them."""
    return ", ".join(f'"{value:.3f} m/s^2"' for value in np.round(gravity, 3) + 0.0)
