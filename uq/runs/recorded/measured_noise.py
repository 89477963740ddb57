"""Declared noise against the noise that the data show, channel by channel.

Type A takes what the residuals show, so a wrong figure does no harm there; but it says that the sensor is not the one
that its figures describe, or that something shakes the rig.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from identify.display.rounding import significant
from identify.signals.power_spectrum import welch
from identify.signals.run import Run
from uq.files.units import printed
from uq.sources.source import SIGNAL_UNITS, SIGNALS, Source

FAR = 2.0
"""Ratio of measured to declared noise, or the inverse, that is worth a word."""
SEGMENTS = 8
"""Segments that a spectrum is averaged over, at least."""
ABOVE = 3.0
"""The level is taken above the motion's band by this factor: products of the motion reach to twice it."""
BELOW = 0.35
"""Part of the Nyquist frequency below which the level is taken: the filter that brings rates together ends above it."""
MOST_SAMPLES = 2**18
"""Samples that tell the noise: its level within a hundredth."""
FEWEST = 16
"""Frequencies that must be left."""


def white_level(signal: Float[np.ndarray, "n 3"], rate: float, above: float) -> Float[np.ndarray, "3"] | None:
    """Return the standard deviation of white noise with the signal's median spectral level above a frequency.

    Args:
        signal: samples first.
        rate: sample rate [Hz].
        above: where the motion ends [Hz].

    Returns:
        One value per axis, in the signal's unit; None where too few frequencies are left.
    """
    size = max(len(signal) // SEGMENTS, 8)
    frequency, density = welch(signal, rate, size, window="blackmanharris", straight=True)
    usable = (frequency > above) & (frequency < BELOW * rate / 2)
    if usable.sum() < FEWEST:
        return None
    return np.sqrt(np.median(density[usable], axis=0) * rate / 2)


def declared_level(sources: Sequence[Source], target: str, rate: float) -> Float[np.ndarray, "3"] | None:
    """Return the standard deviation of the white noise that sources declare of a signal; None: none does."""
    here = [source for source in sources if source.signal == SIGNALS.index(target)]
    variances = [(source.noise, source.white_variance(rate)) for source in here]
    if not any(np.sum(variance) > 0 for noise, variance in variances if noise and variance is not None):
        return None
    return np.sqrt(np.sum([variance for _, variance in variances if variance is not None], axis=0))


def noise_warnings(run: Run, sources: Sequence[Source]) -> list[str]:
    """Return a line for each channel whose noise is far from what its sources declare."""
    longest = run.longest_segment
    segment = slice(longest.start, min(longest.stop, longest.start + MOST_SAMPLES))
    warnings = []
    cell, imu = run.sensor_rates or (run.rate, run.rate)
    channels = zip(SIGNALS, (run.force, run.moment, run.omega), (cell, cell, imu), strict=True)
    for target, signal, sensor_rate in channels:
        declared = declared_level(sources, target, sensor_rate)
        shown = None if declared is None else white_level(signal[segment], run.rate, ABOVE * run.band)
        if declared is None or shown is None or not shown.all():
            continue
        shown = shown * np.sqrt(sensor_rate / run.rate)  # the sensor's own samples, of the same spectrum
        ratio = shown / np.maximum(declared, 1e-300)
        far = np.flatnonzero((ratio > FAR) | (ratio < 1 / FAR))
        if len(far):
            warnings.append(_line(run, target, int(far[np.argmax(np.abs(np.log(ratio[far])))]), shown, declared))
    return warnings


def _line(run: Run, target: str, axis: int, shown: np.ndarray, declared: np.ndarray) -> str:
    unit = printed(SIGNAL_UNITS[target])
    return (
        f"{run.name}: {target} has noise of {significant(shown[axis], 2)} {unit} a sample on b{axis + 1}, "
        f"its sources declare {significant(declared[axis], 2)} {unit}: check the figure, or what vibrates the rig"
    )
