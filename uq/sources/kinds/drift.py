"""Drift of a signal: a slope from the start of the run."""

from jaxtyping import Array, Float

from uq.sources.constant_errors import of_channels
from uq.sources.source import SIGNAL_UNITS, ErrorKind, Source


class Drift(ErrorKind):
    """Adds θ t to the signal."""

    name = "drift"
    targets = {target: f"{unit}/s" for target, unit in SIGNAL_UNITS.items()}
    constant = True
    perturbs = {"F": "cell_drift", "M": "cell_drift", "omega": "gyro_drift"}

    def value(self, source: Source, draw: Float[Array, "3"]) -> Float[Array, "..."]:
        """Return the load cell's six slopes, or the gyro's three."""
        return of_channels(source.target, draw)
