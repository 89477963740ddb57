"""Running sums of a run while it is recorded, added block by block, of a size that never grows.

Three kinds of them. Products of features, force and moment give the normal equations. Products of the elements of
:mod:`uq.runs.identification.recorded_sums`, at several delays, give what declared errors do. Products of the cosine
transform of each block, summed over bands of frequency, give the residuals' spectrum of any fit, and with it the
standard uncertainty that they show (type A): the residuals are linear in the tensor, so no sample is looked at twice.
"""

from collections import Counter
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from identify.least_squares.residual_spectrum import Lines
from identify.least_squares.run_information import alpha_noise, noise_in_normal
from identify.least_squares.run_lines import unbroken, usable_rows
from identify.signals.estimator_spec import EstimatorSpec
from identify.signals.filters import moving_average
from identify.signals.segments import PART_OF_MOTION, SLOWEST
from uq.runs.identification.recorded_sums import ELEMENTS, FEATURES, FORCE, MOMENT, SIGNALS, delayed_signals
from uq.runs.live.growing_run import BLOCK, Block

REGRESSED = np.concatenate([FEATURES, np.arange(FORCE.start, MOMENT.stop)])
"""Features, force and moment among the signals."""
BANDS = 24
"""Bands of frequency, each twice as wide as the one below: the lines 0, 1, 2 and 3, 4 to 7, …"""
SHORTEST = 16
"""Samples without a gap whose spectrum is taken."""


class RunningSums:
    """Sums over the blocks so far.

    Attributes:
        products: of the signals with themselves, (27, 27); entry [0, 0] is the number of samples.
        delayed: for each delay, of the delayed elements with themselves and the signals, (d, 18, 45).
        spectra: for each band, of the cosine transforms of features, force and moment, (bands, 19, 19).
        lines: how many lines of the transform each band holds.
        gain: the sum of the filter's power gain at these.
        noise: what the gyro's noise adds to the normal equations, expected, (6, 6).
        seconds: of motion.
        left_out: samples that were left out, by reason.
        warnings: what the blocks' runs say of themselves.
    """

    def __init__(self, estimator: EstimatorSpec, delays: Sequence[float] | np.ndarray = (0.0,)) -> None:
        """Begin with nothing: for an estimator, with sums at these delays of the angular velocity [s]."""
        self.estimator, self.delays = estimator, np.asarray(delays, float)
        self.products = np.zeros((SIGNALS, SIGNALS))
        self.delayed = np.zeros((len(self.delays), ELEMENTS, ELEMENTS + SIGNALS))
        self.spectra = np.zeros((BANDS, len(REGRESSED), len(REGRESSED)))
        self.lines, self.gain = np.zeros(BANDS), np.zeros(BANDS)
        self.noise = np.zeros((6, 6))
        self.seconds = 0.0
        self.left_out, self.warnings = Counter[str](), Counter[str]()
        self._fastest = 0.0

    def add(self, block: Block) -> None:
        """Add a block, if the body moves in it; at rest it tells nothing of the tensor.

        Raises:
            RunError, ValueError: the block is too short for the estimator, or its rate too low for the band.
        """
        run, estimator = block.run, self.estimator
        t = run.t + 0.5 / run.rate  # so that rounding of an instant at a seam neither loses nor doubles it
        inside = (t >= block.begin) & (t < block.end)
        if not inside.any() or not self._moves(run.omega[inside], run.rate):
            return
        half, n = estimator.lost(run.rate) // 2, len(run.t) - estimator.lost(run.rate)
        keep = usable_rows(run, n)
        keep = keep[inside[half : half + n][keep]]
        self._count(block, inside)
        if not len(keep):
            return
        no_upward = np.zeros_like(run.force)  # for errors of the rig alone, which a live estimate leaves out
        for number, (elements, signals) in enumerate(
            delayed_signals(run, no_upward, keep, estimator, self.delays, begin=0.0)
        ):
            self.delayed[number] += elements @ signals.T
        rows = signals[ELEMENTS:]
        self.products += rows @ rows.T
        self._add_spectra(rows[REGRESSED].T, keep, run.rate)
        self.noise += len(keep) * noise_in_normal(alpha_noise(run, estimator))
        self.seconds += len(keep) / run.rate

    def _moves(self, omega: np.ndarray, rate: float) -> bool:
        """Whether the angular velocity, smoothed over 0.1 s, is above that of rest."""
        smooth = moving_average(omega, max(round(0.1 * rate), 1))
        speed = float(np.sqrt((smooth**2).sum(axis=1).mean()))
        self._fastest = max(self._fastest, speed)
        return speed > max(SLOWEST, PART_OF_MOTION * self._fastest)

    def _count(self, block: Block, inside: np.ndarray) -> None:
        if block.run.missing is not None and (lost := int(block.run.missing[inside].sum())):
            self.left_out["in gaps or beside bad samples"] += lost
        self.warnings.update(block.run.warnings)

    def _add_spectra(self, rows: Float[np.ndarray, "m 19"], keep: np.ndarray, rate: float) -> None:
        for segment in unbroken(keep):
            if segment.stop - segment.start < SHORTEST:
                continue
            lines = Lines.of([slice(0, segment.stop - segment.start)], rate)
            transformed = lines.transform(rows[segment])
            number = np.round(2 * BLOCK * lines.frequency).astype(int)  # of a whole block's line at this frequency
            band = np.minimum(np.ceil(np.log2(number + 1)).astype(int), BANDS - 1)
            edges = np.searchsorted(band, np.arange(BANDS + 1))
            passed = self.estimator.passed(rate, lines.frequency) ** 2
            for b in np.unique(band):
                part = transformed[edges[b] : edges[b + 1]]
                self.spectra[b] += part.T @ part
                self.lines[b] += len(part)
                self.gain[b] += passed[edges[b] : edges[b + 1]].sum()
