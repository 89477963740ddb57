"""Columns of an error of the rig: derivatives of a run's residuals by each of its numbers.

The derivative, at no error, of the load cell's reading less what the estimator predicts from the IMU's readings and
from what it believes. The predicted wrench's derivatives by readings and beliefs are those of
:class:`identify.estimation.joint.predicted_wrench.PredictedWrench`; how an error changes these is its own business
(:mod:`identify.errors`).
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float

from identify.errors.error_model import CELL_MATRIX, ErrorModel
from identify.errors.rig_state import Beliefs, RigState, TrueMotion
from identify.estimation.joint.joint_model import BY_ACT
from identify.estimation.joint.predicted_wrench import Columns, PredictedWrench


def derivative(run: PredictedWrench, unknown: str) -> Columns:
    """Return the derivative of what is predicted by an unknown of the joint model, (n, 6, p)."""
    return ErrorColumns(run).columns(BY_ACT[unknown]) if unknown in BY_ACT else run.derivative(unknown)


def departure(run: PredictedWrench) -> Float[np.ndarray, "n 6"]:
    """Return measured less predicted [N], [N·m], with all unknowns of the joint model."""
    acting = [name for name in BY_ACT if run.x[name].any()]
    return run.residuals - sum((derivative(run, name) @ run.x[name] for name in acting), np.zeros((1, 6)))


OF_BODY_AND_RIG = ("mass", "r_cg", "inertia", "gravity", "cg_from_still")
"""Beliefs that are unknowns of the joint model."""


@dataclass(frozen=True, eq=False)
class ErrorColumns:
    """The columns of errors in one run."""

    run: PredictedWrench

    def columns(self, error: ErrorModel) -> Columns:
        """Return what a unit of each number of an error adds to measured less predicted, (n, 6, p).

        The load cell's known errors are left out. Zeros where nothing tells the specific force as the error needs it.
        """
        if "accelerometer" in error.needs and self.run.force_from != "accelerometer":
            return np.zeros((len(self.run.signals.t), 6, error.count))
        if error.by_hand:
            return np.concatenate([self.run.derivative(name) for name in error.unknowns], axis=2)
        if error.unknowns == CELL_MATRIX:
            return self.run.derivative(*CELL_MATRIX) @ error.by_cell_matrix
        return self.by_act(error)

    def by_act(self, error: ErrorModel) -> Columns:
        """Return the columns by letting the error act, though the joint model may have them in closed form."""
        parts = error.derivatives(self.rows)
        columns = parts.get("wrench", np.zeros((len(self.run.signals.t), 6, error.count)))
        # measured less predicted: what is believed enters by the prediction, and so with the opposite sign
        for name in OF_BODY_AND_RIG:
            if name in parts:
                columns = columns - self.run.derivative(name) @ parts[name]
        if parts.keys() <= {"wrench", *OF_BODY_AND_RIG}:  # most errors of load cell and rig: the prediction stays
            return np.asarray(columns)
        follows = error.derivatives(self.nodes) if self._turns(error) else {}
        return np.asarray(columns - self._predicted(parts, follows, error.count))

    def _turns(self, error: ErrorModel) -> bool:
        """Whether the attitude follows the error."""
        return error.part in ("gyro", "imu") and self.run.force_from == "still"

    def _predicted(self, parts: dict[str, np.ndarray], follows: dict[str, np.ndarray], count: int) -> Columns:
        """The change of the predicted wrench by changes of what the IMU reads, and of where it is."""
        run, s = self.run, self.run.signals
        none = np.zeros((len(s.t), 3, count))
        omega, alpha, force = (s.turn @ parts.get(name, none) for name in ("gyro", "gyro_slope", "accelerometer"))
        specific = force if run.force_from == "accelerometer" else none
        if "imu_position" in parts:
            specific = specific - s.levers @ parts["imu_position"] * (run.force_from == "accelerometer")
        if "vertical" in follows:
            specific = specific + run.gravity * s.turn @ (s.attitude.swapaxes(1, 2) @ follows["vertical"])
        return run.changed(omega, alpha, specific, turning=follows.get("gyro"))

    @cached_property
    def rows(self) -> RigState:
        """The run at the rows that count, without errors."""
        run, s = self.run, self.run.signals
        read = run.at_known_point if run.force_from == "accelerometer" else run.specific_force
        true = TrueMotion(
            t=s.t, duration=run.model.rows.duration, omega=s.omega, alpha=s.alpha, specific_force=run.specific_force,
            up=s.up, turning=s.turning, mass=float(run.x["mass"][0]), r_cg=run.x["r_cg"], inertia=run.x["inertia"],
            zero_axes=s.zero_axes,
        )  # fmt: skip
        return RigState(
            true=true, beliefs=self._beliefs(len(s.t)), wrench=run.wrench, gyro=s.imu_rate,
            gyro_slope=s.imu_acceleration, accelerometer=read @ s.turn, vertical=s.up_at_start, imu_turn=s.turn,
        )  # fmt: skip

    @cached_property
    def nodes(self) -> RigState:
        """The run at the nodes by which the attitude follows the gyro; no wrench."""
        run, s, x = self.run, self.run.signals, self.run.x
        slope = (run.model.spline(s.nodes, 1)[:, :3] - x["gyro_drift"]) / s.scale
        gyro, up = s.rate_at_nodes, (s.up_at_start @ s.attitude_at_nodes) @ s.turn.T
        omega, alpha = gyro @ s.turn.T, slope @ s.turn.T
        lever = np.cross(alpha, run.arm) + np.cross(omega, np.cross(omega, run.arm))
        force = run.gravity * up + lever
        true = TrueMotion(
            t=s.nodes, duration=run.model.rows.duration, omega=omega, alpha=alpha, specific_force=force, up=up,
            turning=np.zeros_like(up), mass=float(x["mass"][0]), r_cg=x["r_cg"], inertia=x["inertia"],
        )  # fmt: skip
        return RigState(
            true=true, beliefs=self._beliefs(len(s.nodes)), wrench=np.zeros((len(s.nodes), 6)), gyro=gyro,
            gyro_slope=slope, accelerometer=force @ s.turn, vertical=s.up_at_start, imu_turn=s.turn,
        )  # fmt: skip

    def _beliefs(self, count: int) -> Beliefs:
        run = self.run
        values = {
            "mass": run.x["mass"], "r_cg": run.x["r_cg"], "inertia": run.x["inertia"],
            "gravity": np.array([run.gravity]), "cg_from_still": run.x["cg_from_still"],
            "imu_position": np.asarray(run.model.imu_position),
        }  # fmt: skip
        return Beliefs(**{name: np.broadcast_to(value, (count, len(value))) for name, value in values.items()})
