"""Something vibrates above the motion's band: a mounting that rings, or a machine beside it.

## What it looks like

A peak in the spectrum of force or moment, or a line in the residual moment, above the highest frequency of the motion.

## Why it matters

A mounting with a resonance at f0 makes moments of a motion at f too large by (f/f0)². So does a tensor that is
estimated from them. The result adds this much to its covariance, interval and budget, if the peak is one of the
moment.

## How it is decided

A peak must stand ten times above the level around it and hold half of what lies above the motion's band; a resonance
of damping ζ at f is 2 ζ f wide, so broad peaks count, too. A line must stand against coloured noise by its
surroundings, with one false line in 100,000 clean runs. Lines are looked for with methods `source` and `gls`.

## What to do

Stiffen or damp what vibrates. Mains hum and motors at a fixed frequency: find what vibrates there, and switch it off.
"""

from dataclasses import replace
from typing import NamedTuple

import numpy as np
import scipy
from jaxtyping import Float

from identify.display.rounding import significant
from identify.judge.findings import Finding
from identify.least_squares.run_lines import FORCE, MOMENT, MOTION, OMEGA_R_OF_ACTING, rows_of
from identify.results.declaration import ResidualCause
from identify.results.identification_result import Identification
from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE
from identify.signals.power_spectrum import welch
from identify.signals.run import Run

SEGMENT = 2.0
"""Length of the segments whose spectra are averaged [s].

Choice: lines 0.5 Hz apart, fine enough for a mounting of 20 Hz whose damping is 0.03.
"""
FEWEST = 8
"""Segments below which nothing is judged.

Chance: the mean of eight scatters by a third.
"""
ABOVE = 1.5
"""Lowest frequency over the motion's band at which a line or a peak is looked for.

Choice: below, a peak may be the motion's own, or a cause that follows it.
"""
BESIDE = (1.25, 1.8)
"""Ratios of frequencies between which, above and below a peak, its surroundings' level is taken.

Choice: beyond a resonance's own width, within its octave.
"""
STANDS_OUT = 10.0
"""Peak over the level around it from which it is one.

Chance: of eight averaged segments, exceeded by a line of noise in 1e-14.
"""
MOST = 0.5
"""Part of what lies above the motion's band that the peak must hold.

Measured: no peak stands out at all in 40 clean runs, and hum is all of what lies there
(``tests.helpers.judge_margins``).
"""


class Vibration(Finding):
    """A peak of force or moment above the motion's band."""

    quantity: str
    axis: str
    frequency: float
    """Frequency of the peak [Hz]."""
    size: str
    """Root mean square of the peak, with its unit."""

    @property
    def looks(self) -> str:
        frequency = significant(self.frequency)
        return f"the {self.quantity} on {self.axis} vibrates at about {frequency} Hz, {self.size} rms"

    cure = "stiffen or damp what vibrates"


class ResidualHum(Finding):
    """A line in the residual moment above the motion's band."""

    axis: str
    frequency: float
    """Frequency of the line [Hz]."""
    rms: float
    """Root mean square of the line [N·m]."""

    @property
    def looks(self) -> str:
        frequency, size = significant(self.frequency), significant(self.rms, 2)
        return f"a line at {frequency} Hz in the residual moment about {self.axis}, {size} N·m rms"

    cure = "find what vibrates at this frequency"


EXAMPLES = (
    Vibration(topic="run.mcap", quantity="moment", axis="b2", frequency=24.5, size="0.012 N·m"),
    ResidualHum(topic="run.mcap", axis="b1", frequency=50.0, rms=0.0031),
)


class ResonancePeak(NamedTuple):
    """The peak that holds most of what lies above the motion's band."""

    quantity: str
    axis: int
    frequency: float
    """Frequency of the peak [Hz]."""
    share: float
    """Part of what lies above the motion's band."""
    rms: float
    """Root mean square of the peak [N], [N·m]."""

    def added_to_tensor(
        self, omega: Float[np.ndarray, "n 3"], alpha: Float[np.ndarray, "n 3"], inertia: Float[np.ndarray, "6"]
    ) -> Float[np.ndarray, "6"]:
        """Return the tensor's part by which moments on a mounting that resonates at f0 are too large, ``(f/f0)²``.

        Zero for a force's peak.
        """
        squared = float((alpha**2).sum() / (omega**2).sum()) / (2 * np.pi) ** 2
        return inertia * squared / self.frequency**2 * (self.quantity == "moment")

    def verdict(self, run: Run, added: Float[np.ndarray, "6"]) -> ResidualCause:
        """Return the peak as a cause, with what a mounting that resonates adds to the tensor [kg·m²]."""
        unit, worst = "N" if self.quantity == "force" else "N·m", int(np.argmax(np.abs(added)))
        change = f"{significant(GRAM_METRE * added[worst], 2)} g·m² to {COMPONENTS[worst]}"
        axis, size = f"b{self.axis + 1}", f"{significant(self.rms, 2)} {unit}"
        peak = Vibration(topic=run.name, quantity=self.quantity, axis=axis, frequency=self.frequency, size=size)
        adds = f"; if the mounting does, it adds {change}" if added.any() else ""
        return peak.verdict(axis=axis, share=self.share, adds=adds)


def resonance(run: Run, band: float) -> ResonancePeak | None:
    """Return the peak of force or moment above the motion's band that stands out most; None where none does.

    Args:
        run: the run.
        band: highest frequency of the motion [Hz].
    """
    longest = run.longest_segment
    size = round(SEGMENT * run.rate)
    if longest.stop - longest.start < (FEWEST + 1) * size / 2:
        return None
    peaks = []
    for quantity in ("force", "moment"):
        frequency, spectrum = welch(getattr(run, quantity)[longest], run.rate, size)
        peaks += [
            ResonancePeak(quantity, axis, *_peak(frequency, density, ABOVE * band))
            for axis, density in enumerate(spectrum.T)
        ]
    best = max(peaks, key=lambda peak: peak.share)
    return best if best.share > MOST else None


def _peak(frequency: Float[np.ndarray, " n"], density: np.ndarray, lowest: float) -> tuple[float, float, float]:
    """Frequency of the peak that holds most, its part of what lies above the lowest frequency, and its rms."""
    step, open_to = frequency[1], (frequency > lowest) & (frequency < 0.9 * frequency[-1])
    if not open_to.any():
        return 0.0, 0.0, 0.0
    rises = np.diff(density, prepend=np.inf) > 0  # else the slope of the motion's own spectrum
    at = int(np.argmax(np.where(open_to & rises, density, 0.0)))
    level = max(_level(frequency, density, at, lowest, below) for below in (True, False))
    if not density[at] > STANDS_OUT * level:  # nor where nothing was measured
        return 0.0, 0.0, 0.0
    inside = (frequency > frequency[at] / BESIDE[0]) & (frequency < frequency[at] * BESIDE[0])
    power = float(np.maximum(density[inside] - level, 0.0).sum() * step)
    return float(frequency[at]), power / float(density[open_to].sum() * step), float(np.sqrt(power))


def _level(frequency: np.ndarray, density: np.ndarray, at: int, lowest: float, below: bool) -> float:
    """Level on one side of a peak: the median there; none where the spectrum does not reach so far."""
    near, far = (frequency[at] * factor ** (-1 if below else 1) for factor in BESIDE)
    side = (frequency > max(min(near, far), lowest)) & (frequency < max(near, far))
    return float(np.median(density[side])) if side.any() else 0.0


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
    strongest = line(residuals, run.rate, above=ABOVE * run.band) if len(residuals) >= SHORTEST else None
    if strongest is None or strongest.share < LEAST:
        return []
    axis = f"b{strongest.axis + 1}"
    hum = ResidualHum(topic=run.name, axis=axis, frequency=strongest.frequency, rms=strongest.rms)
    return [hum.verdict(axis=axis, share=strongest.share)]


def _residual_moment(run: Run, result: Identification) -> Float[np.ndarray, "n 3"]:
    """Residual moment about the centre of gravity, without the estimator's low-pass [N·m]."""
    rows = rows_of(run, replace(result.estimator, lowpass=None))
    moment = rows.signals[MOMENT].T - np.cross(result.r_cg, rows.signals[FORCE].T)
    return moment - rows.signals[MOTION].T @ (OMEGA_R_OF_ACTING @ result.inertia)


def line(signal: Float[np.ndarray, "n k"], rate: float, *, above: float = 0.0) -> SpectralLine | None:
    """Return the line that stands out most from the spectrum around it; None where none does.

    Args:
        signal: samples first.
        rate: sample rate [Hz].
        above: lowest frequency to look at [Hz].
    """
    n = scipy.fft.prev_fast_len(len(signal), real=True)
    signal, window = signal[:n], np.hanning(n)
    lines = scipy.fft.rfft((signal - signal.mean(axis=0)) * window[:, None], axis=0)
    spectrum, frequency = lines.real**2 + lines.imag**2, np.arange(n // 2 + 1) * rate / n
    width = max(len(frequency) // AROUND, 11) | 1
    level = _median_level(spectrum, width)
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


def _median_level(spectrum: np.ndarray, width: int) -> np.ndarray:
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
