"""A line in a spectrum (a resonance, mains hum, an imbalance), against coloured noise by its surroundings."""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from identify.judge.findings import Finding
from identify.judge.resonance import ABOVE
from identify.results.identification_result import Identification
from identify.results.residual_cause import ResidualCause
from identify.rigid_body.regressor import OMEGA_R_OF_FEATURES
from identify.rounding import significant
from identify.signals.run import Run
from identify.sums.run_lines import rows_of

CHANCE = 1e-5
"""Chance of a false line in pure noise, over all frequencies and axes.

Chance: stated as such; one clean run in 100,000.
"""
AROUND = 40
"""Length of the spectrum over that of the median which is its level.

Choice: one in 40, far wider than a line and narrower than a slope of coloured noise.
"""
LEAST = 1e-3
"""Smallest part of the residuals' variance that is reported.

Price: residuals 0.05 % larger.
"""
SHORTEST = 32
"""Samples below which nothing is judged.

Choice: the level needs 11 frequencies on each side.
"""


class SpectralLine(NamedTuple):
    """The strongest line of a signal."""

    frequency: float
    """Frequency of the line [Hz]."""
    axis: int
    rms: float
    """Root mean square of the line, in the signal's unit."""
    share: float
    """Part of the signal's variance, all axes together."""


def lines_of(run: Run, result: Identification) -> list[ResidualCause]:
    """Return the line in a run's residual moment above the motion's band, if there is one.

    Args:
        run: the run.
        result: of an estimator by rows of Omega_R, whose low-pass is left out here.
    """
    residuals = _residual_moment(run, result)
    resonance = line(residuals, run.rate, above=ABOVE * run.band) if len(residuals) >= SHORTEST else None
    if resonance is None or resonance.share < LEAST:
        return []
    verdict = Finding.SPECTRAL_LINE.cause(
        run.name, axis=f"b{resonance.axis + 1}", share=resonance.share, frequency=significant(resonance.frequency),
        size=f"{significant(resonance.rms, 2)} N·m",
    )  # fmt: skip
    return [verdict]


def _residual_moment(run: Run, result: Identification) -> Float[np.ndarray, "n 3"]:
    """Residual moment about the centre of gravity, without the estimator's low-pass [N·m]."""
    rows = rows_of(run, replace(result.estimator, lowpass=None))
    moment = rows.moment.T - np.cross(result.r_cg, rows.force.T)
    return moment - rows.phi.T @ (OMEGA_R_OF_FEATURES @ result.inertia)


def line(signal: Float[np.ndarray, "n k"], rate: float, *, above: float = 0.0) -> SpectralLine | None:
    """Return the line that stands out most from the spectrum around it; None where none does.

    Args:
        signal: samples first.
        rate: sample rate [Hz].
        above: lowest frequency to look at [Hz].
    """
    n = len(signal)
    window = np.hanning(n)
    spectrum = np.abs(np.fft.rfft((signal - signal.mean(axis=0)) * window[:, None], axis=0)) ** 2
    frequency = np.fft.rfftfreq(n, 1 / rate)
    width = max(len(frequency) // AROUND, 11) | 1
    level = _level(spectrum, width)
    usable = (frequency > max(above, 4 * rate / n)) & (frequency < 0.95 * rate / 2)
    if usable.sum() < 2 * width:
        return None
    ratio = np.where(usable[:, None], spectrum / np.maximum(level, 1e-300 + 1e-12 * spectrum.max()), 0.0)
    peak, axis = np.unravel_index(np.argmax(ratio), ratio.shape)
    if ratio[peak, axis] < np.log(ratio.size / CHANCE) * SAFETY:
        return None
    power = _power(spectrum[:, axis], level[:, axis], int(peak)) / (n * (window**2).sum()) * 2
    variance = float(signal.var(axis=0).sum())
    return SpectralLine(
        float(frequency[peak]), int(axis), float(np.sqrt(power)), float(min(power / max(variance, 1e-300), 1.0))
    )


STEPS = 8
"""Medians of the spectrum per width of the level.

Numerical: between them they are interpolated.
"""
SAFETY = 1.5
"""Factor on the ratio that chance allows, as the level is itself an estimate, over few frequencies where the run is
short.

Choice: a median of 11 frequencies is low by 45 % in one of ten, and the largest of two medians counts.
"""


def _level(spectrum: np.ndarray, width: int) -> np.ndarray:
    """Level of the spectrum around each bin: its median on the side where that is higher, a slope being no line.

    The medians of neighbouring bins are hardly apart: they are taken every few bins, and interpolated between.
    """
    count, step = len(spectrum), max(width // STEPS, 1)
    padded = np.pad(spectrum, ((width, width), (0, 0)), mode="reflect" if count > width else "edge")
    windows = np.lib.stride_tricks.sliding_window_view(padded, width, axis=0)[::step]
    medians, starts = np.median(windows, axis=-1), np.arange(0, len(padded) - width + 1, step)
    bins = np.arange(count) + width
    before, after = (
        np.stack([np.interp(bins + shift, starts, column) for column in medians.T], axis=1) for shift in (1 - width, 0)
    )
    return np.asarray(np.maximum(before, after) / np.log(2))


def _power(spectrum: np.ndarray, level: np.ndarray, peak: int) -> float:
    """Power above the level about the peak, over the bins that exceed three times the level."""
    out = spectrum > 3 * level
    first = last = peak
    while first > 0 and out[first - 1]:
        first -= 1
    while last + 1 < len(out) and out[last + 1]:
        last += 1
    return float(np.maximum(spectrum - level, 0)[first : last + 1].sum())
