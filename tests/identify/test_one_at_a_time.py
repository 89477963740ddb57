"""Batches one member after the other: the same numbers as a loop, however they are batched, in the memory of one."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from identify import EstimatorSpec, ordinary_least_squares
from identify.one_at_a_time import one_at_a_time

N = 4000
SPEC = EstimatorSpec("matched", "savitzky-golay", band=2.0)


def trial(omega, r_cg):
    t = jnp.arange(N, dtype=omega.dtype)[:, None] / 400
    force = jnp.concatenate([jnp.sin(3 * t), jnp.cos(2 * t), 1 + jnp.sin(t)], axis=1)
    return ordinary_least_squares(force, 0.3 * force[::-1], omega, rate=400.0, r_cg=r_cg, estimator=SPEC)


single, several = jax.jit(trial), jax.jit(jax.vmap(trial))


@pytest.fixture(scope="module")
def batch():
    generator = np.random.default_rng(4)
    return jnp.asarray(generator.normal(size=(4, N, 3)).cumsum(axis=1) / 50), jnp.asarray(generator.normal(size=(4, 3)))


def test_however_it_is_batched_it_is_the_loop(batch):
    omega, r_cg = batch
    loop = np.stack([[single(w, r) for r in r_cg] for w in omega])
    one_axis = several(omega, r_cg)
    np.testing.assert_allclose(one_axis, loop[np.arange(4), np.arange(4)], rtol=1e-12)
    both = jax.jit(jax.vmap(jax.vmap(trial, (None, 0)), (0, None)))(omega, r_cg)
    np.testing.assert_allclose(both, loop, rtol=1e-12)


def test_a_batch_over_devices(batch):
    """Keys that are sharded by an explicit mesh, and members that a shard_map gives to each device."""
    omega, r_cg = batch
    expected = several(omega, r_cg)
    explicit = jax.make_mesh((2,), ("trials",), axis_types=(jax.sharding.AxisType.Explicit,))
    spread = [jax.device_put(x, jax.NamedSharding(explicit, jax.P("trials"))) for x in (omega, r_cg)]
    np.testing.assert_allclose(jax.jit(jax.vmap(trial))(*spread), expected, rtol=1e-12)
    plain = jax.make_mesh((2,), ("trials",), axis_types=(jax.sharding.AxisType.Auto,))
    part = jax.P("trials")
    mapped = jax.shard_map(jax.vmap(trial), mesh=plain, in_specs=(part, part), out_specs=part)
    np.testing.assert_allclose(jax.jit(mapped)(omega, r_cg), expected, rtol=1e-12)


def test_a_batch_takes_the_memory_of_one(batch):
    """Of what the compiled programs hold beside their inputs: side by side, four members would take four times as much."""
    one = single.lower(*(x[0] for x in batch)).compile().memory_analysis().temp_size_in_bytes
    four = several.lower(*batch).compile().memory_analysis().temp_size_in_bytes
    assert four < 2 * one


def test_derivatives_of_a_batch(batch):
    """Those of each member, through a tree of results."""
    squares = one_at_a_time(lambda x, y: {"square": x**2 * y, "sum": x + y})
    x, y = jnp.arange(1.0, 5.0), jnp.asarray(3.0)
    total = lambda x: jnp.sum(jax.vmap(squares, (0, None))(x, y)["square"])  # noqa: E731
    np.testing.assert_allclose(jax.grad(total)(x), 6 * x)
    np.testing.assert_allclose(jax.vmap(jax.jacfwd(squares), (0, None))(x, y)["sum"], 1)


def test_the_precision_is_that_of_the_signals(batch):
    omega, r_cg = batch[0][0], batch[1][0]
    narrow = single(omega.astype("float32"), r_cg)
    assert narrow.dtype == "float32"
    np.testing.assert_allclose(narrow, single(omega, r_cg), rtol=1e-3, atol=1e-4 * np.abs(narrow).max())
    alpha = SPEC.derivative(omega, 400.0)
    assert SPEC.derivative(omega.astype("float32"), 400.0).dtype == "float32"
    assert len(alpha) == N - 2 * SPEC.reach(400.0)
