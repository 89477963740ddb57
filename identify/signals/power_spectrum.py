"""Power spectra by Welch's method (doi:10.1109/TAU.1967.1161901), in NumPy; a signal's band, noise, correlation time.

SciPy's own bring all of its statistics along, whose import takes longer than every spectrum of a run.
"""

from typing import Literal

import numpy as np
import scipy
from jaxtyping import Float

WINDOWS = {"hann": (0.5, 0.5), "blackmanharris": (0.35875, 0.48829, 0.14128, 0.01168)}
"""Amplitudes of their cosines, of alternating sign."""
BATCH = 2**18
"""Samples of the segments that are transformed at a time."""
LAGS = 1024
"""Lags of a correlation that are looked at first."""


def welch(
    signal: Float[np.ndarray, "n *k"],
    rate: float,
    size: int,
    *,
    window: Literal["hann", "blackmanharris"] = "hann",
    straight: bool = False,
) -> tuple[Float[np.ndarray, " m"], Float[np.ndarray, "m *k"]]:
    """Return frequencies [Hz] and one-sided power densities [unit²/Hz], the mean of segments that overlap by half.

    Args:
        signal: samples first.
        rate: sample rate [Hz].
        size: samples of a segment, or a few fewer, whose transform is fast; all that there are, where these are fewer.
        window: that weighs a segment's samples; the second one leaks less.
        straight: whether the straight line through a segment is taken off, and not only its mean.
    """
    size = scipy.fft.prev_fast_len(min(size, len(signal)))
    angle = 2 * np.pi * np.arange(size) / size
    weights = sum((-1) ** k * a * np.cos(k * angle) for k, a in enumerate(WINDOWS[window]))
    segments = np.lib.stride_tricks.sliding_window_view(signal, size, axis=0)[:: size - size // 2]

    def power(some: np.ndarray) -> np.ndarray:
        level = without_line(some) if straight else some - some.mean(axis=-1, keepdims=True)
        lines = scipy.fft.rfft(level * weights)
        return (lines.real**2 + lines.imag**2).sum(axis=0)

    together = max(BATCH // size, 1)  # bounds memory
    total = sum(power(segments[k : k + together]) for k in range(0, len(segments), together))
    density = np.asarray(total) / (len(segments) * rate * (weights**2).sum())
    density[..., 1 : (size + 1) // 2] *= 2  # but for the lines of a constant and of half the rate
    return np.arange(size // 2 + 1) * rate / size, np.moveaxis(density, -1, 0)


def without_line(signal: Float[np.ndarray, "*k n"]) -> Float[np.ndarray, "*k n"]:
    """Return a signal less the straight line of least squares through its samples, along the last axis."""
    time = np.arange(signal.shape[-1]) - (signal.shape[-1] - 1) / 2
    level = signal - signal.mean(axis=-1, keepdims=True)
    return level - (level @ time / max(time @ time, 1e-300))[..., None] * time


def motion_band(omega: np.ndarray, rate: float) -> float:
    """Return the highest frequency [Hz] at which a recorded motion stands out from the gyro's noise.

    Welch's spectrum of the angular velocity, shape (n, 3), in eight segments or more, against its own median above an
    eighth of the rate; a Blackman–Harris window, whose leakage is below the noise of any gyro.
    """
    return band_of(*motion_spectrum(omega, rate), rate)


def motion_spectrum(omega: np.ndarray, rate: float) -> tuple[Float[np.ndarray, " m"], Float[np.ndarray, "m k"]]:
    """Return frequencies and power density of a recorded motion, in segments of a quarter of it."""
    return welch(omega, rate, max(len(omega) // 4, 8), window="blackmanharris")


def band_of(frequency: Float[np.ndarray, " m"], power: Float[np.ndarray, "m k"], rate: float) -> float:
    """Return :func:`motion_band` of a spectrum."""
    floor = np.median(power[frequency > rate / 8], axis=0)
    stands_out = (power > np.maximum(100 * floor, 1e-9 * power.max())).any(axis=1)
    return float(frequency[stands_out].max(initial=frequency[1]))


def occupied_band(signal: np.ndarray, rate: float) -> float:
    """Return the frequency [Hz] below which four fifths of a signal's power above its noise lie, shape (n, 3)."""
    frequency, power = welch(signal, rate, max(round(8 * rate), 8))
    above = np.maximum(power - np.median(power[frequency > rate / 8], axis=0), 0).sum(axis=1)
    share = np.cumsum(above) / max(above.sum(), 1e-300)
    return float(frequency[min(int(np.searchsorted(share, 0.8)), len(frequency) - 1)])


def noise_level(*segments: np.ndarray) -> np.ndarray:
    """Return the standard deviation of white noise on each axis of samples (n, 3), from their fourth differences."""
    long = [segment for segment in segments if len(segment) >= 6]
    if not long:
        return np.zeros(3)
    squares = [[np.square(np.diff(axis, 4)).sum() for axis in segment.T] for segment in long]
    return np.sqrt(np.sum(squares, axis=0) / sum(len(segment) - 4 for segment in long) / 70)


def correlation_time(signal: Float[np.ndarray, "n k"]) -> float:
    """Return the integrated correlation time [samples] of the axis where it is longest, to the first zero crossing."""
    return float(min(max(map(_correlation_time, signal.T), default=1.0), len(signal) / 4))


def _correlation_time(values: Float[np.ndarray, " n"]) -> float:
    """Return the integrated correlation time [samples] of one axis; 1 where it is constant zero."""
    n, lags = len(values), min(LAGS, len(values))
    while True:
        correlation = _correlation(values, lags)
        if not correlation[0] > 0:
            return 1.0
        negative = np.flatnonzero(correlation <= 0)
        if len(negative) or lags == n:
            return float(1 + 2 * correlation[1 : negative[0] if len(negative) else n].sum() / correlation[0])
        lags = min(8 * lags, n)


def _correlation(values: Float[np.ndarray, " n"], lags: int) -> Float[np.ndarray, " lags"]:
    """Return the sums of products of a signal's samples that are so many lags apart."""
    count = -(-len(values) // lags)
    blocks, total = np.zeros((count + 1, lags)), np.zeros(lags + 1, complex)
    blocks.reshape(-1)[: len(values)] = values
    together = max(BATCH // lags, 1)  # bounds memory
    for k in range(0, count, together):
        first, second = blocks[k : min(k + together, count)], blocks[k + 1 : min(k + together, count) + 1]
        alone, beside = (scipy.fft.rfft(part, 2 * lags) for part in (first, np.hstack([first, second])))
        total += (alone.conj() * beside).sum(axis=0)
    return np.asarray(scipy.fft.irfft(total, 2 * lags)[:lags])
