"""Covariance and expectation of Gram sums under noise, against derivatives of the sums with respect to every sample."""

import functools
import operator

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from identify.signals.differentiate import derivative
from uq.monte_carlo.gram_sums.noise_moments import run_moments
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
    longest = max(map(len, products))
    factors = np.array([[*product, *[len(signals)] * (longest - len(product))] for product in products], int)

    def sums(noise):
        noise = noise.reshape(3, N)
        alphas = [jnp.pad(derivative(noise, h), ((0, 0), (len(h),) * 2)) for h in TAPS]
        rows = jnp.asarray(signals) + jnp.concatenate([noise, *alphas, jnp.zeros((6, N))])
        rows = jnp.concatenate([rows, jnp.ones((1, N))])
        return jnp.sum(functools.reduce(operator.mul, (rows[column] for column in factors.T)) * VALID[None], axis=1)

    zero, first = jnp.zeros(3 * N), jax.jacfwd(sums)
    column = jax.jit(lambda direction: jax.jvp(first, (zero,), (direction,))[1])  # all at once take gigabytes
    return jax.jit(first)(zero), np.stack([column(direction) for direction in jnp.eye(3 * N)], axis=-1)


SIZE = np.array([[0.09, 0.02, 0.0], [0.02, 0.04, 0.0], [0.0, 0.0, 0.16]])


@pytest.mark.slow
def test_white_noise_with_correlated_axes(signals, derivatives):
    """Isserlis: ``J K Jᵀ + ½ tr(H K H K)``, K the covariance of all samples; exact up to the second order."""
    first, second = map(np.asarray, derivatives)
    covariance = np.kron(SIZE, np.eye(N))
    half = second @ covariance
    flat, turned = (x.reshape(len(half), -1) for x in (half, half.swapaxes(1, 2)))
    expected = first @ covariance @ first.T + 0.5 * flat @ turned.T
    moments, noise = run_moments(signals, VALID, TAPS), GyroNoise.white(SIZE)
    np.testing.assert_allclose(moments.covariance(noise), expected, atol=1e-10 * np.abs(expected).max())
    linear = first @ covariance @ first.T
    np.testing.assert_allclose(moments.linear_covariance(noise), linear, atol=1e-10 * np.abs(linear).max())


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
    other = type("Impulse", (type(WHITE),), {"response": lambda self, n: np.ones(1)})(
        "also white", np.ones_like, WHITE.block
    )
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
    monkeypatch.setattr("uq.monte_carlo.gram_sums.noise_moments.PIECE", 7)
    np.testing.assert_allclose(run_moments(signals, VALID, TAPS).covariance(GyroNoise.white(SIZE)), whole, atol=1e-10)
    monkeypatch.setattr("uq.monte_carlo.gram_sums.noise_moments.FEW", 0)
    np.testing.assert_allclose(run_moments(signals, VALID, TAPS).covariance(GyroNoise.white(SIZE)), whole, atol=1e-10)


def test_parts_of_a_run_add_up(signals):
    """Each with as many samples of its neighbours as two differentiators reach; beyond the run there is nothing."""
    margin = 2 * max(map(len, TAPS))
    rows = np.pad(np.concatenate([VALID[None], signals]), ((0, 0), (margin, margin)))
    parts = [rows[:, start : stop + 2 * margin] for start, stop in ((0, 11), (11, 17), (17, N))]
    first, *others = (run_moments(part[1:], part[0], TAPS, margin=margin) for part in parts)
    whole, noise = run_moments(signals, VALID, TAPS), GyroNoise.white(SIZE)
    noise = noise._replace(third_cumulant=np.full(3, 0.01), fourth_cumulant=np.full(3, 0.02))
    expected = whole.covariance(noise)
    together = sum(others, start=first).covariance(noise)
    np.testing.assert_allclose(together, expected, atol=1e-10 * np.abs(expected).max())


def test_drawn_noise_has_these_moments(signals):
    """40,000 runs with noise of 2 % of the signals: 5 standard errors of a correlation; 203² · 6e-7 false alarms."""
    size, trials, generator = 4e-4 * SIZE / 0.16, 40_000, np.random.default_rng(42)
    moments = run_moments(signals, VALID, TAPS)
    root, sums = np.linalg.cholesky(size), []
    for _ in range(20):
        noise = root @ generator.normal(size=(trials // 20, 3, N))
        rows = np.broadcast_to(signals, (len(noise), *signals.shape)).copy()
        rows[:, :3] += noise
        for e, h in enumerate(TAPS):
            matrix = sum(tap * (np.eye(N, k=j) - np.eye(N, k=-j)) for j, tap in enumerate(h, 1))
            rows[:, 3 + 3 * e : 6 + 3 * e] += noise @ matrix.T
        products = [np.prod(rows[:, np.array(p, int)], axis=1) @ VALID for p in moments.algebra.products]
        sums.append(np.stack(products, axis=1))
    computed = moments.covariance(GyroNoise.white(size))
    moves = np.diag(computed) > 0
    computed, drawn = computed[np.ix_(moves, moves)], np.cov(np.concatenate(sums)[:, moves], rowvar=False)
    scale = np.sqrt(np.outer(np.diag(computed), np.diag(computed)))
    allowed = 5 * np.sqrt((1 + (computed / scale) ** 2) / trials) + 4e-3  # what is left out: (noise / signal)²
    assert (np.abs(drawn - computed) / scale <= allowed).all()


def test_variances_of_omega_and_alpha(signals):
    moments = run_moments(signals, VALID, TAPS, [WHITE, WALK])
    assert moments.omega[WHITE] == 1
    np.testing.assert_allclose(moments.alpha[WHITE], [2 * h @ h for h in TAPS])
    assert moments.omega[WALK] == pytest.approx((N + 1) / 2)  # of a running sum, on the average
