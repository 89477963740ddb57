"""Sums of samples that are correlated in time: how long the correlation lasts, and how far such a sum scatters."""

import numpy as np
import scipy
from jaxtyping import Float


def correlation_time(signal: Float[np.ndarray, "n k"]) -> float:
    """Return the integrated correlation time [samples] of the axis where it is longest, to the first zero crossing."""
    n = len(signal)
    size = scipy.fft.next_fast_len(2 * n - 1, real=True)
    power = np.abs(np.fft.rfft(signal, size, axis=0)) ** 2
    correlation = np.fft.irfft(power, size, axis=0)[:n]
    times = []
    for axis in correlation.T:
        if axis[0] > 0:
            negative = np.flatnonzero(axis <= 0)
            times.append(1 + 2 * axis[1 : negative[0] if len(negative) else n].sum() / axis[0])
    return float(min(max(times, default=1.0), n / 4))


def score_covariance(scores: Float[np.ndarray, "n k"], time: float) -> Float[np.ndarray, "k k"]:
    """Return the covariance of a sum of scores: Bartlett's kernel over four correlation times, by moving sums.

    Newey and West, Econometrica 55 (1987) 703, doi:10.2307/1913610.

    Args:
        scores: samples first.
        time: correlation time [samples].
    """
    count = scores.shape[1]
    width = max(1, min(int(np.ceil(4 * time)), len(scores) // 3))
    padded = np.concatenate([np.zeros((width, count)), np.cumsum(scores, axis=0)])
    padded = np.concatenate([padded, np.repeat(padded[-1:], width - 1, axis=0)])
    sums = padded[width:] - padded[:-width]
    rows = 3 * len(scores) / time
    return sums.T @ sums / width * rows / max(rows - count, 1.0)
