"""The paper's trajectories: spheres, rest at the ends, exact derivative, attitude, the still centre of gravity."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import cumulative_simpson, solve_ivp

from identify.motion.attitude import attitude
from identify.motion.trajectory import sample
from identify.rigid_body.dynamics import acceleration_at

W, A = 0.425, 4.0


@pytest.fixture(params=["T1", "T3"])
def trajectory(request, preset):
    return preset.trajectories[request.param].trajectory


def test_starts_and_ends_at_rest_with_its_derivatives(trajectory):
    ends = jnp.array([0.0, float(trajectory.duration)])
    for function in (trajectory.omega, trajectory.alpha, jax.jacfwd(trajectory.alpha)):
        np.testing.assert_allclose(jax.jit(jax.vmap(function))(ends), 0, atol=1e-12)


def test_alpha_is_the_derivative_of_omega(trajectory):
    t = jnp.linspace(1.0, float(trajectory.duration) - 1, 501)
    h = 1e-4
    difference = (jax.jit(jax.vmap(trajectory.omega))(t + h) - jax.jit(jax.vmap(trajectory.omega))(t - h)) / (2 * h)
    # central difference: error (Ω h)²/6 · A = 6e-7 rad/s²
    np.testing.assert_allclose(jax.jit(jax.vmap(trajectory.alpha))(t), difference, atol=2e-6)


def test_omega_and_alpha_trace_their_spheres(preset):
    trajectory = preset.trajectories["T1"].trajectory
    t = jnp.linspace(30.0, 150.0, 4001)  # between the ramps
    omega, alpha = jax.jit(jax.vmap(trajectory.omega))(t), jax.jit(jax.vmap(trajectory.alpha))(t)
    # the precession shifts the spiral's two frequencies by ε/Ω = 3.7 %
    np.testing.assert_allclose(jnp.linalg.norm(omega, axis=1), W, rtol=0.04)
    np.testing.assert_allclose(jnp.linalg.norm(alpha, axis=1), A, rtol=1e-9)
    for axis in range(3):
        assert alpha[:, axis].max() > 0.98 * A
        assert alpha[:, axis].min() < -0.98 * A


def test_simple_motions_turn_about_one_axis_at_a_time(preset):
    trajectory = preset.trajectories["T3"].trajectory
    t = jnp.linspace(0.0, 180.0, 3601)
    omega = np.asarray(jax.jit(jax.vmap(trajectory.omega))(t))
    segment = np.minimum((t / 60.0).astype(int), 2)
    for axis in range(3):
        np.testing.assert_allclose(omega[segment != axis, axis], 0, atol=1e-12)
        np.testing.assert_allclose(np.abs(omega[segment == axis, axis]).max(), W, rtol=1e-3)


def test_attitude_solves_its_differential_equation(trajectory):
    t = jnp.arange(0.0, 4.0, 1 / 400) + 40.0
    omega = jax.jit(lambda t: trajectory.omega(t))

    def slope(time, flat):
        w1, w2, w3 = np.asarray(omega(jnp.asarray(time)))
        return (flat.reshape(3, 3) @ np.array([[0, -w3, w2], [w3, 0, -w1], [-w2, w1, 0]])).ravel()

    solution = solve_ivp(slope, (40.0, float(t[-1])), np.eye(3).ravel(), t_eval=t[::100], rtol=1e-9, atol=1e-10)
    turned = np.asarray(jax.jit(lambda t: attitude(trajectory.omega, t))(t))
    np.testing.assert_allclose(turned[::100].reshape(-1, 9), solution.y.T, atol=3e-8)


@pytest.mark.parametrize("name", ["T1", "T3"])
def test_the_platforms_closed_form_is_the_double_integral_of_12(preset, name):
    trajectory, offset = preset.trajectories[name].trajectory, jnp.array([0.0, 0.0, 0.11])
    t = jnp.arange(0.0, 180.0, 1 / 400)
    motion = sample(trajectory, t, r_cg_from_still=np.zeros(3), gravity=np.array(9.81))
    in_body = jax.jit(jax.vmap(acceleration_at, in_axes=(None, 1, 1)))(-offset, motion.omega, motion.alpha)
    acceleration = np.einsum("nij,nj->ni", motion.rotation, in_body)
    velocity = cumulative_simpson(acceleration, x=np.asarray(t), axis=0, initial=0)
    position = cumulative_simpson(velocity, x=np.asarray(t), axis=0, initial=0)
    closed = -motion.rotation @ offset
    closed = np.asarray(closed)
    np.testing.assert_allclose(position, closed - closed[0], atol=2e-7)


def test_gravity_turns_with_the_body_and_the_still_point_does_not_accelerate(preset):
    spec = preset.trajectories["T2"]
    t = jnp.arange(0.0, 60.0, 1 / 400)
    still_cg = sample(spec.trajectory, t, r_cg_from_still=np.zeros(3), gravity=np.array(9.81))
    np.testing.assert_allclose(jnp.linalg.norm(still_cg.specific_force_cg, axis=0), 9.81, rtol=1e-12)
    np.testing.assert_allclose(still_cg.specific_force_cg[:, 0], [0, 0, 9.81])
    still_omb = sample(spec.trajectory, t, r_cg_from_still=np.array([0, 0, 0.11]), gravity=np.array(9.81))
    position = np.einsum("nij,j->ni", still_omb.rotation, [0, 0, 0.11])  # of the CG from the still OMB, in A
    h = 1 / 400
    acceleration = (position[2:] - 2 * position[1:-1] + position[:-2]) / h**2
    specific = np.einsum("nji,nj->ni", still_omb.rotation[1:-1], acceleration + [0, 0, 9.81])
    np.testing.assert_allclose(still_omb.specific_force_cg[:, 1:-1].T, specific, atol=1e-3)
