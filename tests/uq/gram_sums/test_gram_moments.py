"""Moments of the Gram sums: exact, against cubature that is exact for polynomials of this degree, at noise of any size."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from identify.estimators.gram import sums_of
from identify.rigid_body.regressor import features
from uq.campaign.trial_setup import prepare_setup
from uq.gram_sums.gram_moments import covariance, first_order_covariance, mean, pack, products_of_estimator, unpack
from uq.gram_sums.sums_over_samples import gram_moments, moments_of_signals

TAPS = ([50.0], [20.0, 12.0])


def run(n, taps, seed=1):
    """A run of random signals, without any physics."""
    generator = np.random.default_rng(seed)
    halo = max(map(len, taps))
    valid = np.zeros(n)
    valid[halo : n - halo] = 1
    omega, wrench = generator.normal(size=(3, n)), generator.normal(size=(6, n))
    phi = noisy_features(omega, taps) * valid
    signals = jnp.asarray(np.concatenate([omega, phi[10:], wrench]))
    sums = packed(phi, wrench)
    return (signals, jnp.asarray(valid), [jnp.asarray(h) for h in taps]), omega, wrench, valid, sums


def noisy_features(omega, taps):
    """The features of omega (…, 3, n), each differentiator's alpha last; nothing is left out at the ends."""
    alphas = []
    for of_estimator in taps:
        alpha = np.zeros_like(omega)
        for j, tap in enumerate(of_estimator, 1):
            alpha[..., :-j] += tap * omega[..., j:]
            alpha[..., j:] -= tap * omega[..., :-j]
        alphas.append(alpha)
    w1, w2, w3 = (omega[..., k, :] for k in range(3))
    shared = np.stack([np.ones_like(w1), w1, w2, w3, w1 * w1, w2 * w2, w3 * w3, w1 * w2, w1 * w3, w2 * w3], axis=-2)
    return np.concatenate([shared, *alphas], axis=-2)


def cubature(axes, n, sigma, valid):
    """Noise on Gauss–Hermite nodes with their weights: exact for the square of every sum.

    A sample that counts enters to the fourth power, so five nodes; one at the ends through alpha alone, so three. Of
    three samples the central difference sees the outer ones' difference alone, which takes the place of both.
    """
    kinds = [np.polynomial.hermite_e.hermegauss(5 if counts else 3) for counts in (valid if n > 3 else (True, False))]
    nodes_of_sample = np.array(list(itertools.product(*(nodes for nodes, _ in kinds))))
    if n == 3:
        nodes_of_sample = np.stack(
            [-nodes_of_sample[:, 1] / np.sqrt(2), nodes_of_sample[:, 0], nodes_of_sample[:, 1] / np.sqrt(2)], axis=1
        )
    weight = np.prod(list(itertools.product(*(weights / weights.sum() for _, weights in kinds))), axis=1)
    grid = np.array(list(itertools.product(range(len(nodes_of_sample)), repeat=len(axes))))
    noise = np.zeros((len(grid), 3, n))
    noise[:, axes] = nodes_of_sample[grid]
    return noise * sigma[:, None], np.prod(weight[grid], axis=1)


def packed(phi, wrench):
    """The sums of many runs (…, features, n), as :func:`pack` has them."""
    gram, both = phi @ np.swapaxes(phi, -1, -2), phi @ wrench.T
    row, column = np.triu_indices(phi.shape[-2])
    return np.concatenate([gram[..., row, column], both.reshape(*both.shape[:-2], -1)], axis=-1)


# one axis: lags of two unlike differentiators; two axes: products across axes; three: everything at one instant
@pytest.mark.parametrize(
    ("axes", "n", "taps"),
    [
        ([0], 7, TAPS),
        pytest.param([2], 6, TAPS[:1], marks=pytest.mark.study),
        ([0, 2], 4, TAPS[:1]),
        ([0, 1, 2], 3, TAPS[:1]),
    ],
)
def test_mean_and_covariance_are_exact_for_noise_as_large_as_the_signal(axes, n, taps):
    visited, omega, wrench, valid, _ = run(n, taps)
    sigma = np.array([0.7, 0.4, 0.9])
    only = np.where(np.isin(np.arange(3), axes), sigma, 0)
    noise, weights = cubature(axes, n, sigma, valid)
    total, products = 0, 0
    for chunk in np.array_split(np.arange(len(noise)), max(1, len(noise) // 50_000)):
        sums = packed(noisy_features(omega + noise[chunk], taps) * valid, wrench)
        total = total + weights[chunk] @ sums
        products = products + (sums.T * weights[chunk]) @ sums
    moments = jax.jit(moments_of_signals)(*visited)
    variance = jnp.asarray(only**2)
    np.testing.assert_allclose(jax.jit(mean)(moments, variance), total, rtol=1e-9, atol=1e-9 * np.abs(total).max())
    expected = products - np.outer(total, total)
    analytic = jax.jit(covariance)(moments, variance)
    np.testing.assert_allclose(analytic, expected, rtol=1e-8, atol=1e-10 * np.abs(products).max())


@pytest.fixture(scope="module")
def some():
    visited, *_, sums = run(500, TAPS)
    return visited, jax.jit(moments_of_signals)(*visited), sums


def test_chunks_change_nothing(some):
    visited, whole, _ = some
    cut = moments_of_signals(*visited, chunk=150)
    for of_whole, of_cut in zip(jax.tree.leaves(whole), jax.tree.leaves(cut), strict=True):
        np.testing.assert_allclose(of_whole, of_cut, rtol=1e-9, atol=1e-9 * np.abs(of_whole).max())


def test_small_noise_leaves_the_linear_terms(some):
    moments, variance = some[1], 1e-12 * jnp.array([1.0, 2.0, 3.0])
    full, first = (jax.jit(each)(moments, variance) for each in (covariance, first_order_covariance))
    np.testing.assert_allclose(full, first, rtol=1e-6, atol=1e-8 * np.abs(first).max())
    assert np.linalg.eigvalsh(full)[0] > -1e-12 * np.trace(full)
    np.testing.assert_allclose(jax.jit(mean)(moments, variance), moments.sums, rtol=1e-8, atol=1e-8)


def test_without_noise_nothing_changes(some):
    _, moments, sums = some
    np.testing.assert_allclose(jax.jit(mean)(moments, jnp.zeros(3)), sums, rtol=1e-12, atol=1e-9)
    assert not np.any(jax.jit(covariance)(moments, jnp.zeros(3)))


def test_packing_is_undone_and_one_estimators_products_are_found(generator):
    omega, alpha, wrench = (jnp.asarray(generator.normal(size=(k, 9))) for k in (3, 6, 6))
    phi = [jax.jit(features)(omega, of_one) for of_one in (alpha[:3], alpha[3:])]
    both = jax.jit(sums_of)(jnp.concatenate([phi[0], phi[1][10:]]), wrench[:3], wrench[3:])
    again = unpack(pack(both), 16)
    jax.tree.map(np.testing.assert_array_equal, again, both)
    for k in range(2):
        np.testing.assert_allclose(
            pack(both)[products_of_estimator(2, k)], pack(jax.jit(sums_of)(phi[k], wrench[:3], wrench[3:]))
        )


def test_a_prepared_run_has_the_moments_of_its_signals(brief):
    setup = prepare_setup(brief, brief.trajectories["T1"], brief.estimators)
    moments = gram_moments(setup)
    np.testing.assert_allclose(moments.sums, pack(setup.sums), rtol=1e-9, atol=1e-9)
    white = next(s for s in brief.sources if s.name == "omega_precision")
    shift = jax.jit(mean)(moments, jnp.asarray(white.sigma**2)) - moments.sums
    of_squares = unpack(shift, 16).gram[0, 4:7]
    np.testing.assert_allclose(of_squares, setup.sums.gram[0, 0] * white.sigma**2, rtol=1e-9)
    # alpha's noise: σ² Σ c² over both sides, 2 x 200² for the central difference at 400 Hz
    of_alpha = jnp.diag(unpack(shift, 16).gram)[10:13]
    np.testing.assert_allclose(of_alpha, setup.sums.gram[0, 0] * 2 * 200**2 * white.sigma**2, rtol=1e-9)
