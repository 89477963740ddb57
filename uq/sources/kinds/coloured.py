"""Coloured noise from its Allan parameters: white noise, flicker and random walk.

With the two-sided spectrum ``N² + B² / (2π f) + K² / (2π f)²`` of IEEE Std 952-1997, annex C, the Allan variance at
averaging time τ is ``N²/τ + (2 ln 2/π) B² + K² τ/3``.
"""

from collections.abc import Mapping
from typing import Annotated, Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Key

from rig.toml_tables import WrongKeyError
from uq.sources.draws import BLOCK, block_key, stream_number
from uq.sources.random_normals import Index
from uq.sources.source import SIGNAL_UNITS, ErrorKind, SignalRange, Source
from uq.sources.source_figures import figures

PARAMETERS = ("white", "flicker", "random_walk")
"""N, B and K: angle random walk, bias instability and rate random walk, when the signal is an angular velocity."""
UNITS = ("{}*s**0.5", "{}", "{}/s**0.5")
"""Of the parameters, from the signal's."""


class Coloured(ErrorKind):
    """Adds noise with these Allan parameters; flicker and random walk start from zero at the run's start."""

    name = "coloured"
    targets = SIGNAL_UNITS
    noise = True
    needs_samples = True
    averages_out = True
    sizes = PARAMETERS

    def keys(self, target: str) -> dict[str, Any]:
        """Return the three parameters, each of which may be missing."""
        units = [unit.format(self.targets[target]) for unit in UNITS]
        stated = [Annotated[np.ndarray, figures(unit, self.shape, least=0)] | None for unit in units]
        return dict(zip(PARAMETERS, stated, strict=True))

    def settings(self, keys: Mapping[str, Any]) -> dict[str, np.ndarray]:
        """Return the three parameters, zero where one is not stated."""
        if all(keys[name] is None for name in PARAMETERS):
            raise WrongKeyError("white", f"give {', '.join(PARAMETERS)} or some of them")
        return {name: np.zeros(3) if keys[name] is None else keys[name] for name in PARAMETERS}

    def noise_samples(
        self, source: Source, key: Key[Array, ""], trial: Index, n: int, rate: Float[Array, ""], dtype: Any
    ) -> Float[Array, "3 n"]:
        """Return ``n`` samples in one trial, at a sample rate [Hz], component first."""
        drawn = [_white(source, key, trial, n, number, dtype) for number in range(len(PARAMETERS))]
        n_, b, k = (jnp.asarray(source.settings[name])[:, None] for name in PARAMETERS)
        root = jnp.sqrt(rate)
        white, flicker, walk = drawn[0], pink(drawn[1]), jnp.cumsum(drawn[2], axis=1)
        return (n_ * root).astype(dtype) * white + b.astype(dtype) * flicker + (k / root).astype(dtype) * walk

    def white_variance(self, source: Source, rate: float) -> np.ndarray:
        """Return the variance of its white part."""
        return np.square(source.settings["white"]) * rate

    def beyond_the_law(self, source: Source, signal: SignalRange) -> str | None:
        """Return that flicker and random walk are not white."""
        coloured = any(np.any(source.settings[name]) for name in PARAMETERS[1:])
        return "is noise that is not white, which the law does not take" if coloured else None


def _white(source: Source, key: Key[Array, ""], trial: Index, n: int, number: int, dtype: Any) -> Float[Array, "3 n"]:
    """Standard normal samples, block by block as all draws."""
    stream = stream_number(source.name)
    of_block = lambda block: jax.random.fold_in(block_key(stream, key, trial, block), number)  # noqa: E731
    draw = lambda block: jax.random.normal(of_block(block), (3, BLOCK), dtype)  # noqa: E731
    blocks = jax.lax.map(draw, jnp.arange(-(-n // BLOCK)))
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
