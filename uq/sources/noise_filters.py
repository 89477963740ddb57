"""Noise as white noise behind a filter: what sums over samples need to know of it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import scipy
from jaxtyping import Float
from numpy import fft


@dataclass(frozen=True)
class NoiseFilter:
    """A filter from rest that makes noise of white noise of unit variance. Two of one name are the same."""

    name: str
    impulse_response: Callable[[np.ndarray], np.ndarray] = field(compare=False, repr=False)
    """Function of the lags 0, 1, … in samples."""

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


WHITE = NoiseFilter("white", np.ones_like)
WALK = NoiseFilter("random walk", np.ones_like)
"""A running sum."""


class NoisePart(NamedTuple):
    """A part of a source's noise."""

    filter: NoiseFilter
    sigma: Float[np.ndarray, "3"]
    """Standard deviation of the white noise that drives it, axis by axis [SI]."""


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
