"""The arm's poses, motions and efforts against MuJoCo's, on a chain of random links with a prismatic joint."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from identify.motion.serial_arm.joint_series import JointSeries
from identify.motion.serial_arm.serial_chain import SerialChain, driven, poses
from identify.rigid_body.inertia import Body

mujoco = pytest.importorskip("mujoco")

PRISMATIC = (False, True, False, False)
GRAVITY = 9.81
BODY = Body(np.array(2.0), np.array([0.03, -0.05, 0.06]), np.array([0.02, 0.003, -0.002, 0.017, 0.001, 0.011]))


@pytest.fixture(scope="module")
def chain():
    rng, n = np.random.default_rng(61), len(PRISMATIC)
    axis = rng.normal(size=(n, 3))
    root = rng.normal(size=(n, 3, 3)) * 0.1
    moments = np.einsum("nij,nkj->nik", root, root)  # second ones, so that the tensors are of bodies
    tensors = np.trace(moments, axis1=1, axis2=2)[:, None, None] * np.eye(3) - moments
    return SerialChain(
        Rotation.random(n, rng=rng).as_matrix(), rng.normal(size=(n, 3)), axis / np.linalg.norm(axis, axis=1)[:, None],
        Rotation.random(rng=rng).as_matrix(), rng.normal(size=3), rng.uniform(1, 4, n), 0.2 * rng.normal(size=(n, 3)),
        tensors[:, *np.triu_indices(3)], PRISMATIC,
    )  # fmt: skip


def quaternion(rotation):
    return Rotation.from_matrix(rotation).as_quat(scalar_first=True)


def with_inertia(body, mass, r_cg, inertia):
    body.explicitinertial, body.mass, body.ipos = True, float(mass), np.asarray(r_cg)
    body.fullinertia = np.asarray(inertia)[[0, 3, 5, 1, 2, 4]]


@pytest.fixture(scope="module")
def model(chain):
    """The same chain in MuJoCo, the body fixed to its tool, with sensors at Q."""
    spec = mujoco.MjSpec()
    spec.option.gravity = [0, 0, -GRAVITY]
    link, kinds, sensors = spec.worldbody, mujoco.mjtJoint, mujoco.mjtSensor
    for k, slides in enumerate(PRISMATIC):
        link = link.add_body(name=f"link_{k}", pos=chain.position[k], quat=quaternion(chain.rotation[k]))
        link.add_joint(type=kinds.mjJNT_SLIDE if slides else kinds.mjJNT_HINGE, axis=chain.axis[k])
        with_inertia(link, chain.mass[k], chain.r_cg[k], chain.inertia[k])
    tool = link.add_body(name="tool", pos=chain.tool_position, quat=quaternion(chain.tool_rotation))
    with_inertia(tool, *BODY)
    tool.add_site(name="Q")
    for kind in (sensors.mjSENS_GYRO, sensors.mjSENS_FRAMEANGACC, sensors.mjSENS_ACCELEROMETER):
        spec.add_sensor(type=kind, objtype=mujoco.mjtObj.mjOBJ_SITE, objname="Q")
    return spec.compile()


def test_poses_motion_and_efforts_are_mujocos(chain, model, generator):
    q, speed, acceleration = generator.normal(size=(3, 4))
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:], data.qacc[:] = q, speed, acceleration
    mujoco.mj_inverse(model, data)
    at = poses(chain, jnp.asarray(q))
    turn = data.body("tool").xmat.reshape(3, 3)
    np.testing.assert_allclose(at.position[-1], data.body("tool").xpos, atol=1e-12)
    np.testing.assert_allclose(at.rotation[-1], turn, atol=1e-12)
    np.testing.assert_allclose(at.position[2], data.body("link_2").xpos, atol=1e-12)
    ours = jax.jit(lambda *at: driven(chain, *at, BODY, GRAVITY))(q, speed, acceleration)
    omega, alpha, specific_force = data.sensordata.reshape(3, 3)
    np.testing.assert_allclose(ours.tool.omega, omega, atol=1e-12)
    np.testing.assert_allclose(ours.tool.alpha, turn.T @ alpha, atol=1e-11)
    np.testing.assert_allclose(ours.tool.specific_force, specific_force, atol=1e-11)
    np.testing.assert_allclose(ours.effort, data.qfrc_inverse, atol=1e-10)


@pytest.mark.slow  # of the chain: MuJoCo's above; of the series: below
def test_the_motion_is_the_derivative_of_the_pose(chain):
    """Of the pose alone, by JAX: omega of R' = R [omega]×, the acceleration of Q by p''."""
    series = JointSeries(
        np.array([0.1, 0.2, -0.3, 0.4]), np.array([0.0, 1.3]), 0.2 * np.arange(8.0).reshape(4, 2),
        0.1 * np.ones((4, 2)), np.zeros(2), np.full(2, 3.0), 0.8,
    )  # fmt: skip
    t = jnp.asarray(0.5)  # within the ramp
    rates = (jnp.ones_like(t),)

    def tool(at):
        basis = series.basis(at)
        frames = poses(chain, series.home + jnp.einsum("ck,cnk->n", basis, series.amplitudes))
        return frames.rotation[-1], frames.position[-1]

    def slopes(at):
        (turn, _), (turning, velocity) = jax.jvp(tool, (at,), rates)
        hat = turn.T @ turning
        return jnp.array([hat[2, 1], hat[0, 2], hat[1, 0]]), velocity, turn

    (omega, _, turn), (alpha, acceleration, _) = jax.jit(lambda at: jax.jvp(slopes, (at,), rates))(t)
    states = series.states(t[None])
    ours = jax.jit(lambda *at: driven(chain, *at, BODY, GRAVITY).tool)(*(array[0] for array in states))
    np.testing.assert_allclose(ours.omega, omega, atol=1e-12)
    np.testing.assert_allclose(ours.alpha, alpha, atol=1e-10)
    upwards = np.array([0.0, 0.0, GRAVITY])
    np.testing.assert_allclose(ours.specific_force, turn.T @ (acceleration + upwards), atol=1e-10)


def test_a_series_starts_and_ends_at_home_at_rest():
    series = JointSeries(
        np.array([1.0, -2.0]), np.array([0.0, 0.5, 2.0]), np.ones((2, 3)), np.ones((2, 3)),
        np.array([0.0, 0.0, 4.0]), np.array([4.0, 4.0, 9.0]), 1.0,
    )  # fmt: skip
    assert series.duration == 9.0
    states = series.states(np.array([0.0, 4.0, 9.0, 2.0, 6.0]))
    np.testing.assert_allclose(states.position[:3], np.tile(series.home, (3, 1)), atol=1e-12)
    np.testing.assert_allclose(states.speed[:3], 0, atol=1e-12)
    np.testing.assert_allclose(states.acceleration[:3], 0, atol=1e-12)
    # between the ramps the sums themselves: 1 + cos π t + sin π t of the first stage, cos 4π t' + sin 4π t' of the second
    np.testing.assert_allclose(states.position[3] - series.home, 1 + np.cos(2 * np.pi) + np.sin(2 * np.pi))
    np.testing.assert_allclose(states.position[4] - series.home, np.cos(8 * np.pi) + np.sin(8 * np.pi))
    np.testing.assert_allclose(states.speed[3], np.pi)
    h = 1e-4  # within a ramp
    states = series.states(np.array([0.4 - h, 0.4, 0.4 + h, 0.0, 0.0]))
    np.testing.assert_allclose((states.position[2] - states.position[0]) / (2 * h), states.speed[1], rtol=1e-6)
    np.testing.assert_allclose((states.speed[2] - states.speed[0]) / (2 * h), states.acceleration[1], rtol=1e-6)
