"""Demands of a joint motion on an arm, its load cell and its payload, compared with their limits."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from identify.rigid_body.dynamics import acceleration_at, wrench
from identify.rigid_body.inertia import Body
from identify.serial_arm.joint_series import JointSeries, JointStates
from identify.serial_arm.serial_chain import LinkMotion, driven, poses
from uq.arm.arm import Arm
from uq.arm.clearance import Clearance
from uq.experiment.experiment import Experiment
from uq.files.document import ExperimentError

PIECE = 512
"""Instants that are looked at together: motions of all lengths are filled up to it, so that little is compiled."""
OF_JOINTS = ("position", "speed", "acceleration", "effort")


class ArmEffort(NamedTuple):
    """Demands of a motion on the arm, instants first; SI units."""

    joints: JointStates
    tool: LinkMotion
    """Motion of the load cell's frame."""
    effort: Float[Array, "t n"]
    """Torque or force of each joint [N·m or N]."""
    cell_force: Float[Array, "t 3"]
    cell_moment: Float[Array, "t 3"]
    body_acceleration: Float[Array, " t"]
    """Acceleration of the payload's centre of gravity, without gravity [m/s²]."""
    gap: Float[Array, "t p"]
    """Distances between the spheres that cover the links, and from the floor [m]."""


class JointPeak(NamedTuple):
    """The largest use of a limit by a motion, and where it occurs."""

    quantity: str
    share: float
    """Used share of the limit; above 1 the limit is exceeded."""
    where: str
    """The joint or axis; empty where there are none."""
    t: float
    """Instant of the largest use [s]."""

    def __str__(self) -> str:
        what = self.quantity.replace("_", " ") + (f" of {self.where}" if self.where else "")
        return f"{what} at {self.t:.3f} s: {100 * self.share:.1f} % of its limit"


class ArmLimits:
    """An arm, its payload and its limits, ready for motions of any number of instants."""

    def __init__(self, experiment: Experiment, arm: Arm, clearance: Clearance):
        """Take the limits of the joints, and of ``[platform.limits]`` those of load cell, gyro and payload.

        Raises:
            ExperimentError: no bandwidth, or limits that rest at home exceeds.
        """
        figures = None if experiment.limits is None else experiment.limits.figures
        if figures is None or not np.isfinite(figures.bandwidth):
            raise ExperimentError("missing key platform.limits.bandwidth: state the command's highest frequency")
        self.arm, self.clearance, self.body = arm, clearance, experiment.body
        self.gravity, self.bandwidth = experiment.gravity, figures.bandwidth
        low, high = arm.position.T
        endless = np.isinf(high)
        self.middle = np.where(endless, 0.0, (low + np.where(endless, 0.0, high)) / 2)
        self.half = np.where(endless, np.inf, (high - low) / 2)
        self.cell: Mapping[str, np.ndarray] = {
            "cell_force": figures.cell_force, "cell_moment": figures.cell_moment,
            "gyro_range": np.full(3, figures.gyro_range), "body_acceleration": figures.body_acceleration[None],
        }  # fmt: skip
        self.compiled: Any = jax.jit(self._looked_at)
        still = np.zeros((1, arm.count))
        worst = self.peaks(JointStates(arm.home[None], still, still), np.zeros(1))
        if worst[0].share > 1:
            raise ExperimentError(f"{worst[0]}, at rest at home: choose another home, or carry less")

    def asked(self, joints: JointStates) -> ArmEffort:
        """Return what a motion asks for; a function of JAX."""
        body: Any = Body(*(jnp.asarray(each) for each in self.body))

        def of_instant(q: Array, speed: Array, acceleration: Array):
            tool, effort = driven(self.arm.chain, q, speed, acceleration, body, self.gravity)
            of_cg = tool.specific_force + acceleration_at(body.r_cg_from_q, tool.omega, tool.alpha)
            force, moment = wrench(body, tool.omega, tool.alpha, of_cg)
            upwards = self.gravity * poses(self.arm.chain, q).rotation[-1][2]
            square = ((of_cg - upwards) ** 2).sum()
            size = jnp.where(square > 1e-12, jnp.sqrt(jnp.maximum(square, 1e-12)), 0.0)
            return tool, effort, force, moment, size, self.clearance.gaps(q)

        arrays = map(jnp.asarray, joints)
        return ArmEffort(joints, *jax.vmap(of_instant)(*arrays))

    def shares(self, asked: ArmEffort) -> dict[str, Float[Array, "t k"]]:
        """Return by quantity how much of its limit a motion uses at each instant: 1 is the limit.

        A position counts from the middle of its range; a gap uses all of the clearance where it is as small.
        """
        arm, joints = self.arm, asked.joints
        least = max(arm.declared.clearance, 1e-3)
        listed: dict[str, Any] = {
            "position": jnp.abs(joints.position - self.middle[None]) / self.half[None],
            "speed": jnp.abs(joints.speed) / arm.speed[None],
            "acceleration": jnp.abs(joints.acceleration) / arm.acceleration[None],
            "effort": jnp.abs(asked.effort) / arm.effort[None],
        }
        signals = {
            "cell_force": asked.cell_force, "cell_moment": asked.cell_moment, "gyro_range": asked.tool.omega,
            "body_acceleration": asked.body_acceleration[:, None],
        }  # fmt: skip
        for name, most in self.cell.items():
            if np.isfinite(most).any():
                listed[name] = jnp.abs(signals[name]) / most[None]
        if asked.gap.shape[1]:
            listed["clearance"] = jnp.maximum(1 - (asked.gap - arm.declared.clearance) / least, 0.0)
        return listed

    def tool(self, series: JointSeries, t: Float[np.ndarray, " t"]) -> LinkMotion:
        """Return the tool's motion at instants [s]."""
        return self.tool_of(JointStates(*map(np.asarray, series.states(t))))

    def tool_of(self, joints: JointStates) -> LinkMotion:
        """Return the tool's motion of joints in NumPy."""
        motion: LinkMotion = self._of_pieces(joints)[1]
        return motion

    def _looked_at(self, joints: JointStates) -> tuple[dict[str, Any], LinkMotion]:
        asked = self.asked(joints)
        return self.shares(asked), asked.tool

    def _of_pieces(self, joints: JointStates) -> Any:
        """Shares of all limits and the tool's motion, in pieces of one size."""
        count = len(joints.position)
        filled = [np.concatenate([each, np.repeat(each[-1:], -count % PIECE, axis=0)]) for each in joints]
        pieces = [
            jax.tree.map(np.asarray, self.compiled(JointStates(*(jnp.asarray(each[k : k + PIECE]) for each in filled))))
            for k in range(0, count, PIECE)
        ]
        return jax.tree.map(lambda *parts: np.concatenate(parts)[:count], *pieces)

    def where(self, quantity: str, number: int) -> str:
        """Return what to call the joint, axis or pair of links."""
        if quantity in OF_JOINTS:
            return self.arm.names[number]
        if quantity == "clearance":
            return self.clearance.name(number)
        return f"axis {number + 1}" if quantity != "body_acceleration" else ""

    def peaks_of(self, series: JointSeries, t: Float[np.ndarray, " t"]) -> list[JointPeak]:
        """Return each limit's largest use of a motion at instants [s], largest first."""
        return self.peaks(JointStates(*map(np.asarray, series.states(t))), t)

    def peaks(self, joints: JointStates, t: Float[np.ndarray, " t"]) -> list[JointPeak]:
        """Return each limit's largest use at instants [s], largest first."""
        shares, _ = self._of_pieces(joints)
        listed = []
        for name, values in shares.items():
            instant, k = np.unravel_index(int(np.argmax(values)), values.shape)
            where = self.where(name, int(k))
            listed.append(JointPeak(name, float(values[instant, k]), where, float(t[instant])))
        return sorted(listed, key=lambda peak: -peak.share)
