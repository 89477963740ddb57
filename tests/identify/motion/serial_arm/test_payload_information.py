"""What a wrist sensor learns, against the scatter of plain least squares and the parallel-axis theorem."""

import jax
import jax.numpy as jnp
import numpy as np

from identify.motion.serial_arm.payload_information import about_cg, about_q, covariance_about_cg, information
from identify.motion.serial_arm.serial_chain import LinkMotion
from identify.rigid_body.inertia import Body
from identify.rigid_body.regressor import wrench_regressor

BODY = Body(np.array(2.0), np.array([0.03, -0.05, 0.06]), np.array([0.02, 0.003, -0.002, 0.017, 0.001, 0.011]))
told_by = jax.jit(information)


def test_the_parameters_about_q_and_back():
    at_q = np.asarray(about_q(BODY))
    x, y, z = 0.03, -0.05, 0.06
    np.testing.assert_allclose(at_q[:5], [2, 0.06, -0.1, 0.12, 0.02 + 2 * (y * y + z * z)])
    np.testing.assert_allclose(at_q[5], 0.003 - 2 * x * y)
    np.testing.assert_allclose(about_cg(jnp.asarray(at_q)), [2, x, y, z, *BODY.inertia], atol=1e-15)


def test_the_covariance_is_that_of_least_squares(generator):
    """2,000 estimates of 150 samples with correlated noise and unknown offsets; a variance is off by 3.2 % (1 σ)."""
    omega, alpha, force = generator.normal(size=(3, 150, 3)) * np.array([2.0, 20.0, 10.0])[:, None, None]
    root = np.diag([0.1] * 3 + [0.005] * 3) + 1e-3 * generator.normal(size=(6, 6))
    motion = LinkMotion(*map(jnp.asarray, (omega, alpha, force)))
    told = told_by(motion, jnp.ones(150), root @ root.T)
    expected = np.asarray(jax.jit(covariance_about_cg)(told, BODY))
    rows = np.asarray(jax.jit(jax.vmap(wrench_regressor))(*motion))
    whiten = np.linalg.inv(root)
    columns = np.concatenate([np.concatenate([whiten @ row, whiten], axis=1) for row in rows])
    truth = np.concatenate([about_q(BODY), np.arange(6.0)])
    noise = generator.normal(size=(2000, 900))
    estimates = (columns @ truth + noise) @ np.linalg.pinv(columns).T
    scatter = np.asarray(jax.jit(jax.vmap(about_cg))(jnp.asarray(estimates[:, :10])))
    np.testing.assert_allclose(scatter.std(axis=0), np.sqrt(np.diag(expected)), rtol=0.08)  # 5 standard errors


def test_offsets_cost_what_the_mean_told():
    """Where nothing but gravity acts and the tool rests, nothing is known: the offsets explain it all."""
    rest = jnp.zeros((150, 3))
    motion = LinkMotion(rest, rest, jnp.tile(jnp.array([0.0, 0.0, 9.81]), (150, 1)))
    np.testing.assert_allclose(told_by(motion, jnp.ones(150), np.eye(6)), 0, atol=1e-9)
