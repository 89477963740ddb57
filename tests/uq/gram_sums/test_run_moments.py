"""Covariance and expectation of Gram sums under noise, against derivatives of the sums with respect to every sample."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from identify.signals.differentiate import derivative
from uq.gram_sums import gram_moments
from uq.gram_sums.run_moments import run_moments
from uq.gram_sums.sums_over_samples import moments_of_signals
from uq.sources.kinds.coloured import FLICKER
from uq.sources.noise_filters import WALK, WHITE, GyroNoise

N, TAPS = 30, (np.array([2.0]), np.array([0.9, 0.4, -0.1]))
VALID = np.pad(np.ones(N - 6), 3)
NONE = np.zeros(3)


@pytest.fixture(scope="module")
def signals():
    generator = np.random.default_rng(41)
    omega = generator.normal(size=(3, N))
    alphas = [np.pad(derivative(omega, h), ((0, 0), (len(h),) * 2)) for h in TAPS]
    return np.concatenate([omega, *alphas, generator.normal(size=(6, N))])


@pytest.fixture(scope="module")
def derivatives(signals):
    """First and second derivatives of the summed products by the noise of each sample, (products, 3 n) and twice."""
    products = run_moments(signals, VALID, TAPS).algebra.products

    def sums(noise):
        noise = noise.reshape(3, N)
        alphas = [jnp.pad(derivative(noise, h), ((0, 0), (len(h),) * 2)) for h in TAPS]
        rows = jnp.asarray(signals) + jnp.concatenate([noise, *alphas, jnp.zeros((6, N))])
        return jnp.stack([jnp.sum(jnp.prod(rows[np.array(p, int)], axis=0) * VALID) for p in products])

    zero = jnp.zeros(3 * N)
    return jax.jit(jax.jacfwd(sums))(zero), jax.jit(jax.hessian(sums))(zero)


SIZE = np.array([[0.09, 0.02, 0.0], [0.02, 0.04, 0.0], [0.0, 0.0, 0.16]])


def test_white_noise_with_correlated_axes(signals, derivatives):
    """Isserlis: ``J K Jᵀ + ½ tr(H K H K)``, K the covariance of all samples; exact up to the second order."""
    first, second = map(np.asarray, derivatives)
    covariance = np.kron(SIZE, np.eye(N))
    half = second @ covariance
    expected = first @ covariance @ first.T + 0.5 * np.einsum("aij,bji->ab", half, half)
    computed = run_moments(signals, VALID, TAPS).covariance(GyroNoise.white(SIZE))
    np.testing.assert_allclose(computed, expected, atol=1e-10 * np.abs(expected).max())


@pytest.mark.parametrize("filter_", [FLICKER, WALK])
def test_coloured_noise_enters_linearly_as_its_samples_do(signals, derivatives, filter_):
    """K of noise from rest, ``L Lᵀ``; so small that what is quadratic in it, which is averaged over the run, is nothing."""
    first = np.asarray(derivatives[0])
    response = filter_.response(N)
    shape = np.array([[response[i - j] if i >= j else 0 for j in range(N)] for i in range(N)])
    small = 1e-8 * SIZE
    expected = first @ np.kron(small, shape @ shape.T) @ first.T
    moments = run_moments(signals, VALID, TAPS, [WHITE, filter_])
    computed = moments.covariance(GyroNoise({filter_: small}, NONE, NONE))
    np.testing.assert_allclose(computed, expected, atol=1e-6 * np.abs(expected).max())


def test_two_noises_add_to_what_both_together_make(signals):
    """White noise in two parts is white noise: also what is quadratic in both."""
    other = type("Impulse", (type(WHITE),), {"response": lambda self, n: np.ones(1)})("also white", np.ones_like)
    moments = run_moments(signals, VALID, TAPS, [WHITE, other])
    parts = moments.covariance(GyroNoise({WHITE: 0.3 * SIZE, other: 0.7 * SIZE}, NONE, NONE))
    whole = moments.covariance(GyroNoise.white(SIZE))
    np.testing.assert_allclose(parts, whole, atol=1e-10 * np.abs(whole).max())


def test_cumulants_of_noise_that_is_not_normal(signals, derivatives):
    """Independent samples: third and fourth cumulants meet the derivatives by one sample, alone and together."""
    first, second = map(np.asarray, derivatives)
    third, fourth = np.array([0.01, 0.0, -0.02]), np.array([-0.005, 0.003, 0.0])
    squares = np.einsum("aii->ai", second) / 2
    crossed = first @ (np.repeat(third, N)[:, None] * squares.T)
    expected = crossed + crossed.T + (squares * np.repeat(fourth, N)) @ squares.T
    moments = run_moments(signals, VALID, TAPS)
    normal = GyroNoise.white(SIZE)
    other = normal._replace(third_cumulant=third, fourth_cumulant=fourth)
    difference = moments.covariance(other) - moments.covariance(normal)
    np.testing.assert_allclose(difference, expected, atol=1e-10 * np.abs(expected).max())


def test_pieces_and_long_differentiators_change_nothing(signals, monkeypatch):
    whole = run_moments(signals, VALID, TAPS).covariance(GyroNoise.white(SIZE))
    monkeypatch.setattr("uq.gram_sums.run_moments.PIECE", 7)
    np.testing.assert_allclose(run_moments(signals, VALID, TAPS).covariance(GyroNoise.white(SIZE)), whole, atol=1e-10)
    monkeypatch.setattr("uq.gram_sums.run_moments.FEW", 0)
    np.testing.assert_allclose(run_moments(signals, VALID, TAPS).covariance(GyroNoise.white(SIZE)), whole, atol=1e-10)


def test_small_noise_has_the_moments_that_every_order_gives(signals):
    """Oracle: the moments by Wick powers, exact in every order, of noise a thousandth as large as the signals."""
    size = 1e-6 * np.diag([1.0, 0.5, 2.0])
    exact = moments_of_signals(jnp.asarray(signals), jnp.asarray(VALID), [jnp.asarray(h) for h in TAPS])
    expected = np.asarray(gram_moments.covariance(exact, jnp.asarray(np.diag(size))))
    places = gram_moments.distinct_products(len(TAPS))
    moments = run_moments(signals, VALID, TAPS)
    chosen = [places[product] for product in moments.algebra.products]
    computed = moments.covariance(GyroNoise.white(size))
    scale = np.sqrt(np.outer(*[np.diag(computed) + 1e-12 * np.diag(computed).max()] * 2))
    np.testing.assert_allclose(computed / scale, expected[np.ix_(chosen, chosen)] / scale, atol=1e-4)


def test_variances_of_omega_and_alpha(signals):
    moments = run_moments(signals, VALID, TAPS, [WHITE, WALK])
    assert moments.omega[WHITE] == 1
    np.testing.assert_allclose(moments.alpha[WHITE], [2 * h @ h for h in TAPS])
    assert moments.omega[WALK] == pytest.approx((N + 1) / 2)  # of a running sum, on the average
