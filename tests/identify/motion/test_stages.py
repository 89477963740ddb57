"""Motions in stages: the formula, rest between them, patterns of one wave."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from identify.motion.attitude import attitude
from identify.motion.optimal_mixture import patterns
from identify.motion.trajectory import swell
from identify.rigid_body.rotation import exponential
from tests.helpers.multisines import DURATION, RAMP, staged_multisine


@pytest.fixture(scope="module")
def staged():
    return staged_multisine()


def only(motion, first):
    """One stage of a motion as a motion of one stage."""
    in_stage = np.asarray(motion.start) == first
    amplitudes = {"cosine": motion.cosine[:, in_stage], "sine": motion.sine[:, in_stage]}
    return dataclasses.replace(motion, frequency=motion.frequency[in_stage], **amplitudes, start=None)


def test_one_stage_is_the_sum_of_sines_times_the_window(staged):
    """With and without a start of nought, against the formula."""
    t = jnp.linspace(0, DURATION, 97)
    angle = 2 * np.pi * np.asarray(t)[:, None] * staged.frequency
    shape = np.cos(angle) @ staged.cosine.T + np.sin(angle) @ staged.sine.T
    ends = np.asarray(jax.jit(jax.vmap(swell))(t / RAMP) * jax.jit(jax.vmap(swell))((DURATION - t) / RAMP))
    expected = ends[:, None] * shape
    for start in (None, np.zeros(6)):
        single = dataclasses.replace(staged, start=start)
        np.testing.assert_allclose(jax.jit(jax.vmap(single.coordinates))(t), expected, atol=1e-15)


def test_each_stage_moves_alone(staged):
    """The first as if there were no other, and at rest, with its rates, where the next one starts."""
    np.testing.assert_array_equal(np.unique(staged.end), [3.0, 7.0, 12.0])
    first = dataclasses.replace(only(staged, 0.0), duration=np.array(3.0))
    t = jnp.linspace(0, 3, 61)
    np.testing.assert_allclose(
        jax.jit(jax.vmap(staged.coordinates))(t), jax.jit(jax.vmap(first.coordinates))(t), atol=1e-16
    )
    borders = jnp.array([0.0, 3.0, 7.0, DURATION])
    np.testing.assert_allclose(jax.jit(jax.vmap(staged.coordinates))(borders), 0, atol=1e-30)
    np.testing.assert_allclose(jax.jit(jax.vmap(staged.omega))(borders), 0, atol=1e-30)


def test_a_swell_asks_for_little_on_its_way():
    """Times a sine of one turn in half a ramp: hardly more acceleration than the sine alone."""
    t = jnp.linspace(0, 1, 2001)

    waves = [lambda u, wave=wave: swell(u) * wave(4 * jnp.pi * u) for wave in (jnp.cos, jnp.sin)]
    largest = (
        float(jnp.hypot(*(jax.jit(jax.vmap(jax.grad(jax.grad(windowed_wave))))(t) for windowed_wave in waves)).max())
        / (4 * np.pi) ** 2
    )
    assert 1.0 <= largest < 1.03
    np.testing.assert_allclose([swell(jnp.array(u)) for u in (-1.0, 0.0, 0.5, 1.0, 2.0)], [0, 0, 0.5**0.5, 1, 1])


def test_rates_are_those_of_the_attitude_through_the_stages(staged):
    """Attitude integrated from omega, and alpha by differences."""
    t = jnp.linspace(0.0, 5.0, 5001)

    def moved(at):
        return exponential(staged.coordinates(at)[3:]), staged.omega(at), staged.alpha(at)

    turns, omega, alpha = map(np.asarray, jax.jit(jax.vmap(moved))(t))
    np.testing.assert_allclose(jax.jit(lambda t: attitude(staged.omega, t))(t), turns, atol=1e-9)
    difference = (8 * (omega[3:-1] - omega[1:-3]) - omega[4:] + omega[:-4]) / 12e-3  # of fourth order, by 1 ms
    np.testing.assert_allclose(alpha[2:-2], difference, atol=1e-7)


def test_patterns_are_those_of_one_wave(generator):
    """The mean square of legs that follow a sine at their phases, by instants; one of each pair of conjugates."""
    tried = patterns()
    assert len(tried) == (6**5 + 2**5) // 2
    np.testing.assert_allclose(np.abs(tried), 1)
    pattern = generator.choice(tried)
    wave = (pattern[:, None] * np.exp(2j * np.pi * np.arange(12) / 12)).real
    np.testing.assert_allclose(2 * wave @ wave.T / 12, np.outer(pattern, pattern.conj()).real, atol=1e-12)
