"""Normal equations of many trials at a time, against samples with the same errors, trial by trial."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from identify.least_squares.gram import normal_equations
from identify.rigid_body.regressor import OMEGA_R_OF_FEATURES, features
from tests.helpers.gram_lab import accumulate
from uq.monte_carlo.gram_sums.case_equations import (
    NO_NOISE,
    OF_OMEGA_R,
    FeatureSums,
    equations_of,
    feature_map,
    noise_expectation,
    noise_of_right_side,
    sums_by_axes,
    symmetric,
    weighted_sums,
)
from uq.monte_carlo.gram_sums.error_maps import true_elements
from uq.monte_carlo.gram_sums.packed_equations import packed_equations

TRIALS, SAMPLES = 3, 40


@pytest.fixture(scope="module")
def run():
    """Time, omega, alpha, wrench of one run."""
    generator = np.random.default_rng(31)
    return np.linspace(0, 2, SAMPLES), *generator.normal(size=(2, 3, SAMPLES)), generator.normal(size=(6, SAMPLES))


@pytest.fixture(scope="module")
def errors():
    """Errors of three trials, the trials last."""
    generator = np.random.default_rng(32)
    shapes = {"gyro": (3, 3), "bias": (3,), "drift": (3,), "cell": (6, 6), "cell_bias": (6,), "r_cg": (3,)}
    return {name: generator.normal(size=(*shape, TRIALS)) for name, shape in shapes.items()}


@pytest.mark.parametrize("drifts", [False, True])
def test_mapped_sums_are_those_of_samples_with_the_errors(run, errors, drifts):
    t, omega, alpha, wrench = run
    phi = np.concatenate([true_elements(omega, alpha, t)[: 15 if drifts else 10], alpha])
    sums = FeatureSums((phi @ phi.T)[..., None], (phi @ wrench.T)[..., None])

    @jax.jit
    def computed(sums, e):
        mapped = feature_map(e["gyro"], e["bias"], e["drift"] if drifts else None)
        equations = equations_of(sums, mapped, NO_NOISE, e["cell"], e["cell_bias"], e["r_cg"])
        return symmetric(equations.by_axes[:3].sum(axis=0)), equations.right

    matrix, right = computed(jax.tree.map(jnp.asarray, sums), errors)
    for k in range(TRIALS):
        own = {name: values[..., k] for name, values in errors.items()}
        slope = own["drift"] if drifts else np.zeros(3)
        sensed = own["gyro"] @ omega + own["bias"][:, None] + np.outer(slope, t)
        turned = own["gyro"] @ alpha + slope[:, None]
        seen = own["cell"] @ wrench + own["cell_bias"][:, None]
        expected = normal_equations(accumulate(sensed, turned, seen[:3], seen[3:]), jnp.asarray(own["r_cg"]))
        np.testing.assert_allclose(matrix[..., k], expected[0], rtol=1e-9, atol=1e-9)
        np.testing.assert_allclose(right[:, k], expected[1], rtol=1e-9, atol=1e-9)


def test_noise_of_the_right_side_has_the_covariance_of_independent_samples(run, errors):
    """Oracle: ``Σ Ωᵀ S Ω`` sample by sample, S the covariance of ``M - r × F``; the root's columns give it back."""
    _, omega, alpha, _ = run
    phi, r = features(omega, alpha), errors["r_cg"]
    cell = np.random.default_rng(33).normal(size=(6, 6))
    cell = cell @ cell.T
    by_axes = sums_by_axes(jnp.asarray((phi @ phi.T)[OF_OMEGA_R, OF_OMEGA_R])[..., None])
    covariance = weighted_sums(by_axes, jnp.asarray(cell)[..., None], jnp.asarray(r))
    columns = [noise_of_right_side(covariance, jnp.broadcast_to(unit[:, None], (6, TRIALS))) for unit in jnp.eye(6)]
    for k in range(TRIALS):
        r1, r2, r3 = r[:, k]
        residual = np.hstack([-np.array([[0, -r3, r2], [r3, 0, -r1], [-r2, r1, 0]]), np.eye(3)])
        regressor = np.einsum("kn,kij->nij", phi, OMEGA_R_OF_FEATURES)
        expected = np.einsum("nai,ab,nbj->ij", regressor, residual @ cell @ residual.T, regressor)
        root = np.stack([np.asarray(column)[:, k] for column in columns], axis=1)
        np.testing.assert_allclose(root @ root.T, expected, rtol=1e-9, atol=1e-9)


def test_no_noise_adds_nothing_and_no_nan():
    noise = lambda size: noise_of_right_side(size * jnp.zeros((21, 2)), jnp.ones((6, 2))).sum()  # noqa: E731
    zero, slope = jax.jit(jax.value_and_grad(noise))(1.0)
    assert zero == 0
    assert np.isfinite(slope)


def test_expected_sums_are_exact_for_noise_as_large_as_the_signal():
    """Oracle: Gauss and Hermite's cubature, exact for products of four noises; correlated axes, one sample."""
    generator = np.random.default_rng(34)
    omega, alpha = generator.normal(size=(2, 3, 1))
    roots = generator.normal(size=(2, 3, 3))
    nodes, weights = np.polynomial.hermite_e.hermegauss(3)
    points = np.array(list(itertools.product(nodes, repeat=6))).T
    weight = np.prod(list(itertools.product(weights / weights.sum(), repeat=6)), axis=1)
    phi = features(omega + roots[0] @ points[:3], alpha + roots[1] @ points[3:])
    gram, true = (phi * weight) @ phi.T, features(omega, alpha)
    noise = noise_expectation(*(roots @ roots.swapaxes(1, 2)))
    lower = np.tril_indices(9)
    added = (gram - true @ true.T)[OF_OMEGA_R, OF_OMEGA_R][lower]
    np.testing.assert_allclose(noise.gram @ true[:, 0], added, rtol=1e-10, atol=1e-10)
    np.testing.assert_allclose(noise.feature, (phi @ weight - true[:, 0])[OF_OMEGA_R], rtol=1e-10, atol=1e-10)
    residual = generator.normal(size=(3, 1))
    rows = np.einsum("kn,kij->nij", phi, OMEGA_R_OF_FEATURES)
    matrix = np.einsum("n,nai,naj->ij", weight, rows, rows)
    packed = packed_equations(true @ true.T, true @ residual.T, noise)
    np.testing.assert_allclose(packed[:21], matrix[np.tril_indices(6)], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(packed[21:], np.einsum("n,nai,a->i", weight, rows, residual[:, 0]), rtol=1e-9, atol=1e-9)


def test_the_second_order_alone_is_what_is_left_of_small_noise():
    roots = np.random.default_rng(35).normal(size=(2, 3, 3))
    sizes = 1e-10 * roots @ roots.swapaxes(1, 2)
    exact, second = (noise_expectation(*sizes, fourth_order=whole) for whole in (True, False))
    np.testing.assert_allclose(exact.gram, second.gram, atol=1e-6 * np.abs(second.gram).max())
    larger = [noise_expectation(*(1e10 * sizes), fourth_order=whole).gram for whole in (True, False)]
    np.testing.assert_allclose(larger[1], 1e10 * second.gram, rtol=1e-9)
    assert np.abs(larger[0] - larger[1]).max() > 0.1
