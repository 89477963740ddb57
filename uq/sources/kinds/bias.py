"""Bias of a signal: one constant an experiment."""

import numpy as np

from uq.sources.source import SIGNAL_UNITS, ErrorKind, Source


class Bias(ErrorKind):
    """Adds θ to the signal."""

    name = "bias"
    targets = SIGNAL_UNITS
    absence = "the offsets of {} are zero"
    constant = True
    perturbs = {"F": "cell_bias", "M": "cell_bias", "omega": "gyro_bias"}

    def added_variance(self, source: Source) -> np.ndarray:
        """Return its variance."""
        return source.variance
