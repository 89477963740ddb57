"""Low-pass filters without phase, for both sides of the regression."""

from typing import Literal

import numpy as np
from jaxtyping import Float

from identify.rigid_body.regressor import Array, ArrayT

LONGEST = 10_000_000
"""Taps of a low-pass on either side of its middle, at most."""
BLOCK = 2**14
"""Samples that are transformed at a time, where the taps are few."""
ATTENUATION = 100.0
"""Attenuation of the low-pass that brings unequal rates together [dB]."""


def gaussian(rate: float, cutoff: float) -> np.ndarray:
    """Return the taps of a Gaussian low-pass: unit gain at rest, -3 dB at ``cutoff`` [Hz], cut at four σ.

    A Gaussian never rings and is the shortest filter for its bandwidth, so that a short run loses least at its ends.

    Raises:
        ValueError: a cut-off so low that the filter would have millions of taps.
    """
    sigma = np.sqrt(np.log(2)) / (2 * np.pi * cutoff)
    if not 4 * sigma * rate < LONGEST:
        raise ValueError(f"a low-pass of {cutoff:g} Hz is longer than any run: give a higher cut-off frequency")
    half = int(np.ceil(4 * sigma * rate))
    taps = np.exp(-0.5 * (np.arange(-half, half + 1) / (sigma * rate)) ** 2)
    return taps / taps.sum()


def lowpass(rate: float, nyquist: float) -> np.ndarray:
    """Return the taps of a low-pass that is flat within 1e-5 to 0.4 ``nyquist`` and stops from ``nyquist`` on [Hz].

    A Kaiser window of 100 dB. What a slower sensor that samples at twice ``nyquist`` cannot follow does not pass; a
    motion below 0.4 ``nyquist`` is left as it is, so that its products are, too.
    """
    return kaiser_low_pass(rate, 0.4 * nyquist, nyquist, ATTENUATION)


def kaiser(count: int, cutoff: float, shape: float) -> np.ndarray:
    """Return the taps of a low-pass, an odd count: those of the ideal one under a Kaiser window, unit gain at rest.

    Args:
        count: of the taps.
        cutoff: where the gain is a half, as a part of half the rate.
        shape: Kaiser's β.
    """
    taps = np.sinc(cutoff * (np.arange(count) - count // 2)) * np.kaiser(count, shape)
    return np.asarray(taps / taps.sum())


def kaiser_low_pass(rate: float, passed: float, closed: float, attenuation: float) -> np.ndarray:
    """Return the taps of a low-pass under a Kaiser window, an odd count.

    Args:
        rate: sample rate [Hz].
        passed: highest frequency that passes [Hz].
        closed: lowest frequency that is stopped [Hz].
        attenuation: of what is stopped, above 50 [dB].
    """
    width = 2 * (closed - passed) / rate  # of the transition, as a part of half the rate
    count = int(np.ceil((attenuation - 7.95) / (2.285 * np.pi * width))) // 2 * 2 + 1
    return kaiser(count, (passed + closed) / rate, 0.1102 * (attenuation - 8.7))


def response(taps: np.ndarray, rate: float, frequency: np.ndarray) -> np.ndarray:
    """Return the gain of symmetric taps at each frequency [Hz]."""
    lags = (np.arange(len(taps)) - len(taps) // 2) / rate
    return np.cos(2 * np.pi * np.multiply.outer(frequency, lags)) @ taps


def apply(signals: Float[ArrayT, "k n"], taps: Float[Array, " odd"]) -> Float[ArrayT, "k m"]:
    """Filter each row, of an array of JAX or of NumPy; half the taps are lost at either end, m = n - taps + 1."""
    if signals.shape[1] < taps.shape[0]:
        raise ValueError(f"Argument `signals` must have {taps.shape[0]} samples or more, but has {signals.shape[1]}.")
    if isinstance(signals, np.ndarray):
        return convolved(signals, np.asarray(taps))
    import jax
    from jax.scipy.signal import fftconvolve

    filtered = lambda signal: fftconvolve(signal, taps.astype(signal.dtype), mode="valid")  # noqa: E731
    return jax.vmap(filtered)(signals)


def convolved(signals: Float[np.ndarray, "k n"], taps: Float[np.ndarray, " t"]) -> Float[np.ndarray, "k m"]:
    """Return the convolution of each row with taps where these lie within it, m = n - taps + 1.

    By transforms of blocks that overlap by the taps (overlap-save), which stay in the processor's cache.
    """
    import scipy  # `inertia inspect` averages without it

    reach, count = len(taps) - 1, signals.shape[1] - len(taps) + 1
    size = scipy.fft.next_fast_len(min(signals.shape[1], max(BLOCK, 8 * reach)), real=True)
    response, filtered = scipy.fft.rfft(taps, size), np.empty((len(signals), count))
    for row, signal in zip(filtered, signals, strict=True):
        for start in range(0, count, size - reach):
            block = scipy.fft.irfft(scipy.fft.rfft(signal[start : start + size], size) * response, size)
            part = row[start : start + size - reach]
            part[:] = block[reach : reach + len(part)]
    return filtered


def means(values: Float[np.ndarray, "n *k"], count: int) -> Float[np.ndarray, "m *k"]:
    """Return the means of so many samples at a time, one behind the other; what is left over at the end counts not."""
    number = len(values) // count
    return np.asarray(values[: number * count].reshape(number, count, *values.shape[1:]).mean(axis=1))


def moving_average(
    signal: Float[np.ndarray, "n *k"], width: int, *, ends: Literal["symmetric", "edge", "fewer"] = "symmetric"
) -> Float[np.ndarray, "n *k"]:
    """Return the mean of ``width`` samples about each, one more before than after where that is even.

    In blocks as long as the window, each of which is the end of one block and the beginning of the next: no sum is of
    more samples than that, so that large ones do not spoil small ones far off. SciPy's takes longer to import.

    Args:
        signal: samples first.
        width: of the window.
        ends: what stands for samples before the first and after the last: the signal mirrored, or its last value; or
            none, so that the mean is of fewer.
    """
    if signal.ndim == 2 and len(signal) > BLOCK:  # one after the other to bound memory
        return np.stack([moving_average(column, width, ends=ends) for column in signal.T]).T
    before, blocks = width // 2, -(-len(signal) // width) + 1
    beyond = [(before, blocks * width - len(signal) - before), *[(0, 0)] * (signal.ndim - 1)]
    padded = np.pad(signal, beyond, "constant" if ends == "fewer" else ends)
    tiles = padded.reshape(blocks, width, *signal.shape[1:])
    left = np.cumsum(tiles[:-1, ::-1], axis=1)[:, ::-1]
    right = np.cumsum(tiles[1:], axis=1) - tiles[1:]
    sums = (left + right).reshape(-1, *signal.shape[1:])[: len(signal)]
    if ends == "fewer":
        first = np.arange(len(signal)) - before
        counts = np.minimum(first + width, len(signal)) - np.maximum(first, 0)
        return np.asarray((sums.T / counts).T)
    return np.asarray(sums / width)


def thinned(signal: Float[np.ndarray, "n k"], step: int) -> Float[np.ndarray, "m k"]:
    """Return every so many-th sample, low-passed; the straight line from the first to the last stands for the ends."""
    if step == 1:
        return signal
    reach, line = 10 * step, np.linspace(signal[0], signal[-1], len(signal))
    padded = np.pad(signal - line, ((reach, reach), (0, 0)))
    return np.asarray(line[::step] + apply(padded.T, kaiser(2 * reach + 1, 1 / step, 5.0)).T[::step])
