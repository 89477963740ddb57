"""The delay between two sampled signals, from their cross-correlation."""

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

LEAST_CORRELATION = 0.7


class Delay(NamedTuple):
    """How much later the second signal shows what the first did [s], and their correlation at that shift."""

    seconds: float
    correlation: float


def estimate(
    time_a: NDArray[np.float64],
    a: NDArray[np.float64],
    time_b: NDArray[np.float64],
    b: NDArray[np.float64],
    *,
    step: float = 1e-3,
    longest: float = 0.5,
) -> Delay | None:
    """Shift of ``b`` (n_b,) against ``a`` (n_a,), sampled at ``time_b`` and ``time_a`` [s], both increasing.

    Both are brought to a common grid of ``step`` [s]; the peak of the normalised cross-correlation within ``longest``
    [s] is refined by a parabola. None when they overlap too little, stand still or do not resemble each other.
    """
    start, stop = max(time_a[0], time_b[0]), min(time_a[-1], time_b[-1])
    grid = np.arange(start, stop, step)
    reach = round(longest / step)
    if len(grid) < 4 * reach:
        return None
    x, y = np.interp(grid, time_a, a), np.interp(grid, time_b, b)
    x, y = x - x.mean(), y - y.mean()
    size = float(np.sqrt((x @ x) * (y @ y)))
    if size < 1e-12:
        return None
    length = 2 ** int(np.ceil(np.log2(2 * len(grid))))
    correlation = np.fft.irfft(np.conj(np.fft.rfft(x, length)) * np.fft.rfft(y, length), length)
    window = np.concatenate([correlation[-reach:], correlation[: reach + 1]]) / size
    peak = int(np.argmax(window))
    if window[peak] < LEAST_CORRELATION or peak in (0, len(window) - 1):
        return None
    left, middle, right = window[peak - 1 : peak + 2]
    shift = 0.5 * (left - right) / (left - 2 * middle + right)
    return Delay(float((peak - reach + shift) * step), float(middle))
