"""An arm of a URDF in MuJoCo, which reads the file itself: its shapes, and the arm with a payload.

What is fixed to a link becomes part of it, so that the bodies are the base, which is MuJoCo's world, and one for each
joint, in their order.
"""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from identify.rigid_body.inertia import Body, unpack
from rig.exceptions import RigError, reason
from uq.files.mistakes import ExperimentError
from uq.plan.motion_design.arm.arm import Arm
from uq.plan.motion_design.arm.collision_meshes import with_mesh_files

Pairs = Sequence[tuple[str, str]]
FLOOR = "the floor"


def mujoco_library() -> Any:
    """Return the package ``mujoco``.

    Raises:
        RigError: it is not installed, or files of it are missing.
    """
    try:
        import mujoco
    except ImportError:
        raise RigError("arms need MuJoCo: `pip install inertia-uq[arm]` installs it") from None
    if not hasattr(mujoco, "MjSpec"):  # a folder without the __init__.py that mujoco and mujoco-core both own
        raise RigError(
            "files of MuJoCo are missing, as where `mujoco` was removed beside mujoco-core: "
            "`pip install --force-reinstall --no-deps mujoco-core` restores them"
        )
    return mujoco


def shapes_model(arm: Arm) -> Any:
    """Return MuJoCo's model of the arm's shapes and the floor; a shape is called by its link, ``/`` and a number.

    Raises:
        ExperimentError: a mesh cannot be found, or MuJoCo cannot read the URDF.
        RigError: MuJoCo is not installed.
    """

    def of_shapes() -> Any:
        spec = _robot_spec(arm)
        spec.compiler.boundmass = spec.compiler.boundinertia = 1.0  # a link may have none here
        spec.compiler.balanceinertia = True
        return spec

    return _compiled(arm, of_shapes)


def loaded_model(arm: Arm, body: Body, gravity: float, may_touch: Pairs = ()) -> Any:
    """Return the compiled model of :func:`loaded_spec`.

    Raises:
        ExperimentError: MuJoCo cannot read the URDF.
        RigError: MuJoCo is not installed.
    """
    return _compiled(arm, lambda: loaded_spec(arm, body, gravity, may_touch))


def _compiled(arm: Arm, spec: Callable[[], Any]) -> Any:
    try:
        return spec().compile()
    except ValueError as error:
        if isinstance(error, (ExperimentError, RigError)):
            raise
        raise ExperimentError(
            f"MuJoCo cannot read {Path(arm.declared.urdf).name} ({reason(str(error).strip())}): correct it there"
        ) from None


def _robot_spec(arm: Arm) -> Any:
    """MuJoCo's specification of the arm of the URDF, with the floor."""
    mujoco = mujoco_library()
    robot, meshes = with_mesh_files(arm.declared), dict[str, bytes]()
    for compiler in robot.iter("compiler"):  # of MuJoCo's own element: folders of the meshes
        for key in ("meshdir", "assetdir"):
            compiler.attrib.pop(key, None)
    for link in robot.iter("link"):
        for number, shape in enumerate(link.findall("collision")):
            shape.set("name", f"{link.get('name', '')}/{number}")
            for mesh in shape.iter("mesh"):
                file = Path(mesh.get("filename", ""))
                name = f"shape_{len(meshes)}{file.suffix.lower()}"
                meshes[name] = file.read_bytes()
                mesh.set("filename", name)
    spec = mujoco.MjSpec.from_string(ElementTree.tostring(robot, "unicode"), assets=meshes)
    spec.compiler.fusestatic = True  # whatever the URDF tells MuJoCo
    for geom in spec.geoms:
        geom.density = geom.mass = 0.0  # masses are those that the URDF states
    if arm.declared.floor is not None:
        floor = spec.worldbody.add_geom(type=mujoco.mjtGeom.mjGEOM_PLANE, size=[5, 5, 0.1])
        floor.pos, floor.name = [0, 0, arm.declared.floor], FLOOR
    return spec


def loaded_spec(arm: Arm, body: Body, gravity: float, may_touch: Pairs = ()) -> Any:
    """Return MuJoCo's specification of the arm of the URDF, with a payload and the wrist's sensors at Q.

    The links in ``may_touch`` may touch.

    Raises:
        ExperimentError: the URDF or a mesh cannot be read.
        RigError: MuJoCo is not installed.
        ValueError: MuJoCo cannot read it.
    """
    mujoco, spec = mujoco_library(), _robot_spec(arm)
    spec.option.gravity = [0, 0, -gravity]
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    first = spec.worldbody.first_body().name
    spec.add_exclude(bodyname1="world", bodyname2=first)  # which a joint connects
    bodies = {body.name for body in spec.bodies}
    for pair in may_touch:
        if pair[0] != pair[1] and bodies.issuperset(pair):
            spec.add_exclude(bodyname1=pair[0], bodyname2=pair[1])
    last = next(joint.parent for joint in spec.joints if joint.name == arm.names[-1])
    turn, quaternion = np.asarray(arm.chain.tool_rotation), np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, turn.ravel())
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
    mujoco = mujoco_library()
    load = carrier.add_body(name="payload", **placed)
    load.explicitinertial = True
    load.mass, load.ipos = float(body.mass), np.asarray(body.r_cg_from_q)
    tensor = np.asarray(unpack(np.asarray(body.inertia)))
    load.fullinertia = tensor[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    load.add_site(name="Q")
    for name, kind in (("force", mujoco.mjtSensor.mjSENS_FORCE), ("torque", mujoco.mjtSensor.mjSENS_TORQUE)):
        spec.add_sensor(name=name, type=kind, objtype=mujoco.mjtObj.mjOBJ_SITE, objname="Q")
