"""Findings on attitude, gravity and the axes of the wrench, by the weight alone, gravity free along the axes at rest.

With specific force f, attitude R from B to axes at rest, a lever's part L b and the load cell's zero, least squares fit

    F = m f + Rᵀ p + L b + F0(t)

p is zero where all is as declared. Weight that a driver removed and gravity along other axes are each a vector p of
their own; a wrench along axes at rest fits only when R turns it back, an attitude written the other way only inverted.
Each reading of the recording has a fit; what fits as well as the best is told beside it. A run's zero may drift.
"""

from dataclasses import dataclass, field, replace
from functools import partial
from typing import Literal

import numpy as np
from jaxtyping import Float

from identify.judge.conventions.attitude_findings import ORDERS, order_entry, read_as
from identify.judge.conventions.axis_hypotheses import COSTS, DECISIVE, EQUAL
from identify.judge.conventions.carried_attitude import carried_attitude
from identify.judge.conventions.convention_fit import (
    SMOOTHING,
    STEP,
    WINDOW,
    DeclaredRig,
    ImuSignal,
    Vector,
    WrenchSignal,
    smoothed,
)
from identify.judge.conventions.findings.accelerometer_delay import AccelerometerLags
from identify.judge.conventions.findings.attitude import AttitudeReadOtherwise
from identify.judge.conventions.findings.frame import WrenchAtRest, WrenchTurns, ZeroAtRest
from identify.judge.conventions.findings.gravity import gravity_elsewhere, poses_upside_down
from identify.judge.conventions.findings.mass import changed_mass
from identify.judge.conventions.findings.weight import other_payload
from identify.judge.conventions.posed_force import (
    GravityFit,
    PosedForce,
    PosedMotion,
    Rotations,
    at_instants,
    lever_columns,
)
from identify.judge.conventions.removed_weight import LEAST_WEIGHT, MASS_OVER_SIGMA
from identify.judge.findings import Finding

Source = Literal["joints", "poses", "quaternion", "gyro"]
READINGS = {
    "gravity": "gravity along other axes at rest",
    "sensor": "a turn of the load cell's axes against the body's",
    "frame": "a wrench along axes at rest",
    "late": "an accelerometer that lags (accelerometer_delay)",
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

    findings: list[Finding] = field(default_factory=list)
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
    levers = lever_columns(time, omega)
    if not attitude.accelerates and attitude.gravity is not None:
        specific = -np.einsum("nji,j->ni", attitude.to_rest[within], attitude.gravity)
    force = at_instants(time, wrench.time, wrench.force)
    motion = PosedMotion(
        to_rest=attitude.to_rest[within], specific=specific, levers=levers, time=time, smooth=partial(smoothed, step),
        independent=STEP / WINDOW,
    )  # fmt: skip
    return _JudgedForce(PosedForce(force, motion), attitude, declared, topic, time).verdict()


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
            down = None if self.attitude.accelerates else self.attitude.gravity
            return GravityVerdict([] if down is None else poses_upside_down(plain, down, self.topic))
        if self.attitude.turned_back and posed.excess(posed.fit(zero=False), free) < EQUAL:  # p is the zero
            return GravityVerdict([ZeroAtRest(topic=self.topic, zero=free.lift)], final=True)
        other, yaw = self._other_frame()
        fits = {"plain": plain, "gravity": free, "sensor": posed.fit(lift=False, turned=True), "frame": other.fit()}
        fits |= {order: self._read_as(order).fit(lift=False) for order in self._orders}
        lag = 0.0
        if self.attitude.accelerates and self.declared.measured:
            (delayed, _), (late, lag) = (posed.in_time(apart=apart) for apart in (False, True))
            fits |= {"delay": delayed.fit(lift=False)} | ({"late": late.fit(lift=False)} if lag > 0 else {})
        best = min(fits.values(), key=lambda fit: fit.misfit)
        if not posed.explained(best):
            changed = changed_mass(posed, self.time, self.topic)
            return GravityVerdict(changed, final=bool(changed))
        scores = {name: posed.excess(fit, best) + COSTS["turned"] * (fit is not plain) for name, fit in fits.items()}
        least = min(scores.values())
        if scores["plain"] < least + DECISIVE:
            return GravityVerdict()
        likely = sorted((name for name in scores if scores[name] < least + EQUAL), key=scores.__getitem__)
        rivals = [READINGS.get(name, f"a quaternion of ({name})") for name in likely[1:]]
        doubt = f"; {' or '.join(rivals)} fits as well" if rivals else ""
        if "delay" in likely:  # which the estimate finds by itself, or names
            return GravityVerdict()
        if likely[0] == "late":
            return GravityVerdict([AccelerometerLags(topic=self.topic, lag=lag)], final=True)
        if likely[0] == "frame":
            return self._frame(yaw, doubt)
        if likely[0] in self._orders:
            how, settings = f"with the quaternion's fields read as ({likely[0]})", order_entry(likely[0], self.declared)
            read = AttitudeReadOtherwise(topic=self.topic, how=how, doubt=doubt, settings=[settings])
            return GravityVerdict([read], final=True)
        return self._gravity(free, doubt) if likely[0] == "gravity" else GravityVerdict()

    # Reading of the quaternion, from which poses have their angular velocity, too

    @property
    def _orders(self) -> tuple[str, ...]:
        return ORDERS[1:] if self.attitude.source == "poses" and not self.attitude.turned_back else ()

    def _read_as(self, order: str) -> PosedForce:
        motion = self.posed.motion
        to_rest = read_as(self.attitude.to_rest[: len(self.time)], order, self.declared)
        assert motion.specific is not None  # noqa: S101 - of a run it is known, or that of gravity
        at_rest = np.einsum("nij,nj->ni", motion.to_rest, motion.specific)
        specific = np.einsum("nji,nj->ni", to_rest, at_rest)
        return replace(self.posed, motion=replace(motion, to_rest=to_rest, specific=specific, levers=None))

    def _other_frame(self) -> tuple[PosedForce, float]:
        """The force along the axes of the other kind, and the yaw between axes at rest."""
        if self.attitude.turned_back:
            return self.posed.turned_to_rest(), 0.0
        yaw = self.posed.best_yaw()
        return self.posed.turned_back(yaw), yaw

    def _frame(self, yaw: float, doubt: str) -> GravityVerdict:
        if self.attitude.turned_back:
            return GravityVerdict([WrenchTurns(topic=self.topic, doubt=doubt)], final=True)
        recorded, rotation = self.attitude.source != "gyro", self.declared.wrench_rotation
        at_rest = WrenchAtRest(topic=self.topic, doubt=doubt, attitude_recorded=recorded, yaw=yaw, rotation=rotation)
        return GravityVerdict([at_rest], final=True)

    def _gravity(self, fit: GravityFit, doubt: str) -> GravityVerdict:
        gravity = self.attitude.gravity
        if gravity is None:
            return GravityVerdict()
        size = float(np.linalg.norm(gravity))
        weight = fit.lift - fit.mass * gravity  # upwards
        determined = self.attitude.accelerates and fit.mass > MASS_OVER_SIGMA * fit.sigma_mass
        mass = fit.mass if determined else self.declared.mass
        length, weighs = float(np.linalg.norm(weight)), float(-weight @ gravity) / size**2
        spread = self._spread(fit, gravity)
        if mass is not None and length < LEAST_WEIGHT * mass * size:
            return self._removed(mass, weighs, spread / size, doubt)
        lean = gravity_elsewhere(weight, gravity, spread, topic=self.topic, doubt=doubt)
        if lean is not None and self.attitude.source != "gyro":
            return GravityVerdict([lean], gravity=lean.gravity)
        if mass is not None and determined:
            return self._removed(mass, weighs, float(np.hypot(spread / size, fit.sigma_mass)), doubt)
        return GravityVerdict()

    def _spread(self, fit: GravityFit, declared: Vector) -> float:
        """Standard uncertainty of the weight across its direction, the largest [N]."""
        change = np.hstack([-declared[:, None], np.eye(3)])
        covariance = fit.covariance[:4, :4].copy()
        covariance[~np.isfinite(covariance)] = 0.0
        return float(np.sqrt(np.linalg.eigvalsh(change @ covariance @ change.T)[-1]))

    def _removed(self, mass: float, weighs: float, sigma: float, doubt: str) -> GravityVerdict:
        if self.attitude.source == "gyro" and weighs < LEAST_WEIGHT * mass:
            return GravityVerdict()  # how the weight was removed is told better where gravity hardly turns
        other = other_payload(self.declared, self.topic, mass=mass, weighs=weighs, sigma=sigma, doubt=doubt)
        return GravityVerdict(other, final=bool(other))
