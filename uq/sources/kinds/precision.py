"""Precision: white noise of a signal, fresh at each sample, of any distribution."""

import numpy as np

from uq.sources.noise_filters import WHITE, NoisePart
from uq.sources.source import SIGNAL_UNITS, ErrorKind, SignalRange, Source


class Precision(ErrorKind):
    """Adds ``sigma * shape``, independent from sample to sample; its axes may be correlated.

    Sums over samples tell it all: those with the load cell's noise are normal, given those with the gyro's. All sources
    of this kind are drawn together (:func:`uq.sources.draws.draw_pairs`).
    """

    name = "precision"
    targets = SIGNAL_UNITS
    absence = "there is no noise in {}"
    noise = True
    white = True
    averages_out = True

    def noise_parts(self, source: Source, rate: float) -> list[NoisePart]:
        """Return it as white noise."""
        return [NoisePart(WHITE, np.sqrt(source.variance))]

    def white_variance(self, source: Source, rate: float) -> np.ndarray:
        """Return its variance: a figure of each sample, whatever the rate."""
        return self.added_variance(source)

    def added_variance(self, source: Source) -> np.ndarray:
        """Return its variance."""
        return source.variance

    def beyond_the_law(self, source: Source, signal: SignalRange) -> str | None:
        """Return that the law takes the gyro's noise as independent from axis to axis."""
        correlated = source.of_gyro and signal.correlated
        return "is gyro noise with correlations" if correlated else None
