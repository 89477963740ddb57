"""A joint motion simulated in MuJoCo before anything moves: limits, tracking and contacts of the arm of the URDF.

The arm's controller computes the torque of arm and payload, which it takes to be lighter than it is, with a
proportional and derivative action on the error, and cuts it at the limits: joints track with error.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np

from identify.motion.limit_peaks import Peak, largest_uses
from identify.motion.serial_arm.joint_series import JointSeries, JointStates
from identify.rigid_body.inertia import Body
from uq.plan.motion_design.arm.arm import Arm
from uq.plan.motion_design.arm.mujoco_model import Pairs, loaded_model, mujoco_library

SERVO = 2 * np.pi * 12.0
"""Angular frequency of the controller's error [rad/s], which is damped critically."""
ASSUMED = 0.8
"""Part of the payload's mass and tensor that the controller reckons with."""
STEPS = 2
"""Steps of the simulation in a period of the command."""


@dataclass(frozen=True, eq=False)
class MujocoRun:
    """The simulated run of an arm in MuJoCo, at the rate of the command."""

    t: np.ndarray
    joints: JointStates
    effort: np.ndarray
    """Efforts of the joints' drives, (t, n) [N·m or N]."""
    wrench: np.ndarray
    """Force and moment on the payload about Q, in B, (t, 6)."""
    tracking_error: np.ndarray
    """Largest distance of each joint from its command, (n,) [rad or m]."""
    peaks: tuple[Peak, ...]
    """Each limit's largest use by what was simulated, largest first."""
    contacts: tuple[str, ...]
    """Links that touched each other or the floor, with the first instant."""


def simulated(arm: Arm, body: Body, gravity: float, series: JointSeries, may_touch: Pairs = ()) -> MujocoRun:
    """Run a motion in MuJoCo.

    Args:
        arm: with its URDF, rate and limits.
        body: the payload.
        gravity: local gravity [m/s²].
        series: the motion.
        may_touch: links that may (:attr:`uq.plan.motion_design.arm.clearance.Clearance.may_touch`).

    Raises:
        ExperimentError: MuJoCo cannot read the URDF.
        RigError: MuJoCo is not installed.
    """
    assumed = Body(np.asarray(ASSUMED * body.mass), body.r_cg_from_q, np.asarray(ASSUMED * body.inertia))
    loaded, reckoned = (loaded_model(arm, load, gravity, may_touch) for load in (body, assumed))
    order = [loaded.joint(name).dofadr[0] for name in arm.names]
    mujoco, rate = mujoco_library(), STEPS * arm.declared.rate
    t = np.arange(round(series.duration * rate) + 1) / rate
    loaded.opt.timestep = 1 / rate
    command = series.sampled(t)
    data, plant, sampled = mujoco.MjData(loaded), mujoco.MjData(reckoned), mujoco.MjData(loaded)
    data.qpos[order] = command.position[0]
    rows, contacts = [], dict[str, float]()
    for k, (position, speed, acceleration) in enumerate(zip(*command, strict=True)):
        error, slip = position - data.qpos[order], speed - data.qvel[order]
        plant.qpos[:], plant.qvel[:] = data.qpos, data.qvel
        plant.qacc[order] = acceleration + 2 * SERVO * slip + SERVO**2 * error
        mujoco.mj_inverse(reckoned, plant)
        effort = np.clip(plant.qfrc_inverse[order], -arm.effort, arm.effort)
        data.qfrc_applied[order] = effort
        mujoco.mj_forward(loaded, data)
        if k % STEPS == 0:  # MuJoCo's speeds are those of half a step before its positions
            sampled.qpos[:], sampled.qvel[:] = data.qpos, data.qvel + data.qacc / (2 * rate)
            sampled.qacc[:] = data.qacc
            mujoco.mj_inverse(loaded, sampled)
            states = sampled.qpos[order], sampled.qvel[order], sampled.qacc[order]
            rows.append(np.concatenate([*states, effort, sampled.sensordata]))
        for pair in _touching(loaded, data):
            contacts.setdefault(pair, t[k])
        mujoco.mj_step(loaded, data)
    done = np.array(rows)
    q, qd, qdd, efforts, read = np.split(done, np.cumsum([arm.count] * 4), axis=1)
    joints, at = JointStates(q, qd, qdd), t[::STEPS]
    error = np.abs(q - command.position[::STEPS]).max(axis=0)
    touched = tuple(f"{pair} touch at {when:.3f} s" for pair, when in contacts.items())
    shares = arm.joint_shares(joints) | {"effort": efforts / arm.effort}
    peaks = largest_uses(shares, at, lambda _, joint: arm.names[joint])
    return MujocoRun(
        t=at, joints=joints, effort=efforts, wrench=read, tracking_error=error, peaks=tuple(peaks), contacts=touched,
    )  # fmt: skip


def _touching(model: Any, data: Any) -> Iterator[str]:
    """Pairs of bodies in contact, but for those of the fixed base with the floor."""
    for k in range(data.ncon):
        geoms = data.contact[k].geom
        bodies = [int(model.geom_bodyid[g]) for g in geoms]
        if max(bodies) > 1:
            yield " and ".join(model.body(b).name or "the base" for b in bodies)
