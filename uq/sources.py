"""Error sources as data: what they perturb, how, and in which group they count.

A draw depends on (seed, source name, trial, block) alone: never on the batch size, the number of devices, the other
sources, or where a run was resumed.
"""

import zlib
from typing import Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, Key

Target = Literal["F", "M", "omega", "r_cg"]
Kind = Literal["precision", "bias"]
Index = Int[Array, ""] | int

TARGET_UNITS = {"F": "N", "M": "N*m", "omega": "rad/s", "r_cg": "m"}
BLOCK = 4000
"""Samples in a block of draws; always this, since the draws depend on it."""


class Source(eqx.Module):
    """One independent, zero-mean error source."""

    name: str = eqx.field(static=True)
    """Its name, from which its random stream is keyed."""
    target: Target = eqx.field(static=True)
    """The quantity it adds to."""
    kind: Kind = eqx.field(static=True)
    """``precision``: fresh at each sample; ``bias``: one draw per experiment."""
    group: str = eqx.field(static=True)
    """The group it counts in, such as ``load_cell``."""
    sigma: Float[Array | np.ndarray, "3"]
    """Standard deviation on each axis, in the target's SI unit."""
    reference: str = eqx.field(static=True, default="")
    """Where the figure comes from."""


def stream_number(name: str) -> int:
    """Return the number of a source's random stream: a hash of its name that never changes (CRC-32)."""
    return zlib.crc32(name.encode())


def stream(source: Source, key: Key[Array, ""]) -> Key[Array, ""]:
    """Return the source's own key of a campaign: the seed's key folded with a stable hash of the name."""
    return jax.random.fold_in(key, stream_number(source.name))


def draw_bias(source: Source, key: Key[Array, ""], trial: Index, dtype: jnp.dtype) -> Float[Array, "3"]:
    """Return a bias source's one draw of a trial."""
    trial_key = jax.random.fold_in(jax.random.fold_in(stream(source, key), trial), 0)
    return jnp.asarray(source.sigma, dtype) * jax.random.normal(trial_key, (3,), dtype)


def draw_block(
    source: Source, key: Key[Array, ""], trial: Index, block: Index, dtype: jnp.dtype
) -> Float[Array, "3 4000"]:
    """Return a precision source's draws for one block of samples of a trial, component first."""
    block_key = jax.random.fold_in(jax.random.fold_in(stream(source, key), trial), block)
    return jnp.asarray(source.sigma, dtype)[:, None] * jax.random.normal(block_key, (3, BLOCK), dtype)


def draw_sums(source: Source, key: Key[Array, ""], trial: Index, size: int) -> Float[Array, "{size} 3"]:
    """Return independent normal draws, scaled on each axis by sigma, for sums that are drawn instead of samples."""
    sums_key = jax.random.fold_in(jax.random.fold_in(stream(source, key), trial), 0)
    return jax.random.normal(sums_key, (size, 3)) * jnp.asarray(source.sigma)[None]
