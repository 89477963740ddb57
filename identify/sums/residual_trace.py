"""Data for figures of a run's fit: residuals in time and frequency, and the motion, all thinned."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from identify.signals.power_spectrum import welch

BINS = 300
"""Most segments of time, and most frequencies."""
POINTS = 1500
"""Most samples of the motion."""
SEGMENTS = 8
"""Segments over which a spectrum is averaged, at least."""
LONGEST = 4096
"""Most samples in a segment of a spectrum."""


@dataclass(frozen=True, eq=False)
class Trace:
    """A run's residual moment ``M - r × F - Ω I``, less the offsets that were removed, and the motion behind it."""

    t: Float[np.ndarray, " m"]
    """Middle of each interval of time in which residuals are summarised [s]."""
    low: Float[np.ndarray, "m 3"]
    """Least residual in it, on each axis [N·m]."""
    high: Float[np.ndarray, "m 3"]
    """Largest residual in it [N·m]."""
    frequency: Float[np.ndarray, " k"]
    """Frequencies of the spectra [Hz]."""
    residual_density: Float[np.ndarray, "k 3"]
    """Amplitude density of the residuals on each axis [N·m/Hz^½]."""
    moment_density: Float[np.ndarray, " k"]
    """Amplitude density of the moment about the centre of gravity, root mean square of the axes [N·m/Hz^½]."""
    omega: Float[np.ndarray, "p 3"]
    """Angular velocity in B [rad/s]."""
    alpha: Float[np.ndarray, "p 3"]
    """Angular acceleration in B [rad/s²], at the same instants."""


def trace(
    t: Float[np.ndarray, " n"],
    residuals: Float[np.ndarray, "n 3"],
    moment: Float[np.ndarray, "n 3"],
    motion: Float[np.ndarray, "p 6"],
) -> Trace:
    """Thin a run's fit for drawing.

    The spectra (Welch) are those of the longest segment without a gap, averaged over bands of equal ratio.

    Args:
        t: instants of the rows [s], with gaps where samples were left out.
        residuals: measured less fitted moment about the centre of gravity [N·m].
        moment: the measured moment about the centre of gravity, less the offset that was removed [N·m].
        motion: angular velocity [rad/s] and acceleration [rad/s²], :func:`thinned`.
    """
    edges = _edges(len(t), BINS)
    low, high = (reach.reduceat(residuals, edges, axis=0) for reach in (np.minimum, np.maximum))
    step = float(np.median(np.diff(t)))
    segment = _longest(t, step)
    frequency, densities = _density(residuals[segment], 1 / step)
    _, moment_densities = _density(moment[segment], 1 / step)
    middle = (t[edges] + t[np.append(edges[1:], len(t)) - 1]) / 2
    moment_density = np.sqrt(np.mean(moment_densities**2, axis=1))
    return Trace(
        t=middle, low=low, high=high, frequency=frequency, residual_density=densities, moment_density=moment_density,
        omega=motion[:, :3], alpha=motion[:, 3:],
    )  # fmt: skip


def thinned(signals: Float[np.ndarray, "n k"]) -> Float[np.ndarray, "p k"]:
    """Return every so many samples, ``POINTS`` at most, of which nothing else is kept."""
    return signals[:: -(-len(signals) // POINTS)].copy()


def _edges(count: int, most: int) -> np.ndarray:
    """Return the start of each of at most so many segments of equal length."""
    return np.unique(np.linspace(0, count, min(count, most) + 1).astype(int)[:-1])


def _longest(t: np.ndarray, step: float) -> slice:
    """The longest segment without a gap."""
    cuts = np.concatenate([[0], np.flatnonzero(np.diff(t) > 1.5 * step) + 1, [len(t)]])
    longest = int(np.argmax(np.diff(cuts)))
    return slice(int(cuts[longest]), int(cuts[longest + 1]))


def _density(signal: np.ndarray, rate: float) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies and amplitude density, thinned to bands of equal ratio."""
    length = min(len(signal), LONGEST, max(len(signal) // SEGMENTS, 64))
    frequency, power = welch(signal, rate, length)
    frequency, power = frequency[1:], power[1:]
    if not len(frequency):
        return frequency, np.sqrt(power)
    band = np.unique(np.searchsorted(frequency, np.geomspace(frequency[0], frequency[-1], BINS) * (1 - 1e-9)))
    counts = np.diff(np.append(band, len(frequency)))
    means = [np.add.reduceat(values, band, axis=0) for values in (frequency, power)]
    return means[0] / counts, np.sqrt(means[1] / counts[:, None])
