"""Normal numbers of a counter: the generator bit by bit, the transform against exact functions, their distribution."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax.extend.random import threefry_2x32
from scipy import stats

from uq.sources.random_normals import box_muller, normal_pairs, normals_of_keys, threefry


def test_the_generator_is_threefry_of_jax_and_of_its_authors(generator):
    key, counter = generator.integers(0, 2**32, (2, 2, 1000), dtype=np.uint32)
    found = jax.jit(threefry)(tuple(map(jnp.asarray, key)), tuple(map(jnp.asarray, counter)))
    for k in (0, 1, 999):
        expected = threefry_2x32(jnp.asarray(key[:, k]), jnp.asarray(counter[:, k]))
        assert [int(word[k]) for word in found] == [int(word) for word in expected]
    # known answers that the authors publish with the generator (Random123, kat_vectors)
    zero, ones = jnp.uint32(0), jnp.uint32(0xFFFFFFFF)
    assert [int(w) for w in jax.jit(threefry)((zero, zero), (zero, zero))] == [0x6B200159, 0x99BA4EFE]
    assert [int(w) for w in jax.jit(threefry)((ones, ones), (ones, ones))] == [0x1CB996FC, 0xBB002BE7]


@pytest.mark.parametrize(("dtype", "tolerance"), [("float64", 2e-14), ("float32", 2e-5)])
def test_the_transform_is_box_and_mullers(dtype, tolerance, generator):
    edges = np.array([0, 1, 2**31 - 1, 2**31, 2**32 - 1, 0x40000000, 0xC0000000], np.uint32)
    radius, angle = generator.integers(0, 2**32, (2, 10_000), dtype=np.uint32)
    radius, angle = (
        np.concatenate([word, order.ravel()])
        for word, order in zip((radius, angle), np.meshgrid(edges, edges), strict=True)
    )
    found = np.asarray(jax.jit(box_muller, static_argnums=2)(jnp.asarray(radius), jnp.asarray(angle), dtype))
    assert found.real.dtype == dtype
    part = (angle << np.uint32(2)).view(np.int32) * (np.pi / 2) / 2.0**32  # ±45° about one of four axes
    turn = np.where(angle >> 30 & 1, part, np.pi / 2 - part) + np.pi * (angle >> 31)
    expected = np.sqrt(-2 * np.log((radius + 0.5) / 2.0**32)) * np.exp(1j * turn)
    clear = radius < 2**32 - 2**20  # in float32, a radius below 0.02 is coarse
    np.testing.assert_allclose(found[clear], expected[clear], atol=tolerance)
    np.testing.assert_allclose(found, expected, atol=2e-14 if dtype == "float64" else 1e-3)
    assert np.abs(found).max() < 6.8


@pytest.mark.parametrize("dtype", ["float64", "float32"])
def test_the_numbers_are_normal_and_independent(dtype):
    """Of half a million: Kolmogorov, moments, tail; real and imaginary part, neighbours and blocks uncorrelated."""
    draw = jax.jit(normal_pairs, static_argnums=3)
    pairs = np.stack(
        [np.asarray(draw(jax.random.key(3), block, jnp.arange(125_000, dtype=jnp.uint32), dtype)) for block in (0, 1)]
    )
    z = np.stack([pairs.real, pairs.imag]).astype(float)
    n = z.size
    assert stats.kstest(z.ravel(), "norm").pvalue > 1e-3
    for power, expected, variance in ((1, 0, 1), (2, 1, 2), (3, 0, 15), (4, 3, 96)):
        assert abs(np.mean(z**power) - expected) < 4 * np.sqrt(variance / n)  # four: 3e-4 false alarms
    beyond = 2 * stats.norm.sf(4)
    assert abs((np.abs(z) > 4).sum() - n * beyond) < 5 * np.sqrt(n * beyond)
    a, b = z
    for one, other in ((a, b), (a**2 - 1, b**2 - 1), (a[0], a[1]), (a[:, 1:], a[:, :-1]), (b[0], a[1])):
        assert abs(np.corrcoef(one.ravel(), other.ravel())[0, 1]) < 4.5 / np.sqrt(one.size)  # five: 3e-5
    assert stats.kstest(np.arctan2(b, a).ravel(), stats.uniform(-np.pi, 2 * np.pi).cdf).pvalue > 1e-3


def test_numbers_depend_on_key_block_and_place_alone():
    place = jnp.arange(150, dtype=jnp.uint32).reshape(3, 50)
    draw = lambda key, block: normal_pairs(key, block, place, "float64")  # noqa: E731
    keys = jax.vmap(jax.random.key)(jnp.arange(4))
    many = jax.jit(jax.vmap(draw, in_axes=(0, None)))(keys, jnp.asarray(5))
    np.testing.assert_array_equal(many[2], jax.jit(draw)(keys[2], jnp.asarray(5)))
    fewer = jax.jit(lambda key: normal_pairs(key, 5, place[1], "float64"))(keys[2])
    np.testing.assert_array_equal(many[2][1], fewer)
    everything = np.concatenate([many.ravel(), jax.jit(draw)(keys[2], jnp.asarray(6)).ravel()])
    assert len(np.unique(everything)) == len(everything)


def test_an_array_of_an_odd_number_of_normals_has_no_two_alike():
    drawn = jax.jit(normals_of_keys, static_argnums=1)(jax.random.key(1)[None], 63)[:, 0]
    place = jnp.arange(32, dtype=jnp.uint32)
    pairs = jax.jit(normal_pairs, static_argnums=3)(jax.random.key(1), 0, place, "float64")
    assert len(np.unique(drawn)) == 63
    np.testing.assert_allclose(drawn, np.concatenate([pairs.real, pairs.imag])[:63], rtol=1e-12)
