"""Omega_R and the wrench regressor: against the definition, and against MuJoCo's inverse dynamics."""

import subprocess
import sys

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from identify.rigid_body.dynamics import acceleration_at, wrench
from identify.rigid_body.inertia import Body, parallel_axis, unpack
from identify.rigid_body.regressor import (
    FIRST_MOMENT_OF_FEATURES,
    OMEGA_R_OF_FEATURES,
    PI_OF_FORCE,
    cross_matrix,
    features,
    omega_r,
    pi,
    wrench_regressor,
)

mujoco = pytest.importorskip("mujoco")


@pytest.fixture
def motion(generator):
    return jnp.asarray(generator.normal(size=3)), jnp.asarray(generator.normal(size=3))


@pytest.fixture
def body(generator):
    points, masses = generator.normal(size=(6, 3)), generator.uniform(0.5, 1, 6)
    points -= masses @ points / masses.sum()
    tensor = sum(m * (p @ p * np.eye(3) - np.outer(p, p)) for m, p in zip(masses, points, strict=True))
    inertia = jnp.asarray(tensor[np.triu_indices(3)])
    return Body(jnp.asarray(masses.sum()), jnp.asarray(generator.normal(size=3)), inertia)


def test_omega_r_is_the_definition(motion, body):
    omega, alpha = motion
    tensor = unpack(body.inertia)
    expected = tensor @ alpha + jnp.cross(omega, tensor @ omega)
    np.testing.assert_allclose(omega_r(omega, alpha) @ body.inertia, expected, atol=1e-12)


def test_omega_r_is_linear_in_the_features(motion):
    from_features = jnp.einsum("k,kij->ij", features(*motion), jnp.asarray(OMEGA_R_OF_FEATURES))
    np.testing.assert_allclose(from_features, omega_r(*motion), atol=1e-15)


def test_pi_is_the_cross_product(motion):
    force, r = motion
    np.testing.assert_allclose(pi(force) @ r, jnp.cross(r, force), atol=1e-15)
    np.testing.assert_allclose(
        jnp.einsum("k,kij->ij", force, jnp.asarray(PI_OF_FORCE)) @ r, jnp.cross(r, force), atol=1e-15
    )


def test_the_first_moment_is_linear_in_the_features(motion):
    omega, alpha = motion
    spin = cross_matrix(omega)
    from_features = jnp.einsum("k,kij->ij", features(omega, alpha), jnp.asarray(FIRST_MOMENT_OF_FEATURES))
    np.testing.assert_allclose(from_features, cross_matrix(alpha) + spin @ spin, atol=1e-15)


def test_numpy_arrays_give_the_same_as_numpy_arrays(motion):
    plain = [np.asarray(x) for x in motion]
    for function in (features, omega_r, lambda w, a: wrench_regressor(w, a, w + a)):
        rows = function(*plain)
        assert type(rows) is np.ndarray
        np.testing.assert_allclose(rows, function(*motion), rtol=1e-15, atol=1e-16)


def test_the_tables_need_no_jax():
    """`inertia inspect` reads them, and would wait for JAX twice as long as for everything else."""
    code = "import sys, identify.rigid_body.regressor, identify.rigid_body.rotation; sys.exit('jax' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


@pytest.mark.parametrize("batch", [(), (1,), (3, 1, 2)])
def test_one_sample_in_its_rows_out_over_any_batch(generator, batch):
    omega, alpha = (jnp.asarray(generator.normal(size=(*batch, 3))) for _ in range(2))
    function = omega_r
    for _ in batch:
        function = jax.vmap(function)
    rows = function(omega, alpha)
    assert rows.shape == (*batch, 3, 6)
    first = (0,) * len(batch)
    np.testing.assert_array_equal(rows[first], omega_r(omega[first], alpha[first]))


def of_mujoco(body, q, velocity, acceleration):
    """Force and moment on a body on a free joint at Q, in its axes, by MuJoCo's inverse dynamics."""
    spec = mujoco.MjSpec()
    spec.option.gravity = [0, 0, -9.81]
    link = spec.worldbody.add_body()
    link.add_freejoint()
    link.explicitinertial, link.mass, link.ipos = True, float(body.mass), np.asarray(body.r_cg_from_q)
    link.fullinertia = np.asarray(unpack(body.inertia))[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]]
    model = spec.compile()
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:], data.qacc[:] = q, velocity, acceleration
    mujoco.mj_inverse(model, data)
    return np.concatenate([data.xmat[1].reshape(3, 3).T @ data.qfrc_inverse[:3], data.qfrc_inverse[3:]])


def test_the_wrench_is_mujocos_and_the_regressors(body, motion, generator):
    omega, alpha = motion
    rotation, acceleration = Rotation.random(rng=generator), generator.normal(size=3)  # of Q, in the world's axes
    q = np.concatenate([generator.normal(size=3), rotation.as_quat(scalar_first=True)])
    theirs = of_mujoco(body, q, np.r_[np.zeros(3), omega], np.r_[acceleration, alpha])
    at_q = jnp.asarray(rotation.as_matrix().T @ (acceleration + [0, 0, 9.81]))
    at_cg = at_q + acceleration_at(body.r_cg_from_q, omega, alpha)
    ours = jnp.concatenate(wrench(body, omega, alpha, at_cg))
    np.testing.assert_allclose(ours, theirs, atol=1e-10)
    about_q = parallel_axis(body.inertia, body.mass, body.r_cg_from_q)
    parameters = jnp.concatenate([body.mass[None], body.mass * body.r_cg_from_q, about_q])
    np.testing.assert_allclose(wrench_regressor(omega, alpha, at_q) @ parameters, ours, atol=1e-10)


def test_a_body_at_rest_weighs_on_the_cell():
    body = Body(jnp.array(19.7), jnp.array([0.0, 0.0, 0.053]), jnp.ones(6))
    force, moment = wrench(body, jnp.zeros(3), jnp.zeros(3), jnp.array([0.0, 0.0, 9.81]))
    np.testing.assert_allclose(force, [0, 0, 19.7 * 9.81])
    np.testing.assert_allclose(moment, 0)
