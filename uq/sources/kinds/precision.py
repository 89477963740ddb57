"""Precision: white noise of a signal, fresh at each sample, of any distribution."""

from typing import Any

import numpy as np

from uq.sources.noise_filters import WHITE, NoisePart
from uq.sources.source import SIGNAL_UNITS, ErrorKind, Source


class Precision(ErrorKind):
    """Adds ``sigma * shape``, independent from sample to sample; its axes may be correlated.

    Sums over samples tell it all: those with the load cell's noise are normal, given those with the gyro's. All sources
    of this kind are drawn together (:func:`uq.sources.draws.draw_pairs`).
    """

    name = "precision"
    targets = SIGNAL_UNITS
    absence = "there is no noise in {}"
    white = True

    def noise_parts(self, source: Source, rate: Any) -> list[NoisePart]:
        """Return it as white noise: a figure of each sample, whatever the rate."""
        return [NoisePart(WHITE, np.sqrt(source.variance))]
