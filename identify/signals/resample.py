"""Samples of two sensors at common, uniform instants: gaps, jitter, unequal rates, interpolation.

The spline through uniform samples is in NumPy: SciPy's import takes longer than every spline of a run. With B-splines
at the samples, the coefficients are the samples through the inverse of a short symmetric filter (Unser, Aldroubi and
Eden 1993, doi:10.1109/78.193220). What that leaves open at the ends is settled as SciPy does it: no knot at the samples
next to either end.
"""

from functools import cache
from math import comb, factorial
from typing import NamedTuple

import numpy as np
import scipy
from jaxtyping import Float

from identify.display.text_tables import counted
from identify.exceptions import RunError
from identify.signals.filters import apply, lowpass

JITTER_TOLERANCE = 1e-3
"""Departure from uniform sampling, as a part of the sample interval, below which samples are taken as they are."""
JITTER_WARNING = 0.05
"""Standard deviation of the intervals, as a part of the usual one, that is worth a warning."""
MISSING_WARNING = 0.1
"""Share of samples without which an interval grows by a twentieth, as the root of their number."""
GAP = 5.0
"""Sample intervals without a sample that count as a gap."""
CROWDED = 1e-4
"""Part of the usual interval within which a sample behind another is left out: a spline through both would leap. Stamps
that jitter are not thinned: the jitter is then named."""
SPARSE = 1000
"""Duration, in sample intervals for each sample, beyond which a clock has jumped: an hour's pause is no more."""
UNEQUAL = 1.2
"""Ratio of two rates beyond which the faster sensor would alias into the slower one's band."""
AT_SAMPLES = {3: np.array([1, 4, 1]) / 6, 5: np.array([1, 26, 66, 26, 1]) / 120}
"""A B-spline's values, by degree."""
REACH = 64
"""Samples after which the inverse of the filter has died out, to below rounding."""


class UniformSpline(NamedTuple):
    """A spline, cell by cell between its nodes."""

    pieces: Float[np.ndarray, "powers cells channels"]
    """Coefficients of the powers of the time since the cell's node [s], the highest first."""
    step: float
    """Time from node to node [s]."""

    def __call__(self, t: Float[np.ndarray, " n"], order: int = 0) -> Float[np.ndarray, "n channels"]:
        """Return its values, or its derivative of an order, at instants [s] after the first node."""
        cell = np.clip(np.floor(t / self.step).astype(int), 0, self.pieces.shape[1] - 1)
        since = (t - self.step * cell)[:, None]
        degree = len(self.pieces) - 1
        total = np.zeros((len(t), self.pieces.shape[2]))
        for power, pieces in zip(range(degree, order - 1, -1), self.pieces, strict=False):
            total *= since
            part = pieces.take(cell, axis=0)  # in a quarter of the time of an index in brackets
            total += part if order == 0 else factorial(power) / factorial(power - order) * part
        return total


def uniform_spline(samples: Float[np.ndarray, "n channels"], step: float, *, degree: int = 3) -> UniformSpline:
    """Return the spline through samples at every step [s], at least as many as its degree and one more.

    Args:
        samples: at the nodes.
        step: from node to node [s].
        degree: 3 or 5.
    """
    coefficients, count = _coefficients(samples, degree), len(samples) - 1
    windows = np.stack([coefficients[k : k + count] for k in range(degree + 1)])
    scales = step ** -np.arange(degree, -1.0, -1.0)
    return UniformSpline(np.tensordot(scales[:, None] * _powers(degree), windows, axes=1), step)


@cache
def _powers(degree: int) -> np.ndarray:
    """Return the B-splines' coefficients in a cell of unit length, by power, the highest first."""
    table = np.zeros((degree + 1, degree + 1))
    for k in range(degree + 1):  # sums of truncated powers (u + reach)^degree
        for j in range(degree - k + 1):
            reach, sign = degree - k - j, (-1) ** j * comb(degree + 1, j) / factorial(degree)
            table[:, k] += [sign * comb(degree, p) * reach ** (degree - p) for p in range(degree, -1, -1)]
    return table


def _coefficients(samples: np.ndarray, degree: int) -> np.ndarray:
    """Return the coefficients of the B-splines at the samples and half a degree beyond either end."""
    n, half = len(samples), degree // 2
    inverse, decays = _inverse_filter(degree)
    beyond, edge = REACH + half, half + degree + 1
    inside = apply(np.pad(samples.T, ((0, 0), (beyond, beyond))), inverse).T
    start_transients = decays ** np.arange(n + 2.0 * half)[:, None]
    ends = np.concatenate([start_transients, start_transients[::-1]], axis=1)  # what the samples do not see

    def jumps(c: np.ndarray) -> np.ndarray:
        """Jumps of the highest derivative at what shall be no knot."""
        return np.concatenate([np.diff(part, degree + 1, axis=0) for part in (c[:edge], c[-edge:])])

    return np.asarray(inside - ends @ np.linalg.solve(jumps(ends), jumps(inside)))


@cache
def _inverse_filter(degree: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the taps that undo a B-spline's values at the samples, and the decays from sample to sample of these."""
    taps = AT_SAMPLES[degree]
    inverse = np.fft.fftshift(np.fft.irfft(1 / np.abs(np.fft.rfft(taps, 2 * REACH + 2)), 2 * REACH + 2))[1:]
    return inverse, np.array([root for root in np.roots(taps) if abs(root) < 1]).real


def is_uniform(t: np.ndarray) -> bool:
    """Whether instants are uniform, within ``JITTER_TOLERANCE``."""
    step = (t[-1] - t[0]) / (len(t) - 1)
    return bool(np.max(np.abs(t - t[0] - step * np.arange(len(t)))) < JITTER_TOLERANCE * step)


def interval(t: np.ndarray) -> float:
    """The mean interval between samples, gaps left out [s]."""
    steps = np.diff(t)
    return float(steps[steps <= GAP * np.median(steps)].mean())


def in_gap(t: np.ndarray, at: np.ndarray, reach: float) -> np.ndarray:
    """Return the mask of instants ``at`` inside a gap between the samples ``t``, or within ``reach`` of one [s]."""
    steps = np.diff(t)
    inside = np.zeros(len(at), bool)
    for k in np.flatnonzero(steps > GAP * np.median(steps)):
        inside |= (at >= t[k] - reach) & (at < t[k + 1] + reach)
    return inside


def beside(bad: np.ndarray, at: np.ndarray, reach: float) -> np.ndarray:
    """Return the mask of instants ``at`` within ``reach`` [s] of a bad one."""
    bad = np.sort(bad)
    first, last = np.searchsorted(bad, at - reach), np.searchsorted(bad, at + reach, side="right")
    return last > first


def below(
    nyquist: float, times: list[np.ndarray], columns: list[np.ndarray], intervals: list[float], name: str
) -> tuple[list[np.ndarray], list[np.ndarray], float]:
    """Return both sensors' samples at uniform instants of their own, without frequencies above ``nyquist`` [Hz]."""
    uniform, filtered, reach = [], [], 0.0
    for t, values, interval in zip(times, columns, intervals, strict=True):
        taps = lowpass(1 / interval, nyquist)
        half = len(taps) // 2
        at = t[0] + interval * np.arange(int((t[-1] - t[0]) / interval * (1 + 1e-9)) + 1)
        if len(at) < len(taps) + 4:
            raise RunError(
                f"{name} lasts {t[-1] - t[0]:.3g} s, too short to bring its two rates together: record for longer"
            )
        filtered.append(apply(interpolate(t, values, at).T, taps).T)
        uniform.append(at[half : len(at) - half])
        reach = max(reach, half * interval)
    return uniform, filtered, reach


def refuse_jump(channel: str, t: np.ndarray, name: str) -> None:
    """Refuse instants with a gap so long that its uniform samples would fill the memory.

    Raises:
        RunError: they last longer than ``SPARSE`` intervals for each sample.
    """
    if t[-1] - t[0] > SPARSE * len(t) * interval(t):
        steps = np.diff(t)
        raise RunError(
            f"time of the {channel} in {name} jumps by {steps.max():.3g} s at {t[np.argmax(steps)]:.6g} s: "
            "use the other clock or record again"
        )


def apart(t: np.ndarray) -> np.ndarray:
    """Return the mask of samples that do not follow the one before within ``CROWDED`` of the usual interval."""
    steps = np.diff(t)
    return np.concatenate([[True], steps > CROWDED * np.median(steps)])


def jitter(channel: str, t: np.ndarray) -> tuple[str, ...]:
    """Return a warning of the stamps' jitter, or else of samples that are missing, where there is much of it."""
    steps = np.diff(t)
    interval = float(np.median(steps))
    steps = steps[steps <= GAP * interval]
    periods = np.maximum(np.round(steps / interval), 1)
    if (steps - periods * interval).std() >= JITTER_WARNING * interval:
        spread, mean = 1e3 * steps.std(), 1e3 * steps.mean()
        return (f"the stamps of the {channel} jitter by {spread:.3g} ms at an interval of {mean:.3g} ms",)
    missing = 1 - len(steps) / float(periods.sum())
    if missing >= MISSING_WARNING:
        return (f"{missing:.0%} of the samples of the {channel} are missing, interpolated: check the connection",)
    return ()


def gaps(channel: str, t: np.ndarray) -> tuple[str, ...]:
    """Return a warning of a channel's gaps, if it has any."""
    steps = np.diff(t)
    wide = steps > GAP * np.median(steps)
    if not wide.any():
        return ()
    return (
        f"{counted(int(wide.sum()), 'gap')} in the {channel}, the longest {steps.max():.3g} s at "
        f"{t[np.argmax(steps)]:.6g} s, left out",
    )


def interpolate(t: np.ndarray, values: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return the cubic spline through samples (n, k) at other instants."""
    return scipy.interpolate.make_interp_spline(t, values, k=min(3, len(t) - 1))(at)
