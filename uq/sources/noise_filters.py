"""Noise as white noise behind a filter.

Sums over samples need a filter's impulse response, trials by samples its output block by block.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
import scipy
from jaxtyping import Array, Float
from numpy import fft

FilterBlock = Callable[[Callable[[Any], Float[Array, "3 n"]], Any, Any], tuple[Float[Array, "3 n"], Any]]
"""Function of a generator of white noise of unit variance, which takes its type; of what the filter remembers from the
block before; and of the samples' type. It returns a block, component first, and what is remembered for the next."""


@dataclass(frozen=True)
class NoiseFilter:
    """A filter from rest that makes noise of white noise of unit variance. Two of one name are the same."""

    name: str
    impulse_response: Callable[[np.ndarray], np.ndarray] = field(compare=False, repr=False)
    """Function of the lags 0, 1, … in samples."""
    block: "FilterBlock" = field(compare=False, repr=False)
    """Function that makes the output, block by block."""
    at_rest: Callable[[Any], Any] = field(compare=False, repr=False, default=lambda dtype: ())
    """Function of the samples' type that gives what it remembers at the run's start: any tree of arrays."""

    def response(self, n: int) -> Float[np.ndarray, " k"]:
        """Return its response to an impulse over ``n`` samples; of white noise over one."""
        return self.impulse_response(np.arange(1.0 if self == WHITE else float(n)))

    def autocovariance(self, n: int) -> Float[np.ndarray, " lags"]:
        """Return the noise's autocovariance over lags -m … m, averaged over a run of ``n`` samples."""
        h = self.response(n)
        if len(h) == 1:
            return h**2
        lags, size = np.arange(n), scipy.fft.next_fast_len(2 * n, real=True)
        spectrum = fft.rfft(h, size)
        weighted, plain = (
            fft.irfft(np.conj(fft.rfft(x, size)) * spectrum, size)[:n] for x in ((n - lags) * h, h)
        )  # the noise at a sample holds the draws up to there: n - lag - k of them meet those k samples before
        half = (weighted - lags * plain) / (n - lags)
        return np.concatenate([half[:0:-1], half])


def _running_sum(
    white: Callable[[Any], Float[Array, "3 n"]], total: Float[Array, "3"], dtype: Any
) -> tuple[Float[Array, "3 n"], Float[Array, "3"]]:
    sums = total[:, None] + jnp.cumsum(white(dtype), axis=1)
    return sums, sums[:, -1]


WHITE = NoiseFilter("white", np.ones_like, lambda white, memory, dtype: (white(dtype), memory))
WALK = NoiseFilter("random walk", np.ones_like, _running_sum, lambda dtype: jnp.zeros(3, dtype))
"""A running sum."""


class NoisePart(NamedTuple):
    """A part of a source's noise."""

    filter: NoiseFilter
    sigma: Float[Array | np.ndarray, "3"]
    """Standard deviation of the white noise that drives it, axis by axis [SI]."""
    stream: int = 0
    """Number of that white noise among those of the source: parts of one number share their draws."""


class GyroNoise(NamedTuple):
    """Noise of omega that acts in a case."""

    parts: Mapping[NoiseFilter, Float[np.ndarray, "3 3"]]
    """Covariance of the axes' driving white noises, by filter [rad²/s²]."""
    third_cumulant: Float[np.ndarray, "3"]
    """Third cumulant of the white noise of one sample [rad³/s³]: zero if it is symmetric."""
    fourth_cumulant: Float[np.ndarray, "3"]
    """Fourth cumulant of the white noise of one sample [rad⁴/s⁴]: zero if it is normal."""

    @classmethod
    def white(cls, covariance: Float[np.ndarray, "3 3"]) -> "GyroNoise":
        """Return white normal noise of this covariance of the axes at one sample [rad²/s²]."""
        return cls({WHITE: covariance}, np.zeros(3), np.zeros(3))

    @classmethod
    def together(cls, noises: Sequence["GyroNoise"]) -> "GyroNoise":
        """Return independent noises added."""
        parts: dict[NoiseFilter, np.ndarray] = {}
        for noise in noises:
            for filter_, size in noise.parts.items():
                parts[filter_] = parts.get(filter_, 0) + size
        zero = np.zeros(3)
        third, fourth = (noise.third_cumulant for noise in noises), (noise.fourth_cumulant for noise in noises)
        return cls(parts, sum(third, zero), sum(fourth, zero))
