"""Sums against rows: the same estimate as QR, exact offsets, additive over blocks."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from identify.identification import identify
from identify.least_squares.gram import Sums, normal_equations, ordinary_least_squares, solve, solve_normal
from identify.rigid_body.regressor import omega_r
from identify.signals.estimator_spec import EstimatorSpec
from identify.signals.run import Run, numbers
from tests.helpers.gram_lab import accumulate


@pytest.fixture
def samples(generator):
    """omega, alpha, force, moment, component first."""
    return [jnp.asarray(generator.normal(size=(3, 500))) for _ in range(4)]


R = jnp.array([0.01, -0.02, 0.053])


def test_sums_solve_as_qr_does(samples):
    omega, alpha, force, moment = samples
    rows = np.asarray(jax.jit(jax.vmap(omega_r, in_axes=1))(omega, alpha)).reshape(-1, 6)
    by_qr = np.linalg.lstsq(rows, np.asarray((moment - jnp.cross(R[:, None], force, axis=0)).T).ravel())[0]
    condition = np.linalg.cond(rows)
    by_sums = jax.jit(solve)(accumulate(*samples), R)
    np.testing.assert_allclose(by_sums.inertia, by_qr, rtol=1e-10)
    assert condition**2 <= by_sums.condition <= 6 * condition**2
    assert by_sums.ok


def test_sums_add_over_blocks(samples):
    whole = accumulate(*samples)
    parts = [accumulate(*(s[:, part] for s in samples)) for part in (slice(0, 123), slice(123, None))]
    for sums, added in zip(whole, jax.tree.map(jnp.add, *parts), strict=True):
        np.testing.assert_allclose(sums, added, atol=1e-11)


def test_normal_equations_are_those_of_the_rows(samples):
    omega, alpha, force, moment = samples
    rows = np.asarray(jax.jit(jax.vmap(omega_r, in_axes=1))(omega, alpha)).reshape(-1, 6)
    matrix, right = normal_equations(accumulate(*samples), R)
    y = np.asarray(moment - jnp.cross(R[:, None], force, axis=0)).T.ravel()
    np.testing.assert_allclose(matrix, rows.T @ rows, atol=1e-9)
    np.testing.assert_allclose(right, rows.T @ y, atol=1e-9)


def test_what_cannot_be_solved_is_nan_and_not_ok_and_spares_its_neighbours(samples):
    omega, alpha, force, moment = samples
    one_axis = jnp.array([[1.0], [0.0], [0.0]])
    good, bad = accumulate(*samples), accumulate(omega * one_axis, alpha * one_axis, force, moment)
    both = Sums(*(jnp.stack(pair) for pair in zip(good, bad, strict=True)))
    estimate = jax.jit(jax.vmap(solve, in_axes=(0, None)))(both, R)
    assert estimate.ok.tolist() == [True, False]
    assert jnp.isfinite(estimate.inertia[0]).all()
    assert jnp.isnan(estimate.inertia[1]).all()


CENTRAL, SMOOTHED = EstimatorSpec("central", "central"), EstimatorSpec("both", "savitzky-golay", window=5, lowpass=20.0)


@pytest.mark.parametrize("offsets", ["estimate", "none"])
def test_from_arrays_to_the_tensor_as_numpy_fits_the_same_rows(samples, offsets):
    """Oracle: ``numpy.linalg.lstsq`` on rows of central differences, a constant moment on each axis as three columns."""
    omega, _, force, moment = (np.asarray(signal).T for signal in samples)
    alpha, inner = (omega[2:] - omega[:-2]) * 50.0, slice(1, -1)
    rows = np.asarray(jax.jit(jax.vmap(omega_r))(omega[inner], alpha))
    constants = np.broadcast_to(np.eye(3), (len(rows), 3, 3))
    columns = np.concatenate([rows, constants], axis=2) if offsets == "estimate" else rows
    values = moment[inner] - np.cross(np.asarray(R), force[inner])
    expected = np.linalg.lstsq(columns.reshape(-1, columns.shape[2]), values.ravel(), rcond=None)[0][:6]
    tensor = ordinary_least_squares(
        force, moment, omega, rate=100.0, r_cg=np.asarray(R), estimator=CENTRAL, offsets=offsets
    )
    np.testing.assert_allclose(tensor, expected, rtol=1e-9)


def test_it_is_the_estimate_of_identify(samples):
    noise = np.asarray(samples[3]).T
    omega = np.sin(np.outer(np.arange(len(noise)), [0.09, 0.08, 0.07]))
    moment = np.gradient(omega, 0.01, axis=0) + 0.1 * noise  # near a unit tensor, which a body may have
    tensor = ordinary_least_squares(noise, moment, omega, rate=100.0, r_cg=R, estimator=SMOOTHED)
    run = Run.from_arrays(np.arange(len(omega)) / 100, noise, moment, omega)
    result = identify(run, r_cg=np.asarray(R), estimator=SMOOTHED, method="source")
    np.testing.assert_allclose(tensor, result.inertia, rtol=1e-9)


def test_arrays_that_cannot_be_used_are_named(samples):
    force, moment, omega, _ = (signal.T for signal in samples)
    how = {"rate": 100.0, "r_cg": R, "estimator": CENTRAL}
    with pytest.raises(
        ValueError, match=r"^Argument `moment` must have shape \(n, 3\), n the same of all, but has \(9, 3\)"
    ):
        ordinary_least_squares(force, moment[:9], omega, **how)
    with pytest.raises(ValueError, match=r"^Argument `r_cg` must have shape \(3,\), but has \(2,\)"):
        ordinary_least_squares(force, moment, omega, **{**how, "r_cg": R[:2]})
    with pytest.raises(ValueError, match=r"^Argument `signal` must have more than 2 samples"):
        ordinary_least_squares(force[:2], moment[:2], omega[:2], **how)
    with pytest.raises(ValueError, match=r"^Argument `rate` must be a number that JAX does not trace"):
        jax.jit(lambda rate: ordinary_least_squares(force, moment, omega, **{**how, "rate": rate}))(100.0)
    still = ordinary_least_squares(force, moment, 0 * omega, **how)
    assert jnp.isnan(still).all()


def test_identify_names_it_where_jax_traces_its_arrays(samples):
    force, moment, omega, _ = (np.asarray(signal).T for signal in samples)
    t = np.arange(len(omega)) / 100
    with pytest.raises(TypeError, match=r"^moment in run is traced by JAX, .*: use identify\.ordinary_least_squares"):
        jax.jacobian(lambda moment: Run.from_arrays(t, force, moment, omega).moment)(moment)
    with pytest.raises(TypeError, match=r"^r_cg is traced by JAX, .*: use identify\.ordinary_least_squares"):
        jax.jit(lambda height: numbers("r_cg", [0.0, 0.0, height]))(0.1)
    assert numbers("r_cg", jnp.ones(3)).tolist() == [1.0, 1.0, 1.0]


def test_equations_with_weights_held_fixed_are_not_symmetric(generator):
    """Oracle: NumPy; beside one another on a trailing axis, under vmap, and the derivative by the matrix."""
    matrices = generator.normal(size=(4, 9, 6))
    matrices = np.einsum("tki,tkj->tij", matrices, matrices + 0.1 * generator.normal(size=matrices.shape))
    right = generator.normal(size=(4, 6))
    expected = np.linalg.solve(matrices, right[..., None])[..., 0]
    trailing = jax.jit(solve_normal)(jnp.moveaxis(jnp.asarray(matrices), 0, -1), jnp.asarray(right.T))
    mapped = jax.jit(jax.vmap(solve_normal))(jnp.asarray(matrices), jnp.asarray(right))
    np.testing.assert_allclose(trailing.inertia.T, expected, rtol=1e-9)
    np.testing.assert_allclose(mapped.inertia, expected, rtol=1e-9)
    np.testing.assert_allclose(
        mapped.condition, np.linalg.norm(matrices, axis=(1, 2)) * np.linalg.norm(np.linalg.inv(matrices), axis=(1, 2))
    )
    change = generator.normal(size=(6, 6))
    solved = lambda m: solve_normal(m, right[0]).inertia  # noqa: E731
    slope = jax.jit(lambda m, by: jax.jvp(solved, (m,), (by,))[1])(matrices[0], change)
    np.testing.assert_allclose(slope, -np.linalg.solve(matrices[0], change @ expected[0]), rtol=1e-8)
