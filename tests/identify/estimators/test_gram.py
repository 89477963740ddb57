"""Sums against rows: the same estimate as QR, exact offsets, additive over blocks."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from identify.estimators.gram import Sums, normal_equations, shift_omega, solve
from identify.estimators.least_squares import ordinary
from identify.rigid_body.regressor import features, omega_r
from tests.gram_lab import accumulate, with_offsets


@pytest.fixture
def samples(generator):
    """omega, alpha, force, moment, component first."""
    return [jnp.asarray(generator.normal(size=(3, 500))) for _ in range(4)]


R = jnp.array([0.01, -0.02, 0.053])


def test_sums_solve_as_qr_does(samples):
    omega, alpha, force, moment = samples
    rows = jax.jit(jax.vmap(omega_r, in_axes=1))(omega, alpha)
    by_qr = ordinary(rows, (moment - jnp.cross(R[:, None], force, axis=0)).T)
    by_sums = solve(accumulate(*samples), R)
    np.testing.assert_allclose(by_sums.inertia, by_qr.value, rtol=1e-10)
    assert by_qr.condition**2 <= by_sums.condition <= 6 * by_qr.condition**2
    assert by_sums.ok


def test_sums_add_over_blocks(samples):
    whole = accumulate(*samples)
    parts = [accumulate(*(s[:, part] for s in samples)) for part in (slice(0, 123), slice(123, None))]
    for sums, added in zip(whole, jax.tree.map(jnp.add, *parts), strict=True):
        np.testing.assert_allclose(sums, added, atol=1e-11)


def test_the_features_of_a_shifted_omega(samples, generator):
    omega, alpha, *_ = samples
    offset = jnp.asarray(generator.normal(size=3))
    shifted = shift_omega(offset) @ features(omega, alpha)
    np.testing.assert_allclose(shifted, features(omega + offset[:, None], alpha), atol=1e-13)


def test_offsets_act_on_sums_as_on_samples(samples, generator):
    omega, alpha, force, moment = samples
    b_omega, b_force, b_moment = (jnp.asarray(generator.normal(size=3)) for _ in range(3))
    on_samples = accumulate(omega + b_omega[:, None], alpha, force + b_force[:, None], moment + b_moment[:, None])
    for by_sums, by_samples in zip(
        with_offsets(accumulate(*samples), b_omega, b_force, b_moment), on_samples, strict=True
    ):
        np.testing.assert_allclose(by_sums, by_samples, atol=1e-9)


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


def test_conditioning_of_the_sums_is_enough_for_the_presets_motion(preset):
    """The normal equations square the condition number: on T1 that costs nothing (QR agrees to 1e-11)."""
    from uq.campaign.trial_setup import true_motion

    motion = true_motion(preset, preset.trajectories["T1"])
    tensor = preset.body.inertia
    rows = jax.jit(jax.vmap(omega_r, in_axes=1))(motion.omega, motion.alpha)
    moment = (rows @ jnp.asarray(tensor)).T
    estimate = solve(accumulate(motion.omega, motion.alpha, jnp.zeros_like(moment), moment), R)
    np.testing.assert_allclose(estimate.inertia, tensor, atol=1e-11 * tensor.max())
    np.testing.assert_allclose(ordinary(rows, moment.T).value, tensor, atol=1e-11 * tensor.max())
    assert estimate.condition < 100
