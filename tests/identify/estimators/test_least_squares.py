"""Least squares: against NumPy and the closed forms; the verdict on identifiability."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from identify.estimators.least_squares import excitation, generalised, ordinary, weighted
from identify.rigid_body.inertia import COMPONENTS
from identify.rigid_body.regressor import omega_r


@pytest.fixture
def rows(generator):
    omega, alpha = (jnp.asarray(generator.normal(size=(400, 3))) for _ in range(2))
    return jax.jit(jax.vmap(omega_r))(omega, alpha)


TRUE = jnp.array([0.38, 0.01, -0.02, 0.02, 0.005, 0.37])


def test_ordinary_is_numpys_with_the_textbook_covariance(rows, generator):
    values = rows @ TRUE + jnp.asarray(0.1 * generator.normal(size=(400, 3)))
    solution = ordinary(rows, values)
    stacked = np.asarray(rows).reshape(-1, 6)
    value, squares, _, singular = np.linalg.lstsq(stacked, np.asarray(values).ravel())
    np.testing.assert_allclose(solution.value, value, rtol=1e-12)
    np.testing.assert_allclose(
        solution.covariance, squares[0] / (1200 - 6) * np.linalg.inv(stacked.T @ stacked), rtol=1e-10
    )
    np.testing.assert_allclose(solution.condition, singular[0] / singular[-1], rtol=1e-12)
    np.testing.assert_allclose(solution.residuals, values - rows @ value, atol=1e-13)


def test_weighted_is_generalised_with_a_diagonal_covariance(rows, generator):
    sigma = jnp.array([0.1, 0.2, 0.4])
    values = rows @ TRUE + sigma[None] * jnp.asarray(generator.normal(size=(400, 3)))
    by_weights, by_covariance = weighted(rows, values, sigma), generalised(rows, values, jnp.diag(sigma**2))
    np.testing.assert_allclose(by_weights.value, by_covariance.value, rtol=1e-12)
    np.testing.assert_allclose(by_weights.covariance, by_covariance.covariance, rtol=1e-12)
    each = weighted(rows, values, jnp.broadcast_to(sigma, (400, 3)))
    np.testing.assert_allclose(by_weights.value, each.value, rtol=1e-12)


def test_generalised_is_gauss_markov_with_correlated_axes(rows, generator):
    root = generator.normal(size=(3, 3))
    covariance = root @ root.T
    values = np.asarray(rows @ TRUE) + generator.normal(size=(400, 3)) @ root.T
    solution = generalised(rows, jnp.asarray(values), jnp.asarray(covariance))
    big = np.kron(np.eye(400), np.linalg.inv(covariance))
    stacked = np.asarray(rows).reshape(-1, 6)
    information = stacked.T @ big @ stacked
    np.testing.assert_allclose(solution.covariance, np.linalg.inv(information), rtol=1e-9)
    np.testing.assert_allclose(
        solution.value, np.linalg.solve(information, stacked.T @ big @ values.ravel()), rtol=1e-9
    )


@pytest.mark.parametrize(
    ("axis", "blind"), [(0, {"I22", "I23", "I33"}), (1, {"I11", "I13", "I33"}), (2, {"I11", "I12", "I22"})]
)
def test_rotation_about_one_axis_leaves_three_components_unseen(axis, blind):
    t = jnp.linspace(0, 20, 2001)
    unit_axis = jnp.zeros((1, 3)).at[0, axis].set(1.0)
    omega, alpha = jnp.sin(t)[:, None] * unit_axis, jnp.cos(t)[:, None] * unit_axis
    rows = np.asarray(jax.jit(jax.vmap(omega_r))(omega, alpha)).reshape(-1, 6)
    verdict = excitation(jnp.asarray(rows.T @ rows), jnp.zeros((6, 6)))
    assert set(verdict.unidentifiable) == blind
    assert verdict.identifiable.sum() == 3


def test_noise_that_would_dilute_by_more_than_a_tenth_does_not_count_as_excitation(rows):
    stacked = np.asarray(rows).reshape(-1, 6)
    normal = jnp.asarray(stacked.T @ stacked)
    assert excitation(normal, 0.01 * normal).identifiable.all()
    assert set(excitation(normal, 0.2 * normal).unidentifiable) == set(COMPONENTS)
