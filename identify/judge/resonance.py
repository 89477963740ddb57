"""A peak of force or moment above the motion's band: a mounting that rings, a machine beside it.

Broad ones, too: a resonance of damping ζ at f is 2 ζ f wide.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from identify.judge.findings import Finding
from identify.results.residual_cause import ResidualCause
from identify.rounding import significant
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

    def verdict(self, run: Run, adds: str = "") -> ResidualCause:
        """Return the peak as a cause, with what it adds to the tensor."""
        unit = "N" if self.quantity == "force" else "N·m"
        return Finding.RESONANCE.cause(
            run.name, axis=f"b{self.axis + 1}", share=self.share, adds=adds, quantity=self.quantity,
            frequency=significant(self.frequency), size=f"{significant(self.rms, 2)} {unit}",
        )  # fmt: skip


def resonance(run: Run, band: float) -> ResonancePeak | None:
    """Return the peak of force or moment above the motion's band that stands out most; None where none does.

    Args:
        run: the run.
        band: highest frequency of the motion [Hz].
    """
    longest = max(run.used(), key=lambda segment: segment.stop - segment.start, default=slice(0, 0))
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
    at = int(np.argmax(np.where(open_to, density, 0.0)))
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
