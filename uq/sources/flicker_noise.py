"""Coloured noise from its Allan parameters: white noise, flicker and random walk.

With the two-sided spectrum ``N² + B² / (2π f) + K² / (2π f)²`` of IEEE Std 952-1997, annex C, the Allan variance at
averaging time τ is ``N²/τ + (2 ln 2/π) B² + K² τ/3``.
"""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Key

from uq.sources.source import BLOCK, Index, Source, block_key, stream_number

PARAMETERS = ("white", "flicker", "random_walk")
"""N, B and K: angle random walk, bias instability and rate random walk, when the signal is an angular velocity."""


def draw_coloured(
    source: Source, key: Key[Array, ""], trial: Index, n: int, rate: Float[Array, ""], dtype: Any
) -> Float[Array, "3 n"]:
    """Return ``n`` samples of a coloured source in one trial, at a sample rate [Hz], component first."""
    drawn = [_white(source, key, trial, n, number, dtype) for number in range(len(PARAMETERS))]
    n_, b, k = (jnp.asarray(source.settings[name])[:, None] for name in PARAMETERS)
    root = jnp.sqrt(rate)
    white, flicker, walk = drawn[0], pink(drawn[1]), jnp.cumsum(drawn[2], axis=1)
    return (n_ * root).astype(dtype) * white + b.astype(dtype) * flicker + (k / root).astype(dtype) * walk


def _white(source: Source, key: Key[Array, ""], trial: Index, n: int, number: int, dtype: Any) -> Float[Array, "3 n"]:
    """Standard normal samples, block by block as all draws."""
    stream = stream_number(source.name)
    own = lambda block: jax.random.fold_in(block_key(stream, key, trial, block), number)  # noqa: E731
    blocks = jax.lax.map(lambda block: jax.random.normal(own(block), (3, BLOCK), dtype), jnp.arange(-(-n // BLOCK)))
    return blocks.swapaxes(0, 1).reshape(3, -1)[:, :n]


def pink(white: Float[Array, "3 n"]) -> Float[Array, "3 n"]:
    """Return flicker noise of B = 1 from white noise of unit variance: half an integration, from rest.

    The filter ``(1 - z⁻¹)^(-1/2)`` of Kasdin (doi:10.1109/5.381848), whose response to an impulse at lag k is
    ``∏ (j - 1/2) / j``, j = 1 … k; its spectrum is ``1 / (2π f)`` well below the sample rate.
    """
    n = white.shape[1]
    lags = np.arange(1, n)
    response = jnp.asarray(np.concatenate([[1.0], np.cumprod((lags - 0.5) / lags)]), white.dtype)
    size = 1 << (2 * n - 1).bit_length()
    return jnp.fft.irfft(jnp.fft.rfft(white, size) * jnp.fft.rfft(response, size)[None], size)[:, :n]
