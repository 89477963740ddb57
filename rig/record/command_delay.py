"""The delay between two sampled signals, from their cross-correlation."""

from collections import deque
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

LEAST_CORRELATION = 0.7
Signal = deque[tuple[int, tuple[float, ...]]]  # (stamp [ns], values)


class EstimatedDelay(NamedTuple):
    """Delay of the second signal behind the first [s], and their correlation at that shift."""

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
) -> EstimatedDelay | None:
    """Shift of ``b`` (n_b,) against ``a`` (n_a,), sampled at ``time_b`` and ``time_a`` [s], both increasing.

    Both are brought to a common grid of ``step`` [s]; the peak of the correlation coefficient within ``longest`` [s] is
    refined by a parabola. Every shift is judged on the same segment of ``b``, so that the ends do not pull the peak
    towards zero. None when they overlap too little, stand still or do not resemble each other.
    """
    start, stop = max(time_a[0], time_b[0]), min(time_a[-1], time_b[-1])
    grid = np.arange(start, stop, step)
    reach = round(longest / step)
    if len(grid) < 4 * reach:
        return None
    x, y = np.interp(grid, time_a, a), np.interp(grid, time_b, b)[reach : len(grid) - reach]
    with np.errstate(all="ignore"):  # absurd readings give no number, and no delay
        correlation = _coefficients(x, y)[::-1]  # from shift -reach to +reach
    peak = int(np.argmax(correlation))
    if not correlation[peak] >= LEAST_CORRELATION or peak in (0, len(correlation) - 1):
        return None
    left, middle, right = correlation[peak - 1 : peak + 2]
    shift = 0.5 * (left - right) / (left - 2 * middle + right)
    return EstimatedDelay(float((peak - reach + shift) * step), float(middle))


def _coefficients(x: NDArray[np.float64], y: NDArray[np.float64]) -> NDArray[np.float64]:
    """Correlation coefficient of ``y`` (m,) with every segment of ``x`` (n,) of its length: (n - m + 1,)."""
    m = len(y)
    y = y - y.mean()
    length = 2 ** int(np.ceil(np.log2(len(x) + m)))
    products = np.fft.irfft(np.fft.rfft(x, length) * np.conj(np.fft.rfft(y, length)), length)[: len(x) - m + 1]
    sums, squares = (np.concatenate([[0.0], np.cumsum(v)]) for v in (x, x * x))
    power = (squares[m:] - squares[:-m]) - (sums[m:] - sums[:-m]) ** 2 / m
    return products / np.sqrt(np.maximum(power * (y @ y), 1e-24))


def of_command(
    names: tuple[str, ...],
    command: Signal,
    imu: Signal,
) -> EstimatedDelay | None:
    """The delay of the IMU behind commanded angular velocities, on the axis that moves most; None when unclear.

    ``names`` of the command's values: omega_x, omega_y, omega_z are compared. Both signals are (stamp [ns], values).
    """
    axes = [axis for axis in range(3) if f"omega_{'xyz'[axis]}" in names]
    if not axes or len(command) < 10 or len(imu) < 10:
        return None
    origin = command[0][0]
    time_a, a = _arrays(command, origin)
    time_b, b = _arrays(imu, origin)
    columns = {axis: a[:, names.index(f"omega_{'xyz'[axis]}")] for axis in axes}
    with np.errstate(all="ignore"):
        axis = max(axes, key=lambda i: float(columns[i].var()))
    return estimate(time_a, columns[axis], time_b, b[:, axis])


def _arrays(signal: Signal, origin: int) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    time_ = np.array([stamp - origin for stamp, _ in signal]) * 1e-9
    return time_, np.array([values for _, values in signal])
