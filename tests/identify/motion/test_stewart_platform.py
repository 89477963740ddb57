"""The platform against MuJoCo, and against itself."""

import jax
import jax.numpy as jnp
import mujoco
import numpy as np
import pytest

from identify.motion import stewart_platform as pf
from identify.motion.stewart_platform import Pose, Rod, Twist
from identify.rigid_body.inertia import Body
from identify.rigid_body.rotation import exponential
from tests.helpers.platforms import moving, quaternion, small, somewhere, twin

PLATE = Body(jnp.array(8.0), jnp.array([0.005, -0.01, 0.02]), jnp.array([0.12, 0.004, -0.003, 0.11, 0.002, 0.21]))
BODY = Body(jnp.array(19.7), jnp.array([0.002, 0.003, 0.11]), jnp.array([0.3813, 0.01, 0.004, 0.2, -0.006, 0.3791]))
CYLINDER = Rod(jnp.array(3.0), jnp.array(0.2), jnp.array(0.04))
ROD = Rod(jnp.array(1.2), jnp.array(0.15), jnp.array(0.01))
GRAVITY = 9.81
forces = jax.jit(pf.forces)
legs = jax.jit(pf.legs)
lengths = jax.jit(pf.lengths)


def in_mujoco(platform, pose, twist, body=None):
    """Lengths, speeds, and forces along the legs without mass."""
    model, data = twin(platform, platform.plate if body is None else body, GRAVITY)
    data.qpos[:3], data.qpos[3:7] = pose.position, quaternion(pose.rotation)
    data.qvel[:3], data.qvel[3:6] = twist.velocity, twist.omega
    data.qacc[:3], data.qacc[3:6] = twist.acceleration, twist.alpha
    mujoco.mj_inverse(model, data)
    jacobian = np.zeros((6, model.nv))
    if data.ten_J.size == jacobian.size:
        jacobian[:] = data.ten_J.reshape(6, model.nv)
    else:
        mujoco.mju_sparse2dense(jacobian, data.ten_J, data.ten_J_rownnz, data.ten_J_rowadr, data.ten_J_colind)
    force = np.linalg.solve(jacobian[:, :6].T, data.qfrc_inverse[:6])
    return data.ten_length.copy(), data.ten_velocity.copy(), force, data


def test_lengths_speeds_and_forces_are_mujocos(generator):
    platform = small(plate=PLATE)
    for _ in range(20):
        pose, twist = somewhere(generator, platform), moving(generator)
        length, speed, force, _ = in_mujoco(platform, pose, twist, BODY)
        kinematics = legs(platform, pose, twist)
        np.testing.assert_allclose(kinematics.length, length, rtol=1e-12)
        np.testing.assert_allclose(kinematics.speed, speed, rtol=0, atol=1e-12)
        np.testing.assert_allclose(forces(platform, BODY, pose, twist, jnp.array(GRAVITY)), force, rtol=0, atol=1e-9)


def hinges(platform, pose):
    """The two angles of each leg's universal joint, and its length, as MuJoCo has them."""
    along = pf.vectors(platform, pose)
    length = jnp.linalg.norm(along, axis=1)
    x, y, z = (along / length[:, None]).T
    return jnp.stack([jnp.arctan2(-y, z), jnp.arcsin(x), length], axis=1).ravel()


def shifted(pose, step):
    return Pose(pose.position + step[:3], pose.rotation @ exponential(step[3:]))


def test_forces_of_heavy_legs_are_mujocos(generator):
    """The virtual work of separate legs, each by MuJoCo's inverse dynamics, joins that of the platform."""
    platform = small(plate=PLATE, cylinder=CYLINDER, rod=ROD)
    model, data = twin(platform, BODY, GRAVITY)
    of_hinges = jax.jit(lambda pose, twist: pf.second_order(lambda at: hinges(platform, at), pose, twist))
    slopes = jax.jit(jax.jacobian(lambda step, pose: hinges(platform, shifted(pose, step))))
    of_lengths = jax.jit(pf.jacobian)
    for _ in range(10):
        pose, twist = somewhere(generator, platform), moving(generator)
        q, speed, acceleration = of_hinges(pose, twist)
        data.qpos[:] = np.concatenate([pose.position, quaternion(pose.rotation), q])
        data.qvel[:] = np.concatenate([twist.velocity, twist.omega, speed])
        data.qacc[:] = np.concatenate([twist.acceleration, twist.alpha, acceleration])
        mujoco.mj_inverse(model, data)
        needed = data.qfrc_inverse[:6] + np.asarray(slopes(jnp.zeros(6), pose)).T @ data.qfrc_inverse[6:]
        expected = np.linalg.solve(np.asarray(of_lengths(platform, pose)).T, needed)
        leg_forces = forces(platform, BODY, pose, twist, jnp.array(GRAVITY))
        np.testing.assert_allclose(leg_forces, expected, rtol=0, atol=1e-7)


def test_accelerations_are_the_lengths_second_differences(generator):
    platform = small()
    pose, twist, h = somewhere(generator, platform), moving(generator), 1e-4
    at = jax.jit(lambda x: pf.lengths(platform, pf.moved(pose, twist, x)))
    before, now, after = (np.asarray(at(x)) for x in (-h, 0.0, h))
    kinematics = legs(platform, pose, twist)
    np.testing.assert_allclose(kinematics.acceleration, (after - 2 * now + before) / h**2, rtol=0, atol=1e-6)
    np.testing.assert_allclose(
        kinematics.speed, pf.jacobian(platform, pose) @ np.hstack([twist.velocity, twist.omega]), atol=1e-12
    )


def test_a_level_platform_at_rest_carries_its_weight():
    platform = small(plate=PLATE, cylinder=CYLINDER, rod=ROD)
    still = Twist(*[jnp.zeros(3)] * 4)
    push = forces(platform, BODY, platform.home_pose, still, jnp.array(GRAVITY))
    along = np.asarray(pf.vectors(platform, platform.home_pose))
    up = (push * along[:, 2] / np.linalg.norm(along, axis=1)).sum()
    assert (PLATE.mass + BODY.mass) * GRAVITY < up < (PLATE.mass + BODY.mass + 6 * 4.2) * GRAVITY


def test_a_platform_above_its_own_shadow_is_singular():
    """Fichter's case: platform and base alike and turned by 90 degrees."""
    platform = small()
    shadow = pf.StewartPlatform(
        platform.base, platform.base, platform.home, platform.plate, platform.cylinder, platform.rod
    )
    turned = Pose(shadow.home, exponential(jnp.array([0.0, 0.0, np.pi / 2])))
    assert np.linalg.svd(pf.jacobian(shadow, turned), compute_uv=False)[-1] < 1e-8
    assert np.linalg.svd(pf.jacobian(platform, platform.home_pose), compute_uv=False)[-1] > 0.01


def test_joint_angles():
    platform = small()
    angles = jax.jit(pf.joint_angles)
    base, top = angles(platform, platform.home_pose)
    np.testing.assert_allclose([base, top], 0, atol=1e-15)
    tilted = Pose(platform.home, exponential(jnp.array([0.1, 0.0, 0.0])))
    along, turned = (np.asarray(pf.vectors(platform, at)) for at in (platform.home_pose, tilted))
    cosine = (along * turned).sum(axis=1) / np.linalg.norm(along, axis=1) / np.linalg.norm(turned, axis=1)
    np.testing.assert_allclose(angles(platform, tilted)[0], np.arccos(cosine), atol=1e-7)
    slope = jax.grad(lambda z: pf.joint_angles(platform, Pose(platform.home + z, jnp.eye(3)))[0].sum())
    assert np.isfinite(jax.jit(slope)(jnp.zeros(3))).all()


@pytest.mark.parametrize("what", ["length", "force"])
def test_derivatives_are_those_of_differences(generator, what):
    platform = small(plate=PLATE, cylinder=CYLINDER, rod=ROD)
    pose, twist = somewhere(generator, platform), moving(generator)

    def value(shift):
        at = Pose(pose.position + shift, pose.rotation)
        if what == "length":
            return pf.lengths(platform, at)[0]
        return pf.forces(platform, BODY, at, twist, jnp.array(GRAVITY))[0]

    h, number = 1e-5, jax.jit(value)
    differences = [(number(h * e) - number(-h * e)) / (2 * h) for e in np.eye(3)]
    np.testing.assert_allclose(jax.jit(jax.grad(value))(jnp.zeros(3)), differences, rtol=1e-6)
