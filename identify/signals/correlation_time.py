"""Samples that are correlated in time: how long the correlation lasts."""

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
