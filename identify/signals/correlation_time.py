"""Samples that are correlated in time: how long the correlation lasts."""

import numpy as np
import scipy
from jaxtyping import Float


def correlation_time(signal: Float[np.ndarray, "n k"]) -> float:
    """Return the integrated correlation time [samples] of the axis where it is longest, to the first zero crossing."""
    return float(min(max(map(_of_axis, signal.T), default=1.0), len(signal) / 4))


def _of_axis(values: Float[np.ndarray, " n"]) -> float:
    """Return the integrated correlation time [samples] of one axis; 1 where it is constant zero."""
    n = len(values)
    size = scipy.fft.next_fast_len(2 * n - 1, real=True)
    lines = np.fft.rfft(values, size)
    correlation = np.fft.irfft(lines.real**2 + lines.imag**2, size)[:n]
    if not correlation[0] > 0:
        return 1.0
    negative = np.flatnonzero(correlation <= 0)
    return float(1 + 2 * correlation[1 : negative[0] if len(negative) else n].sum() / correlation[0])
