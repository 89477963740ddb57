"""Demands of a joint motion on an arm, its load cell and its payload, compared with their limits."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from identify.motion.limit_peaks import Peak, largest_uses
from identify.motion.serial_arm.joint_series import JointSeries, JointStates
from identify.motion.serial_arm.serial_chain import LinkMotion, driven, poses
from identify.rigid_body.dynamics import acceleration_at, wrench
from identify.rigid_body.inertia import Body
from uq.experiment.experiment import Experiment
from uq.files.mistakes import ExperimentError
from uq.plan.motion_design.arm.arm import Arm
from uq.plan.motion_design.arm.clearance import Clearance
from uq.plan.motion_design.search import in_pieces

PIECE = 512
"""Instants that are looked at together: motions of all lengths are filled up to it, so that little is compiled."""
OF_JOINTS = ("position", "speed", "acceleration", "effort")


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
        self.gravity, self.figures, self.bandwidth = experiment.gravity, figures, figures.bandwidth
        self.compiled: Any = jax.jit(self.looked_at)
        still = np.zeros((1, arm.count))
        worst = self.peaks(JointStates(arm.home[None], still, still), np.zeros(1))
        if worst[0].share > 1:
            raise ExperimentError(f"{worst[0]}, at rest at home: choose another home, or carry less")

    def looked_at(self, joints: JointStates) -> tuple[dict[str, Float[Array, "t k"]], LinkMotion]:
        """Return how much of each limit a motion uses at each instant, and the tool's motion; a function of JAX.

        A share of 1 is the limit. A position counts from the middle of its range; a gap between links, or from the
        floor, uses all of the clearance where it is as small.
        """
        body: Any = Body(*map(jnp.asarray, self.body))

        def of_instant(q: Array, speed: Array, acceleration: Array):
            tool, effort = driven(self.arm.chain, q, speed, acceleration, body, self.gravity)
            specific_force = tool.specific_force + acceleration_at(body.r_cg_from_q, tool.omega, tool.alpha)
            force, moment = wrench(body, tool.omega, tool.alpha, specific_force)
            upwards = self.gravity * poses(self.arm.chain, q).rotation[-1][2]
            square = ((specific_force - upwards) ** 2).sum()
            size = jnp.where(square > 1e-12, jnp.sqrt(jnp.maximum(square, 1e-12)), 0.0)
            return tool, effort, force, moment, size, self.clearance.gaps(q)

        tool, effort, force, moment, acceleration, gap = jax.vmap(of_instant)(*map(jnp.asarray, joints))
        shares = self.arm.joint_shares(joints) | {"effort": effort / self.arm.effort[None]}
        signals = {
            "cell_force": force, "cell_moment": moment, "gyro_range": tool.omega,
            "body_acceleration": acceleration[:, None],
        }  # fmt: skip
        for name, signal in signals.items():
            most = np.atleast_1d(getattr(self.figures, name))
            if np.isfinite(most).any():
                shares[name] = signal / most[None]
        if gap.shape[1]:
            least = max(self.arm.declared.clearance, 1e-3)
            shares["clearance"] = jnp.maximum(1 - (gap - self.arm.declared.clearance) / least, 0.0)
        return {name: jnp.abs(share) for name, share in shares.items()}, tool

    def tool(self, joints: JointStates) -> LinkMotion:
        """Return the tool's motion of joints in NumPy."""
        motion: LinkMotion = in_pieces(self.compiled, joints, PIECE)[1]
        return motion

    def where(self, quantity: str, number: int) -> str:
        """Return what to call the joint, axis or pair of links."""
        if quantity in OF_JOINTS:
            return self.arm.names[number]
        if quantity == "clearance":
            return self.clearance.name(number)
        return f"axis {number + 1}" if quantity != "body_acceleration" else ""

    def peaks_of(self, series: JointSeries, t: Float[np.ndarray, " t"]) -> list[Peak]:
        """Return each limit's largest use of a motion at instants [s], largest first."""
        return self.peaks(series.sampled(t), t)

    def peaks(self, joints: JointStates, t: Float[np.ndarray, " t"]) -> list[Peak]:
        """Return each limit's largest use at instants [s], largest first."""
        shares, _ = in_pieces(self.compiled, joints, PIECE)
        return largest_uses(shares, t, self.where)
