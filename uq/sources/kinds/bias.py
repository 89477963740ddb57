"""Bias of a signal: one constant an experiment."""

import numpy as np
from jaxtyping import Array, Float

from uq.sources.constant_errors import of_channels
from uq.sources.source import SIGNAL_UNITS, ErrorKind, Source


class Bias(ErrorKind):
    """Adds θ to the signal."""

    name = "bias"
    targets = SIGNAL_UNITS
    constant = True
    perturbs = {"F": "cell_bias", "M": "cell_bias", "omega": "gyro_bias"}

    def value(self, source: Source, draw: Float[Array, "3"]) -> Float[Array, "..."]:
        """Return the load cell's six biases, or the gyro's three."""
        return of_channels(source.target, draw)

    def added_variance(self, source: Source) -> np.ndarray:
        """Return its variance."""
        return np.square(np.broadcast_to(np.asarray(source.standard_deviation, float), (3,)))
