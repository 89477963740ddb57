"""Coloured noise has the Allan deviation that was asked for; allantools measures it."""

import warnings

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from tests.helpers.source_lab import draw_block, experiment, simulated, source
from uq.monte_carlo.campaign.simulation import simulate
from uq.sources.draws import BLOCK, noise_at_rest, noise_of_block, noise_streams
from uq.sources.flicker import DECAYS, LONGEST, WEIGHTS, pink_block, pink_response
from uq.sources.random_normals import in_order, normal_pairs

RATE, SAMPLES = 100.0, 200_000


def allan_deviation(signal, taus):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import allantools
    taus, deviation, _, pairs = allantools.adev(signal, rate=RATE, data_type="freq", taus=taus)
    return taus, deviation, pairs


@eqx.filter_jit
def draw(source, key, trial, n):
    streams, dtype = noise_streams([source], key, trial), jnp.dtype(float)

    def block(memory, number):
        pairs, memory = noise_of_block([source], (), streams, memory, number, jnp.asarray(RATE), dtype)
        return memory, in_order(pairs[0])

    blocks = jax.lax.scan(block, noise_at_rest([source], dtype), jnp.arange(-(-n // BLOCK)))[1]
    return blocks.swapaxes(0, 1).reshape(3, -1)[:, :n]


def drawn(source, seed, trial, n):
    return draw(source, jax.random.key(seed), jnp.asarray(trial), n)


def asked(white=0.0, flicker=0.0, random_walk=0.0):
    """A gyro's noise with these Allan parameters on axis 1, two and three times as much on the others."""
    units = {"white": "rad/s/Hz**0.5", "flicker": "rad/s", "random_walk": "rad/s/s**0.5"}
    given = {"white": white, "flicker": flicker, "random_walk": random_walk}
    keys = {name: [f"{float(k * value)!r} {units[name]}" for k in (1, 2, 3)] for name, value in given.items() if value}
    return source("gyro", "omega", "coloured", **keys)


@pytest.mark.parametrize(
    "parameters",
    [
        *(
            pytest.param(alone, marks=pytest.mark.slow)
            for alone in ({"white": 2e-4}, {"flicker": 3e-5}, {"random_walk": 1e-5})
        ),
        {"white": 2e-4, "flicker": 3e-4, "random_walk": 1e-4},
    ],
    ids=["white", "flicker", "walk", "all"],
)
def test_the_allan_deviation_is_the_one_asked_for(parameters):
    """IEEE Std 952: N²/τ + (2 ln 2/π) B² + K² τ/3."""
    gyro = experiment(asked(**parameters)).sources[0]
    noise = drawn(gyro, 5, 3, SAMPLES)
    n, b, k = (parameters.get(name, 0.0) for name in ("white", "flicker", "random_walk"))
    for axis in range(3):
        taus, deviation, pairs = allan_deviation(np.asarray(noise[axis]), 2.0 ** np.arange(3, 15) / RATE)
        expected = (axis + 1) * np.sqrt(n**2 / taus + 2 * np.log(2) / np.pi * b**2 + k**2 * taus / 3)
        assert len(taus) == 12  # from 0.08 s to 164 s
        # a deviation from `pairs` differences is known within 1/√pairs at worst: 144 comparisons at 5: 1e-4 false alarms
        np.testing.assert_array_less(np.abs(deviation / expected - 1), 5 / np.sqrt(pairs) + 0.005)


def test_white_noise_alone_is_white(generator):
    """A noise density N is a standard deviation of N √rate at each sample, independent between axes."""
    gyro = experiment(asked(white=2e-4)).sources[0]
    noise = np.asarray(drawn(gyro, 5, 0, SAMPLES))
    np.testing.assert_allclose(noise.std(1), 2e-3 * np.array([1, 2, 3]), rtol=5 / np.sqrt(2 * SAMPLES))
    assert np.abs(np.corrcoef(noise) - np.eye(3)).max() < 5 / np.sqrt(SAMPLES)
    lags = [np.mean(noise[:, k:] * noise[:, :-k], axis=1) / noise.var(1) for k in (1, 2, 7)]
    assert np.abs(lags).max() < 5 / np.sqrt(SAMPLES)


def test_blocks_of_flicker_are_one_convolution(generator):
    """Kasdin's filter by its recursion, term by term, over the seams of pieces and blocks."""
    white = generator.normal(size=(3, 4 * BLOCK))
    response = np.cumprod(np.concatenate([[1.0], (np.arange(1, 4 * BLOCK) - 0.5) / np.arange(1, 4 * BLOCK)]))
    expected = [np.convolve(row, response)[: 4 * BLOCK] for row in white]
    blocks = jnp.asarray(white.reshape(3, 4, BLOCK).swapaxes(0, 1))
    step = lambda memory, block: pink_block(block, memory)[::-1]  # noqa: E731
    pink = jax.lax.scan(step, jnp.zeros((3, len(DECAYS))), blocks)[1].swapaxes(0, 1).reshape(3, -1)
    np.testing.assert_allclose(pink, expected, atol=3e-5)  # 3e-6 of each of the terms, that add up to some 10


def test_flicker_is_the_filtered_noise_of_the_generator():
    """Drawn and filtered with seven digits: by convolution in float64 of the same random words."""
    gyro = experiment(asked(flicker=1.0)).sources[0]
    stream = jax.random.fold_in(noise_streams([gyro], jax.random.key(5), 3)[0], 1)
    places = jnp.arange(3 * BLOCK // 2, dtype=jnp.uint32).reshape(3, -1)
    pairs = jax.jit(lambda block: in_order(normal_pairs(stream, block, places, "float64")))
    white = np.concatenate([pairs(block) for block in (0, 1)], axis=1)
    response = pink_response(np.arange(2.0 * BLOCK))
    expected = [(axis + 1) * np.convolve(row, response)[: 2 * BLOCK] for axis, row in enumerate(white)]
    np.testing.assert_allclose(drawn(gyro, 5, 3, 2 * BLOCK), expected, atol=1e-4)  # of the filter, as above


def test_first_order_processes_are_half_an_integration_at_every_lag():
    """Also between the lags that were fitted; far out the response is 1/√(π k) (Stirling)."""
    lags = np.unique(np.round(np.geomspace(1, LONGEST, 4000)))
    added = np.exp(np.outer(lags - 1, np.log(DECAYS))) @ WEIGHTS
    np.testing.assert_allclose(added, pink_response(lags), rtol=4e-6)
    np.testing.assert_allclose(pink_response(lags[-1:]), 1 / np.sqrt(np.pi * lags[-1:]), rtol=1e-6)


def test_draws_are_keyed_by_block_and_depend_on_nothing_else():
    gyro = experiment(asked(white=2e-4, flicker=3e-4, random_walk=1e-4)).sources[0]
    long = drawn(gyro, 0, 1, 9000)
    np.testing.assert_allclose(drawn(gyro, 0, 1, 5000), long[:, :5000], atol=1e-15)  # a longer run begins the same
    for other in (drawn(gyro, 0, 2, 9000), drawn(gyro, 1, 1, 9000)):
        assert not np.any(other == long)


def test_a_simulated_run_has_it():
    e = experiment(
        asked(white=2e-4, flicker=3e-4, random_walk=1e-4), source("white", "omega", "precision", sigma=["1 mrad/s"] * 3)
    )
    noise = simulate(e, trial=2).run.omega - simulated(e)[1]
    n = len(noise)
    coloured = drawn(e.sources[0], 0, 2, 9000)[:, :n]  # as above, which is compiled
    white = draw_block(e.sources[1], jax.random.key(0), 2, 0, jnp.dtype(float))[:, :n]
    np.testing.assert_allclose(noise, (coloured + white).T, atol=1e-8)  # flicker of 3e-4 is filtered in float32
