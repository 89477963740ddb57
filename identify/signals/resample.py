"""Samples of two sensors at common, uniform instants: gaps, jitter, unequal rates, interpolation."""

import numpy as np
import scipy

from identify.exceptions import RunError
from identify.signals.filters import apply, lowpass

JITTER_TOLERANCE = 1e-3
"""Departure from uniform sampling, as a part of the sample interval, below which samples are taken as they are."""
JITTER_WARNING = 0.05
"""Standard deviation of the intervals, as a part of their mean, that is worth a warning."""
GAP = 5.0
"""Sample intervals without a sample that count as a gap."""
UNEQUAL = 1.2
"""Ratio of two rates beyond which the faster sensor would alias into the slower one's band."""


def is_uniform(t: np.ndarray) -> bool:
    """Whether instants are uniform, within ``JITTER_TOLERANCE``."""
    step = (t[-1] - t[0]) / (len(t) - 1)
    return bool(np.max(np.abs(t - t[0] - step * np.arange(len(t)))) < JITTER_TOLERANCE * step)


def interval(t: np.ndarray) -> float:
    """The mean interval between samples, gaps left out [s]."""
    steps = np.diff(t)
    return float(steps[steps <= GAP * np.median(steps)].mean())


def in_gap(t: np.ndarray, at: np.ndarray, reach: float) -> np.ndarray:
    """Which instants ``at`` lie inside a gap between the samples ``t``, or within ``reach`` of one [s]."""
    steps = np.diff(t)
    inside = np.zeros(len(at), bool)
    for k in np.flatnonzero(steps > GAP * np.median(steps)):
        inside |= (at >= t[k] - reach) & (at < t[k + 1] + reach)
    return inside


def beside(bad: np.ndarray, at: np.ndarray, reach: float) -> np.ndarray:
    """Which instants ``at`` lie within ``reach`` [s] of a bad one."""
    bad = np.sort(bad)
    first, last = np.searchsorted(bad, at - reach), np.searchsorted(bad, at + reach, side="right")
    return last > first


def below(
    nyquist: float, times: list[np.ndarray], columns: list[np.ndarray], intervals: list[float], name: str
) -> tuple[list[np.ndarray], list[np.ndarray], float]:
    """Both sensors' samples at uniform instants of their own, both without what lies above ``nyquist`` [Hz]."""
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


def jitter(channel: str, t: np.ndarray) -> tuple[str, ...]:
    """Return a warning of the stamps' jitter, where it is large."""
    steps = np.diff(t)
    steps = steps[steps <= GAP * np.median(steps)]
    spread, mean = float(steps.std()), float(steps.mean())
    if spread < JITTER_WARNING * mean:
        return ()
    return (f"the stamps of the {channel} jitter by {1e3 * spread:.3g} ms at an interval of {1e3 * mean:.3g} ms",)


def gaps(channel: str, t: np.ndarray) -> tuple[str, ...]:
    """Return a warning of a channel's gaps, if it has any."""
    steps = np.diff(t)
    wide = steps > GAP * np.median(steps)
    if not wide.any():
        return ()
    return (
        f"{int(wide.sum())} gaps in the {channel}, the longest {steps.max():.3g} s at {t[np.argmax(steps)]:.6g} s, "
        "left out",
    )


def interpolate(t: np.ndarray, values: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Return the cubic spline through samples (n, k) at other instants."""
    return scipy.interpolate.make_interp_spline(t, values, k=min(3, len(t) - 1))(at)
