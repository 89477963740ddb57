"""A joint motion simulated in MuJoCo before anything moves: limits, tracking and contacts of the arm of the URDF.

MuJoCo reads the URDF itself, with those meshes of collision shapes whose format it knows. The arm's controller computes
the torque of arm and payload, which it takes to be lighter than it is, with a proportional and derivative action on the
error, and cuts it at the limits: joints track with error.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from identify.motion.limit_peaks import Peak, largest_uses
from identify.motion.serial_arm.joint_series import JointSeries, JointStates
from identify.rigid_body.inertia import Body, unpack
from rig.exceptions import RigError, reason
from uq.files.mistakes import ExperimentError
from uq.plan.motion_design.arm.arm import Arm
from uq.plan.motion_design.arm.collision_meshes import with_mesh_files

SERVO = 2 * np.pi * 12.0
"""Angular frequency of the controller's error [rad/s], which is damped critically."""
ASSUMED = 0.8
"""Part of the payload's mass and tensor that the controller reckons with."""
FORMATS = (".stl", ".obj", ".msh")
"""File formats of the meshes that MuJoCo reads."""
Pairs = Sequence[tuple[str, str]]
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
    unseen: tuple[str, ...] = ()
    """Mesh files that the simulation leaves out."""


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
    mujoco, rate = _mujoco(), STEPS * arm.declared.rate
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
        unseen=left_out(arm),
    )  # fmt: skip


def _mujoco() -> Any:
    try:
        import mujoco
    except ImportError:
        raise RigError("the simulation of an arm needs MuJoCo: `pip install inertia-uq[arm]` installs it") from None
    return mujoco


def loaded_model(arm: Arm, body: Body, gravity: float, may_touch: Pairs = ()) -> Any:
    """Return the compiled model of :func:`loaded_spec`.

    Raises:
        ExperimentError: MuJoCo cannot read the URDF.
        RigError: MuJoCo is not installed.
    """
    try:
        return loaded_spec(arm, body, gravity, may_touch).compile()
    except ValueError as error:
        if isinstance(error, (ExperimentError, RigError)):
            raise
        raise ExperimentError(
            f"MuJoCo cannot read {Path(arm.declared.urdf).name} ({reason(str(error).strip())}): correct it there"
        ) from None


def left_out(arm: Arm) -> tuple[str, ...]:
    """Return the meshes of collision shapes that MuJoCo cannot read, so that the simulation has no such contacts."""
    robot = with_mesh_files(arm.declared)
    files = (Path(mesh.get("filename", "")) for mesh in robot.iter("mesh"))
    return tuple(dict.fromkeys(file.name for file in files if file.suffix.lower() not in FORMATS))


def _robot(arm: Arm) -> tuple[str, dict[str, bytes]]:
    """The URDF with its meshes under names without folders, and their content by these names."""
    robot, meshes = with_mesh_files(arm.declared), dict[str, bytes]()
    for compiler in robot.iter("compiler"):  # of MuJoCo's own element: folders of the meshes
        for key in ("meshdir", "assetdir"):
            compiler.attrib.pop(key, None)
    for link in robot.iter("link"):
        for shape in link.findall("collision"):
            for number, mesh in enumerate(shape.iter("mesh"), start=len(meshes)):
                file = Path(mesh.get("filename", ""))
                if file.suffix.lower() not in FORMATS:
                    link.remove(shape)
                    break
                name = f"shape_{number}{file.suffix.lower()}"
                meshes[name] = file.read_bytes()
                mesh.set("filename", name)
    return ElementTree.tostring(robot, "unicode"), meshes


def loaded_spec(arm: Arm, body: Body, gravity: float, may_touch: Pairs = ()) -> Any:
    """Return MuJoCo's specification of the arm of the URDF, with a payload and the wrist's sensors at Q.

    The links in ``may_touch`` may touch.

    Raises:
        ExperimentError: the URDF or a mesh cannot be read.
        RigError: MuJoCo is not installed.
        ValueError: MuJoCo cannot read it.
    """
    mujoco = _mujoco()
    robot, meshes = _robot(arm)
    spec = mujoco.MjSpec.from_string(robot, assets=meshes)
    spec.option.gravity = [0, 0, -gravity]
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    for geom in spec.geoms:
        geom.density = geom.mass = 0.0  # masses are those that the URDF states
    first = spec.worldbody.first_body().name
    spec.add_exclude(bodyname1="world", bodyname2=first)  # which a joint connects
    bodies = {body.name for body in spec.bodies}
    for pair in may_touch:
        if pair[0] != pair[1] and bodies.issuperset(pair):
            spec.add_exclude(bodyname1=pair[0], bodyname2=pair[1])
    last = next(joint.parent for joint in spec.joints if joint.name == arm.names[-1])
    turn, quaternion = np.asarray(arm.chain.tool_rotation), np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, turn.ravel())
    if arm.declared.floor is not None:
        floor = spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[5, 5, 0.1])
        floor.pos, floor.name = [0, 0, arm.declared.floor], "the floor"
    add_payload(last, spec, body, pos=arm.chain.tool_position, quat=quaternion)
    return spec


def add_payload(carrier: Any, spec: Any, body: Body, **placed: Any) -> None:
    """Fix the body "payload" to another one of MuJoCo's, with sensors of force and moment on it at Q.

    Args:
        carrier: body of the specification that carries it.
        spec: the specification.
        body: mass, centre of gravity from Q and tensor.
        placed: ``pos`` and ``quat`` of Q and its axes on the carrier.
    """
    mujoco = _mujoco()
    load = carrier.add_body(name="payload", **placed)
    load.explicitinertial = True
    load.mass, load.ipos = float(body.mass), np.asarray(body.r_cg_from_q)
    tensor = np.asarray(unpack(np.asarray(body.inertia)))
    load.fullinertia = tensor[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    load.add_site(name="Q")
    for name, kind in (("force", mujoco.mjtSensor.mjSENS_FORCE), ("torque", mujoco.mjtSensor.mjSENS_TORQUE)):
        spec.add_sensor(name=name, type=kind, objtype=mujoco.mjtObj.mjOBJ_SITE, objname="Q")


def _touching(model: Any, data: Any) -> Iterator[str]:
    """Pairs of bodies in contact, but for those of the fixed base with the floor."""
    for k in range(data.ncon):
        geoms = data.contact[k].geom
        bodies = [int(model.geom_bodyid[g]) for g in geoms]
        if max(bodies) > 1:
            yield " and ".join(model.body(b).name or "the base" for b in bodies)
