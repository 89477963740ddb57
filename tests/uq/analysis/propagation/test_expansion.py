"""The expansion of the estimate: against automatic differentiation of what trials compute."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from identify.least_squares.gram import solve_normal
from identify.rigid_body.inertia import Body
from identify.rigid_body.regressor import omega_r
from uq.analysis.propagation.expansion import expand, map_series, tensor_of
from uq.monte_carlo.gram_sums.case_equations import (
    equations_of,
    feature_map,
    noise_expectation,
    sums_by_axes,
    symmetric,
    weighted_sums,
)
from uq.monte_carlo.gram_sums.error_maps import Platform, WrenchBasis, gyro_map
from uq.monte_carlo.gram_sums.noise_algebra import noise_algebra
from uq.monte_carlo.gram_sums.packed_equations import MATRIX, cell_scatter, equations_of_products, solution_series
from uq.monte_carlo.gram_sums.run_sums import FeatureSums, RunSums
from uq.sources.constant_errors import PLACES, no_errors, unravel

FIELDS = ("gyro_bias", "gyro_drift", "gyro_misalignment", "gyro_delay", "cell_scale", "cell_bias", "cell_drift", "r_cg")
BASIS, PLATFORM = WrenchBasis(time=True, motion=False), Platform(np.array(9.81), np.zeros(3))
BODY = Body(np.array(5.0), np.array([0.1, -0.2, 0.3]), np.array([1.0, 0.1, 0.0, 2.0, 0.2, 3.0]))
SIZE = sum(zero.size for zero in no_errors())
DRAWN = np.concatenate([np.arange(SIZE)[PLACES[field]] for field in FIELDS])


@pytest.fixture(scope="module")
def sums():
    """Sums of a run of 60 samples of no physics, whose elements are quadratic in a delay."""
    generator = np.random.default_rng(51)
    now, slope, twice = generator.normal(size=(3, 18, 60))
    now[0], slope[0], twice[0] = 1.0, 0.0, 0.0
    columns = np.concatenate([generator.normal(size=(7, 60)), np.ones((1, 60))])
    crossed, curved = slope @ now.T, twice @ now.T
    grams = now @ now.T, crossed + crossed.T, (curved + curved.T) / 2 + slope @ slope.T
    return RunSums(np.array(grams), np.array([now, slope, twice / 2]) @ columns.T)


@pytest.fixture(scope="module")
def noise():
    roots = np.random.default_rng(52).normal(size=(2, 3, 3))
    return noise_expectation(*(0.1 * roots @ roots.swapaxes(1, 2)))


def with_derivatives(function, at):
    """Its value, first and second derivatives, as one program: three take longer to compile."""
    slopes = jax.jacfwd(function)
    return jax.jit(lambda x: (function(x), slopes(x), jax.jacfwd(slopes)(x)))(at)


def test_its_derivatives_are_those_of_the_engines_equations(sums, noise):
    """All that a trial computes after its draws, by JAX; at errors as large as the signals."""
    generator = np.random.default_rng(53)
    expected, errors = 0.1 * generator.normal(size=SIZE), np.zeros((SIZE, 4))
    errors[DRAWN] = 0.1 * generator.normal(size=(len(DRAWN), 4))
    expected[np.setdiff1d(np.arange(SIZE), DRAWN)] = 0.0

    def estimate(numbers):
        e = unravel(expected + errors @ numbers)
        gram, wrench = (a + e.gyro_delay * b + e.gyro_delay**2 * c for a, b, c in (sums.gram, sums.wrench))
        equations = equations_of(
            FeatureSums(gram[..., None], wrench[:, :-1, None]),
            feature_map(gyro_map(e)[..., None], e.gyro_bias[:, None], e.gyro_drift[:, None]),
            noise,
            BASIS.map(BODY, PLATFORM, e)[..., None],
            e.cell_bias[:, None],
            (BODY.r_cg_from_q + e.r_cg)[:, None],
        )
        matrix = symmetric(jnp.sum(equations.by_axes[:3], axis=0))
        return solve_normal(matrix, equations.right).inertia[:, 0]

    maps = jax.tree.map(np.asarray, map_series(BODY, PLATFORM, BASIS, expected, errors, FIELDS))
    expansion, zero = expand(maps, sums, noise), np.zeros(4)
    value, jacobian, hessian = with_derivatives(estimate, zero)
    np.testing.assert_allclose(expansion.value, value, rtol=1e-9)
    np.testing.assert_allclose(expansion.jacobian, jacobian, rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(expansion.hessian, hessian, rtol=1e-7, atol=1e-9)


def some_equations():
    root = np.random.default_rng(54).normal(size=(6, 9))
    matrix = root @ root.T
    return np.concatenate([matrix[np.tril_indices(6)], np.random.default_rng(55).normal(size=6)])


def test_derivatives_of_the_solution_are_those_of_elimination():
    """Written out for ``x = A⁻¹ y``; by automatic differentiation of the solver that trials use."""
    equations = some_equations()
    value, first, second = solution_series(equations)
    expected, slopes, curvatures = with_derivatives(tensor_of, equations)
    np.testing.assert_allclose(value, expected, rtol=1e-9)
    np.testing.assert_allclose(first, slopes, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(second, curvatures, rtol=1e-8, atol=1e-12)


def test_a_singular_run_is_not_a_number():
    equations = np.zeros(27)
    for part in solution_series(equations):
        assert np.isnan(part).all()


def test_the_cells_scatter_is_that_of_the_engine():
    generator = np.random.default_rng(56)
    phi, cell, r = generator.normal(size=(9, 40)), generator.normal(size=(6, 6)), generator.normal(size=3)
    by_axes = sums_by_axes(jnp.asarray(phi @ phi.T))
    expected = symmetric(weighted_sums(by_axes, jnp.asarray(cell @ cell.T), jnp.asarray(r)))
    computed = cell_scatter(np.asarray(by_axes), cell @ cell.T, r)
    np.testing.assert_allclose(computed[21:, 21:], expected, rtol=1e-10, atol=1e-10)
    assert not computed[:21].any()


def test_equations_of_products_are_those_of_samples():
    """Two estimators: sums of ``ΩᵀΩ`` and ``Ωᵀ(M - r × F)``, sample by sample."""
    generator, algebra = np.random.default_rng(57), noise_algebra(2)
    signals, r = generator.normal(size=(15, 30)), generator.normal(size=3)
    products = np.array([np.sum(np.prod(signals[np.array(p, int)], axis=0)) for p in algebra.products])
    force, moment = signals[9:12], signals[12:]
    residual = moment - np.cross(r, force, axis=0)
    for estimator in range(2):
        rows = [omega_r(signals[:3, k], signals[3 + 3 * estimator : 6 + 3 * estimator, k]) for k in range(30)]
        matrix = sum(row.T @ row for row in rows)
        right = sum(row.T @ residual[:, k] for k, row in enumerate(rows))
        equations = equations_of_products(algebra, estimator, r) @ products
        np.testing.assert_allclose(np.tensordot(equations, MATRIX, 1), matrix, rtol=1e-10, atol=1e-10)
        np.testing.assert_allclose(equations[21:], right, rtol=1e-10, atol=1e-10)
