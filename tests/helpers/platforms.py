"""Platforms for tests, and their MuJoCo twins: an independent library's lengths, speeds and forces."""

import jax.numpy as jnp
import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from identify.motion.stewart_platform import Pose, Rod, StewartPlatform, Twist
from identify.rigid_body.inertia import Body

NO_BODY = Body(jnp.array(0.0), jnp.zeros(3), jnp.zeros(6))
NO_ROD = Rod(jnp.array(0.0), jnp.array(0.0), jnp.array(0.0))


def ring(radius, half_angle, first):
    """Six points in three pairs."""
    angles = [first + 120 * k + sign * half_angle for k in range(3) for sign in (-1, 1)]
    return radius * np.stack([np.cos(np.radians(angles)), np.sin(np.radians(angles)), np.zeros(6)], axis=1)


def small(*, plate=NO_BODY, cylinder=NO_ROD, rod=NO_ROD):
    """A platform of the size of a table."""
    base, joints = ring(0.45, 12.0, 0.0), np.roll(ring(0.3, 10.0, 60.0), 1, axis=0)
    joints[:, 2] = -0.03
    return StewartPlatform(jnp.array(base), jnp.array(joints), jnp.array([0.01, -0.02, 0.55]), plate, cylinder, rod)


def somewhere(generator, platform, spread=1.0):
    """A random pose in the workspace."""
    shift = spread * generator.uniform(-0.08, 0.08, 3)
    turn = spread * generator.uniform(-0.35, 0.35, 3)
    return Pose(jnp.asarray(np.asarray(platform.home) + shift), jnp.asarray(Rotation.from_rotvec(turn).as_matrix()))


def moving(generator):
    """A random motion at one instant."""
    return Twist(*(jnp.array(scale * generator.normal(size=3)) for scale in (0.3, 0.5, 3.0, 5.0)))


def quaternion(rotation):
    found = np.zeros(4)
    mujoco.mju_mat2Quat(found, np.asarray(rotation).ravel())
    return found


def twin(platform, body, gravity):
    """The platform in MuJoCo: a free body on six tendons, and six separate legs of two hinges and a slide."""
    sites = "".join(f'<site name="a{k}" pos="{at(p)}"/>' for k, p in enumerate(platform.base))
    tops = "".join(f'<site name="b{k}" pos="{at(p)}"/>' for k, p in enumerate(platform.joints))
    tendons = "".join(f'<spatial><site site="a{k}"/><site site="b{k}"/></spatial>' for k in range(6))
    loads = "".join(inertial(one) for one in (platform.plate, body) if one.mass > 0)
    halves = "".join(
        f'<body pos="{at(p)}"><joint type="hinge" axis="1 0 0"/><joint type="hinge" axis="0 1 0"/>'
        f"{half(platform.cylinder, 1)}<body><joint type='slide' axis='0 0 1'/>{half(platform.rod, -1)}</body></body>"
        for p in platform.base
        if platform.rod.mass > 0
    )
    xml = (
        f'<mujoco><compiler boundmass="0" boundinertia="0" balanceinertia="false"/><option gravity="0 0 {-gravity}"/><worldbody>{sites}'
        f"<body><freejoint/>{tops}{loads}</body>{halves}</worldbody><tendon>{tendons}</tendon></mujoco>"
    )
    model = mujoco.MjModel.from_xml_string(xml)
    return model, mujoco.MjData(model)


def at(point):
    return " ".join(f"{float(x):.17g}" for x in point)


def inertial(body):
    i11, i12, i13, i22, i23, i33 = (float(x) for x in body.inertia)
    full = at([i11, i22, i33, i12, i13, i23])
    return f'<body><inertial pos="{at(body.r_cg_from_q)}" mass="{float(body.mass):.17g}" fullinertia="{full}"/></body>'


def half(rod, sign):
    across = float(rod.inertia)
    return (
        f'<inertial pos="0 0 {sign * float(rod.distance):.17g}" mass="{float(rod.mass):.17g}" '
        f'diaginertia="{across:.17g} {across:.17g} {across * 1e-9:.17g}"/>'
    )
