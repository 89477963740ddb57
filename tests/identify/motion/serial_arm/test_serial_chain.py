"""The arm's poses, motions and efforts against Pinocchio's, on a chain of random links with a prismatic joint."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from identify.motion.serial_arm.joint_series import JointSeries
from identify.motion.serial_arm.serial_chain import SerialChain, driven, poses
from identify.rigid_body.inertia import Body, unpack

pin = pytest.importorskip("pinocchio")

PRISMATIC = (False, True, False, False)
GRAVITY = 9.81
BODY = Body(np.array(2.0), np.array([0.03, -0.05, 0.06]), np.array([0.02, 0.003, -0.002, 0.017, 0.001, 0.011]))


@pytest.fixture(scope="module")
def chain():
    rng, n = np.random.default_rng(61), len(PRISMATIC)
    axis = rng.normal(size=(n, 3))
    root = rng.normal(size=(n, 3, 3)) * 0.1
    tensors = np.einsum("nij,nkj->nik", root, root) + 0.01 * np.eye(3)
    return SerialChain(
        Rotation.random(n, rng=rng).as_matrix(), rng.normal(size=(n, 3)), axis / np.linalg.norm(axis, axis=1)[:, None],
        Rotation.random(rng=rng).as_matrix(), rng.normal(size=3), rng.uniform(1, 4, n), 0.2 * rng.normal(size=(n, 3)),
        tensors[:, *np.triu_indices(3)], PRISMATIC,
    )  # fmt: skip


@pytest.fixture(scope="module")
def model(chain):
    """The same chain in Pinocchio, the body fixed to its tool."""
    model, joint = pin.Model(), 0
    for k, slides in enumerate(PRISMATIC):
        kind = pin.JointModelPrismaticUnaligned if slides else pin.JointModelRevoluteUnaligned
        joint = model.addJoint(joint, kind(chain.axis[k]), pin.SE3(chain.rotation[k], chain.position[k]), f"j{k}")
        tensor = np.array(unpack(chain.inertia[k]))
        model.appendBodyToJoint(joint, pin.Inertia(chain.mass[k], chain.r_cg[k], tensor), pin.SE3.Identity())
    tool = pin.SE3(chain.tool_rotation, chain.tool_position)
    model.addFrame(pin.Frame("tool", joint, tool, pin.FrameType.OP_FRAME))
    model.appendBodyToJoint(
        joint, pin.Inertia(float(BODY.mass), BODY.r_cg_from_q, np.array(unpack(BODY.inertia))), tool
    )
    model.gravity.linear = np.array([0, 0, -GRAVITY])
    return model


def test_poses_motion_and_efforts_are_pinocchios(chain, model, generator):
    q, speed, acceleration = generator.normal(size=(3, 4))
    data, frame = model.createData(), model.getFrameId("tool")
    effort = pin.rnea(model, data, q, speed, acceleration)
    pin.forwardKinematics(model, data, q, speed, acceleration)
    pin.updateFramePlacements(model, data)
    at = poses(chain, jnp.asarray(q))
    np.testing.assert_allclose(at.position[-1], data.oMf[frame].translation, atol=1e-12)
    np.testing.assert_allclose(at.rotation[-1], data.oMf[frame].rotation, atol=1e-12)
    np.testing.assert_allclose(at.position[2], data.oMi[3].translation, atol=1e-12)
    ours = jax.jit(lambda *at: driven(chain, *at, BODY, GRAVITY))(q, speed, acceleration)
    up = data.oMf[frame].rotation.T @ [0, 0, GRAVITY]
    np.testing.assert_allclose(ours.tool.omega, pin.getFrameVelocity(model, data, frame, pin.LOCAL).angular, atol=1e-12)
    classical = pin.getFrameClassicalAcceleration(model, data, frame, pin.LOCAL)
    np.testing.assert_allclose(ours.tool.alpha, classical.angular, atol=1e-11)
    np.testing.assert_allclose(ours.tool.specific_force, classical.linear + up, atol=1e-11)
    np.testing.assert_allclose(ours.effort, effort, atol=1e-10)


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
