"""Force and moment that the body needs on its motion, and how each unknown changes them.

Rows are measured less predicted wrench about Q. The specific force at the centre of gravity is the accelerometer's, or,
where the base turns about a point at rest, gravity's along the attitude with the acceleration of a lever; where neither
tells it, it is that of the measured force, and only moments about the centre of gravity say anything
(:func:`about_centre`).
"""

from dataclasses import dataclass, field
from functools import cached_property
from typing import Literal

import numpy as np
from jaxtyping import Float

from identify.joint.joint_model import SIZES
from identify.model_check.motion_signals import MotionSignals
from identify.rigid_body.inertia import unpack
from identify.rigid_body.regressor import OMEGA_R_OF_FEATURES, cross_matrices, cross_matrix, features

Force = Literal["still", "accelerometer", "none"]
"""Source of the specific force: a point at rest, the accelerometer, or the measured force."""
Columns = Float[np.ndarray, "n 6 p"]
Changes = Float[np.ndarray, "n 3 p"]


@dataclass(frozen=True)
class PredictedWrench:
    """The wrench at one value of the unknowns."""

    signals: MotionSignals
    x: dict[str, np.ndarray]
    """Unknowns of :class:`identify.joint.joint_model.Unknowns` by name, and ``up``: upward in B at the first node."""
    force_from: Force
    gravity: float
    imu_position: np.ndarray
    specific_force: Float[np.ndarray, "n 3"] = field(init=False)
    wrench: Float[np.ndarray, "n 6"] = field(init=False)
    """Force and moment about Q, without the load cell's errors."""

    def __post_init__(self) -> None:
        """Compute the prediction from the run's signals."""
        s, x = self.signals, self.x
        if self.force_from == "still":
            specific = (self.gravity + x["gravity"]) * self.up + s.levers @ x["cg_from_still"]
        elif self.force_from == "none":
            specific = (s.force - x["force_offset"]) / x["mass"]
        else:
            assert s.accelerometer is not None  # noqa: S101 - the caller chose it so
            specific = s.accelerometer - x["accelerometer_bias"] + s.levers @ (x["r_cg"] - self.imu_position)
        force = x["mass"] * specific
        moment = self.regressor @ x["inertia"] + np.cross(x["r_cg"], force)
        object.__setattr__(self, "specific_force", specific)
        object.__setattr__(self, "wrench", np.hstack([force, moment]))

    @cached_property
    def up(self) -> Float[np.ndarray, "n 3"]:
        """Upward direction in B at each row."""
        return np.asarray(self.x["up"] @ self.signals.turns)

    @cached_property
    def regressor(self) -> Float[np.ndarray, "n 3 6"]:
        """Regressor Omega_R of each row."""
        phi = features(self.signals.omega.T, self.signals.alpha.T)
        return np.asarray(np.einsum("kji,kn->nji", OMEGA_R_OF_FEATURES, phi, optimize=True))

    @property
    def residuals(self) -> Float[np.ndarray, "n 6"]:
        """Measured less predicted [N], [N·m]."""
        s, x = self.signals, self.x
        measured = np.hstack([s.force, s.moment])
        offset = np.concatenate([x["force_offset"], x["moment_offset"]])
        drift = np.outer(s.progress, np.concatenate([x["force_drift"], x["moment_drift"]]))
        return np.asarray(measured - offset - drift - self.wrench @ (np.eye(6) + x["cell_matrix"].reshape(6, 6)).T)

    def changed(
        self, omega: Changes | None, alpha: Changes | None, specific: Changes, *, turning: bool = False
    ) -> Columns:
        """Return what changes of the motion add to the wrench, (n, 6, p).

        Args:
            omega: of the angular velocity, (n, 3, p); None: none.
            alpha: of the angular acceleration.
            specific: of the specific force, beside what the two do to it.
            turning: whether the attitude follows the change of the angular velocity.
        """
        s, x = self.signals, self.x
        spin = np.zeros_like(specific)
        if omega is not None and alpha is not None:
            arm = x["cg_from_still"] if self.force_from == "still" else x["r_cg"] - self.imu_position
            tensor, by_arm = unpack(x["inertia"]), cross_matrix(arm)
            momentum, centripetal = cross_matrices(s.omega @ tensor), cross_matrices(np.cross(s.omega, arm))
            spin = tensor @ alpha + (s.spin @ tensor - momentum) @ omega
            specific = specific - by_arm @ alpha - (s.spin @ by_arm + centripetal) @ omega
            if turning and self.force_from == "still":
                turned = s.turns.transpose(0, 2, 1) @ s.turned(omega)
                specific = specific + self.gravity * (cross_matrices(self.up) @ turned)
        force = x["mass"] * specific
        return np.concatenate([force, spin + cross_matrix(x["r_cg"]) @ force], axis=1)

    def of(self, name: str) -> Columns:
        """Return the derivative of the wrench, offsets and load cell's errors included, by one unknown."""
        s, n, unit = self.signals, len(self.signals.t), np.eye(3)
        zero = np.zeros((n, 3, 3))
        on_axes = lambda signal: signal[:, :, None] * unit  # noqa: E731
        if name == "inertia":
            return np.concatenate([np.zeros((n, 3, 6)), self.regressor], axis=1)
        if name == "mass":
            f = self.specific_force
            return np.hstack([f, np.cross(self.x["r_cg"], f)])[:, :, None]
        if name == "r_cg":
            moved = self.changed(None, None, s.levers if self.force_from == "accelerometer" else zero)
            moved[:, 3:] -= cross_matrices(self.wrench[:, :3])
            return moved
        if name == "cg_from_still":
            return self.changed(None, None, s.levers if self.force_from == "still" else zero)
        if name == "gravity":
            return self.changed(None, None, self.up[:, :, None] * (self.force_from == "still"))
        if name == "accelerometer_bias":
            still = self.force_from == "still"
            return self.changed(None, None, zero if still else np.broadcast_to(-unit, (n, 3, 3)))
        if name == "start":
            turned = s.turns.transpose(0, 2, 1) @ cross_matrix(self.x["up"]) * (self.force_from == "still")
            return self.changed(None, None, -self.gravity * turned)
        if name in ("force_offset", "moment_offset", "force_drift", "moment_drift"):
            rows = np.zeros((n, 6, 3))
            first = 0 if name.startswith("force") else 3
            rows[:, first : first + 3] = unit if name.endswith("offset") else s.progress[:, None, None] * unit
            return rows
        if name == "cell_matrix":
            return np.einsum("ij,nk->nijk", np.eye(6), self.wrench).reshape(n, 6, 36)
        if name == "gyro_scale":
            return self.changed(-on_axes(s.omega), -on_axes(s.alpha), zero, turning=True)
        if name == "gyro_drift":
            slope = np.broadcast_to(-unit, (n, 3, 3)) * (s.progress * np.ptp(s.t))[:, None, None]
            return self.changed(slope, np.broadcast_to(-unit, (n, 3, 3)), zero, turning=True)
        if name == "rotation":
            omega, alpha = -s.spin, -cross_matrices(s.alpha)
            read = s.accelerometer if self.force_from == "accelerometer" else None
            turned = self.gravity * self.up if read is None else read
            specific = -cross_matrices(turned)
            if read is None:  # upward at the first node stays as it is, in B
                specific = specific + self.gravity * (s.turns.transpose(0, 2, 1) @ cross_matrix(self.x["up"]))
            return self.changed(omega, alpha, specific)
        if name == "delay":
            up = self.gravity * np.cross(self.up, s.omega)
            slope = up if self.force_from != "accelerometer" else s.accelerometer_slope
            assert slope is not None  # noqa: S101 - there is an accelerometer
            return self.changed(s.alpha[:, :, None], s.jerk[:, :, None], slope[:, :, None])
        raise KeyError(name)

    def of_slow(self, basis: Float[np.ndarray, "n k"]) -> Columns:
        """Return the derivative by slow errors of the gyro, three axes of each function of time, (n, 6, 3 k)."""
        omega = -np.einsum("nk,ij->nikj", basis, np.eye(3)).reshape(len(basis), 3, -1)
        return self.changed(omega, np.zeros_like(omega), np.zeros_like(omega), turning=True)


def about_centre(rows: Float[np.ndarray, "n 6 p"], r_cg: Float[np.ndarray, "3"]) -> Float[np.ndarray, "n 3 p"]:
    """Return the moment about the centre of gravity of wrenches about Q."""
    return np.asarray(rows[:, 3:] - cross_matrix(r_cg) @ rows[:, :3])


def zero_unknowns() -> dict[str, np.ndarray]:
    """Return all unknowns at zero."""
    return {name: np.zeros(size) for name, size in SIZES.items()}
