"""Normal equations of many trials in plain arithmetic, against :mod:`identify.estimators.gram` and NumPy, trial by trial."""

import jax.numpy as jnp
import numpy as np
import pytest

from identify.estimators.gram import normal_equations, solve
from identify.rigid_body.regressor import OMEGA_R_OF_FEATURES, features
from tests.gram_lab import accumulate, with_offsets
from uq.gram_sums import plain_solve, sum_equations

TRIALS, SAMPLES = 3, 40


@pytest.fixture(scope="module")
def signals():
    """Omega, alpha, force, moment of some trials, (trials, 3, samples)."""
    generator = np.random.default_rng(31)
    return generator.normal(size=(4, TRIALS, 3, SAMPLES))


@pytest.fixture(scope="module")
def sums(signals):
    """The sums that are kept, by their factors, summed sample by sample."""
    rows = signals.swapaxes(0, 1).reshape(TRIALS, 12, SAMPLES)
    return {
        factors: jnp.asarray(np.prod(rows[:, list(factors)], axis=1).sum(axis=-1))
        for factors in sum_equations.TRIAL_SUMS
    }


@pytest.fixture(scope="module")
def offsets():
    generator = np.random.default_rng(32)
    return {name: generator.normal(size=(size, TRIALS)) for name, size in (("gyro", 3), ("cell", 6), ("r_cg", 3))}


def shifted(sums, offsets):
    with_residuals = sums | sum_equations.residual_sums(
        sums, jnp.asarray(offsets["r_cg"]), jnp.asarray(offsets["cell"])
    )
    powers = sum_equations.powers_of(jnp.asarray(offsets["gyro"]))
    wanted = [(*sum_equations.PHI[k], y) for k in sum_equations.OF_OMEGA_R for y in sum_equations.RESIDUAL]
    return {w: sum_equations.shifted(with_residuals, powers, w) for w in (*sum_equations.MATRIX_SUMS, *wanted)}


def of_trial(signals, offsets, trial):
    """The same trial's sums with all offsets, its features shifted one trial at a time."""
    sums = accumulate(*(jnp.asarray(signals[k, trial]) for k in range(4)))
    gyro, cell = (jnp.asarray(offsets[name][:, trial]) for name in ("gyro", "cell"))
    return with_offsets(sums, gyro, cell[:3], cell[3:])


def full(lower):
    matrix = np.zeros((TRIALS, 6, 6))
    for (i, j), entry in lower.items():
        matrix[:, i, j] = matrix[:, j, i] = np.asarray(entry)
    return matrix


def test_normal_equations_with_every_offset(signals, sums, offsets):
    shifted_sums = shifted(sums, offsets)
    matrix = full(sum_equations.normal_matrix(shifted_sums))
    right = np.stack(sum_equations.right_side(shifted_sums), axis=1)
    for trial in range(TRIALS):
        reference = normal_equations(of_trial(signals, offsets, trial), jnp.asarray(offsets["r_cg"][:, trial]))
        np.testing.assert_allclose(matrix[trial], reference[0], rtol=1e-11, atol=1e-10)
        np.testing.assert_allclose(right[trial], reference[1], rtol=1e-11, atol=1e-10)


def test_weighted_matrix_is_that_of_rows(signals, sums):
    """``Σ Ωᵀ S Ω`` from the rows of Omega_R at each sample, with S the covariance of ``M - r × F``."""
    generator = np.random.default_rng(33)
    root = generator.normal(size=(6, 6))
    cell, r = root @ root.T, generator.normal(size=(3, TRIALS))
    weight = sum_equations.residual_covariance(jnp.asarray(cell)[:, :, None], list(jnp.asarray(r)))
    weighted = full(sum_equations.weighted_matrix(sums, weight))
    for trial in range(TRIALS):
        rows = np.einsum("kn,kai->nai", features(*jnp.asarray(signals[:2, trial])), OMEGA_R_OF_FEATURES)
        x, y, z = r[:, trial]
        of_residual = np.hstack([-np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]), np.eye(3)])
        reference = np.einsum("nai,ab,nbj->ij", rows, of_residual @ cell @ of_residual.T, rows)
        np.testing.assert_allclose(weighted[trial], reference, rtol=1e-11)


def test_solution_and_root(signals, sums):
    lower = sum_equations.normal_matrix(sums)
    matrix = full(lower)
    right = np.random.default_rng(34).normal(size=(6, TRIALS))
    solution, ok = plain_solve.solve(lower, list(jnp.asarray(right)))
    assert ok.all()
    np.testing.assert_allclose(
        np.stack(solution, axis=1), np.linalg.solve(matrix, right.T[:, :, None])[:, :, 0], rtol=1e-9
    )
    noise = plain_solve.times_root(lower, list(jnp.asarray(right)))
    expected = np.einsum("tij,jt->ti", np.linalg.cholesky(matrix), right)
    np.testing.assert_allclose(np.stack(noise, axis=1), expected, rtol=1e-9)


def test_what_cannot_be_solved_is_said(signals):
    """Omega about one axis: as identify.estimators.gram, which refuses by the same condition number."""
    still = np.zeros((4, 3, SAMPLES))
    still[0, 0], still[1, 0] = signals[0, 0, 0], signals[1, 0, 0]
    rows = still.reshape(12, SAMPLES)
    sums = {f: jnp.asarray([np.prod(rows[list(f)], axis=0).sum()]) for f in sum_equations.TRIAL_SUMS}
    _, ok = plain_solve.solve(sum_equations.normal_matrix(sums), [jnp.ones(1)] * 6)
    assert not ok.any()
    assert not solve(accumulate(*map(jnp.asarray, still)), jnp.zeros(3)).ok


def test_a_covariance_of_zero_has_the_root_zero():
    zero = {place: jnp.zeros(2) for place in plain_solve.LOWER}
    assert not np.any(plain_solve.times_root(zero, [jnp.ones(2)] * 6))
