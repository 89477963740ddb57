"""Force and moment that the body needs on its motion, and how each unknown changes them.

Rows are measured less predicted wrench about Q. Where nothing tells the specific force at the centre of gravity, it is
that of the measured force, and only moments about the centre of gravity say anything (:func:`about_centre`).
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from jaxtyping import Float

from identify.estimation.joint.joint_model import Model, SpecificForce, unknowns
from identify.estimation.joint.motion_signals import MotionSignals
from identify.rigid_body.inertia import unpack
from identify.rigid_body.regressor import OMEGA_R_OF_FEATURES, cross_matrices, cross_matrix, features

Columns = Float[np.ndarray, "n 6 p"]
Changes = Float[np.ndarray, "n 3 p"]


@dataclass(frozen=True, eq=False)
class PredictedWrench:
    """The wrench of the rows that count, at one value of the unknowns; samples first, in B, SI units."""

    model: Model
    theta: Float[np.ndarray, " count"]
    """Unknowns in the order of :data:`identify.estimation.joint.joint_model.SLICES`."""

    def __reduce__(self) -> tuple[type["PredictedWrench"], tuple[Model, np.ndarray]]:
        """Go to another process without what is computed from the two."""
        return PredictedWrench, (replace(self.model), self.theta)

    @cached_property
    def x(self) -> dict[str, np.ndarray]:
        """Unknowns by name."""
        return dict(unknowns(self.theta))

    @cached_property
    def signals(self) -> MotionSignals:
        """The measured motion."""
        return MotionSignals(self.model, self.x)

    @property
    def force_from(self) -> SpecificForce:
        """Source of the specific force."""
        return self.model.specific_force

    @property
    def quantity(self) -> str:
        """Words for the rows that count."""
        return "the moment" if self.force_from == "none" else "force and moment"

    @property
    def gravity(self) -> float:
        """Local gravity as it is [m/s²]."""
        return float(self.model.gravity + self.x["gravity"][0])

    @cached_property
    def arm(self) -> Float[np.ndarray, "3"]:
        """The centre of gravity from the point whose specific force is known [m]."""
        still, read = self.x["cg_from_still"], self.x["r_cg"] - self.model.imu_position
        return {"still": still, "accelerometer": read, "none": np.zeros(3)}[self.force_from]

    @cached_property
    def specific_force(self) -> Float[np.ndarray, "n 3"]:
        """Specific force at the centre of gravity [m/s²]."""
        s, x = self.signals, self.x
        if self.force_from == "none":
            return (s.force - self._zero("force")) / x["mass"]
        return np.asarray(self.at_known_point + s.levers @ self.arm)

    @cached_property
    def at_known_point(self) -> Float[np.ndarray, "n 3"]:
        """Specific force at the point where it is known: at rest, or at the accelerometer; zero where there is none."""
        s = self.signals
        if self.force_from == "none":
            return np.zeros_like(s.omega)
        return self.gravity * s.up if self.force_from == "still" else s.accelerometer

    @cached_property
    def wrench(self) -> Float[np.ndarray, "n 6"]:
        """Force and moment about Q, without the load cell's errors."""
        force = self.x["mass"] * self.specific_force
        moment = self.regressor @ self.x["inertia"] + np.cross(self.x["r_cg"], force)
        return np.hstack([force, moment])

    @cached_property
    def regressor(self) -> Float[np.ndarray, "n 3 6"]:
        """Regressor Omega_R of each row."""
        phi = features(self.signals.omega.T, self.signals.alpha.T)
        return np.asarray(np.einsum("kji,kn->nji", OMEGA_R_OF_FEATURES, phi, optimize=True))

    @cached_property
    def residuals(self) -> Float[np.ndarray, "n 6"]:
        """Measured less predicted [N], [N·m].

        The load cell's matrix acts on what is predicted: on what is measured it would scale the noise, too, which a fit
        then makes small.
        """
        measured = np.hstack([self.signals.force, self.signals.moment])
        zeros = np.hstack([self._zero("force"), self._zero("moment")])
        return np.asarray(measured - zeros - self.wrench @ self.sensitivity.T)

    def _zero(self, quantity: str) -> Float[np.ndarray, "n 3"]:
        """The load cell's zero of force or moment and its drift, along B."""
        along = self.x[f"{quantity}_offset"] + np.outer(self.signals.progress, self.x[f"{quantity}_drift"])
        axes = self.signals.zero_axes
        return along if axes is None else np.asarray(np.einsum("nji,nj->ni", axes, along))

    @property
    def sensitivity(self) -> Float[np.ndarray, "6 6"]:
        """Sensitivity of the load cell: matrix from the true wrench to its reading."""
        return np.eye(6) + self.x["cell_matrix"].reshape(6, 6)

    def counted(self, columns: Columns) -> Float[np.ndarray, "n rows p"]:
        """Return the rows that count: force and moment about Q, or the moment about the centre of gravity alone."""
        return about_centre(columns, self.x["r_cg"]) if self.force_from == "none" else columns

    def changed(
        self,
        omega: Changes | None,
        alpha: Changes | None,
        specific: Changes,
        *,
        turning: Float[np.ndarray, "nodes 3 p"] | None = None,
    ) -> Columns:
        """Return what changes of the motion add to the wrench, the load cell's errors left out, (n, 6, p).

        Args:
            omega: of the angular velocity, (n, 3, p); None: none.
            alpha: of the angular acceleration.
            specific: of the specific force, beside what the two do to it.
            turning: of the angular velocity at the nodes, (nodes, 3, p), in the IMU's axes, where the attitude follows.
        """
        s, x = self.signals, self.x
        if turning is not None and self.force_from == "still":
            specific = specific + self.gravity * s.up_by_rate(turning)
        force = x["mass"] * specific
        wrench = np.concatenate([force, cross_matrix(x["r_cg"]) @ force], axis=1)
        if omega is not None and alpha is not None:
            by_omega, by_alpha = self._by_motion
            wrench += by_omega @ omega + by_alpha @ alpha
        return wrench

    @cached_property
    def _by_motion(self) -> tuple[Columns, Float[np.ndarray, "6 3"]]:
        """Derivatives of the wrench by the angular velocity and acceleration at a row's own instant."""
        s, x = self.signals, self.x
        tensor, by_arm = unpack(x["inertia"]), cross_matrix(self.arm)
        momentum, centripetal = cross_matrices(s.omega @ tensor), cross_matrices(np.cross(s.omega, self.arm))
        # d(ω × (ω × ρ)) = -([ω]× [ρ]× + [ω × ρ]×) dω, and below d(ω × I ω) = ([ω]× I - [I ω]×) dω
        force, about_q = -x["mass"] * (s.spin @ by_arm + centripetal), cross_matrix(x["r_cg"])
        by_omega = np.concatenate([force, s.spin @ tensor - momentum + about_q @ force], axis=1)
        return by_omega, np.concatenate([-x["mass"] * by_arm, tensor - x["mass"] * about_q @ by_arm])

    def derivative(self, name: str) -> Columns:
        """Return the derivative of what is predicted by one unknown: wrench, offsets, and the load cell's errors."""
        if name in ("force_offset", "moment_offset", "force_drift", "moment_drift"):
            rows = np.zeros((len(self.signals.t), 6, 3))
            first = 0 if name.startswith("force") else 3
            axes = self.signals.zero_axes
            rows[:, first : first + 3] = np.eye(3) if axes is None else axes.swapaxes(1, 2)
            return rows if name.endswith("offset") else self.signals.progress[:, None, None] * rows
        if name == "cell_matrix":
            return np.einsum("ij,nk->nijk", np.eye(6), self.wrench).reshape(-1, 6, 36)
        columns = self._of_motion(name)
        return columns if not self.x["cell_matrix"].any() else np.asarray(self.sensitivity @ columns)

    def _of_motion(self, name: str) -> Columns:
        """The derivative of the wrench by an unknown of body, alignment, IMU or gravity."""
        s, x, still = self.signals, self.x, self.force_from == "still"
        zero = np.zeros((len(s.t), 3, 3))
        if name == "inertia":
            return np.concatenate([np.zeros((len(s.t), 3, 6)), self.regressor], axis=1)
        if name == "mass":
            f = self.specific_force
            return np.hstack([f, np.cross(x["r_cg"], f)])[:, :, None]
        if name == "r_cg":
            moved = self.changed(None, None, s.levers if self.force_from == "accelerometer" else zero)
            moved[:, 3:] -= cross_matrices(self.wrench[:, :3])
            return moved
        if name == "cg_from_still":
            return self.changed(None, None, s.levers if still else zero)
        if name == "gravity":
            return self.changed(None, None, s.up[:, :, None] if still else zero[:, :, :1])
        if name == "tilt":
            return self.changed(None, None, self.gravity * s.up_by_tilt() if still else zero[:, :, :2])
        if name == "accelerometer_bias":
            read = self.force_from == "accelerometer"
            return self.changed(None, None, np.broadcast_to(-s.turn, zero.shape) if read else zero)
        if name == "gyro_bias":
            return self._by_slow_rate(slice(0, 1))
        if name == "wander":
            return self._by_slow_rate(slice(2, None))
        if name == "gyro_drift":
            return self._by_slow_rate(slice(1, 2), slope=1.0)
        if name == "gyro_scale":
            omega, alpha = (-s.turn * (signal / s.scale)[:, None] for signal in (s.imu_rate, s.imu_acceleration))
            turning = -np.eye(3) * (s.rate_at_nodes / s.scale)[:, None] if still else None
            return self.changed(omega, alpha, zero, turning=turning)
        if name == "rotation":
            # a turn δ of B changes every vector v read by the IMU by δ × v = -[v]× δ; the left Jacobian takes the
            # rotation vector's numbers to δ
            changes = -s.spin, -cross_matrices(s.alpha), -cross_matrices(self.at_known_point)
            return self.changed(*changes) @ s.turned_by_rotation
        if name == "delay":
            read = self.force_from == "accelerometer"
            # signals of an instant later: their time derivatives; those of the upward direction u are u × ω
            omega = s.rate_at(s.late) @ s.turn.T  # with the slow errors of then, as they turn the attitude
            slope = s.accelerometer_slope if read else np.cross(self.at_known_point, omega)
            return self.changed(s.rate_slope[:, :, None], s.jerk[:, :, None], slope[:, :, None])
        raise KeyError(name)

    def _by_slow_rate(self, terms: slice, *, slope: float = 0.0) -> Columns:
        """The derivative by slow errors of the gyro: some terms of its basis, on three axes each.

        Args:
            terms: of the basis.
            slope: of the terms, which counts in alpha.
        """
        s = self.signals

        def on_axes(t: np.ndarray, by_axis: np.ndarray) -> np.ndarray:
            return np.einsum("nt,ij->nitj", s.slow_basis(t)[:, terms], by_axis).reshape(len(t), 3, -1)

        omega = on_axes(s.t, -s.turn / s.scale)
        alpha = np.broadcast_to(np.tile(-slope * s.turn / s.scale, omega.shape[2] // 3), omega.shape)
        turning = on_axes(s.nodes, -np.diag(1 / s.scale)) if self.force_from == "still" else None
        return self.changed(omega, alpha, np.zeros_like(omega), turning=turning)


def about_centre(rows: Float[np.ndarray, "n 6 p"], r_cg: Float[np.ndarray, "3"]) -> Float[np.ndarray, "n 3 p"]:
    """Return the moment about the centre of gravity of wrenches about Q."""
    return np.asarray(rows[:, 3:] - cross_matrix(r_cg) @ rows[:, :3])
