"""Scale factor of a signal: each channel reads too much or too little in proportion."""

from jaxtyping import Array, Float

from uq.sources.constant_errors import of_channels
from uq.sources.source import SIGNAL_UNITS, ErrorKind, Source


class Scale(ErrorKind):
    """Multiplies each channel by 1 + θ."""

    name = "scale"
    targets = dict.fromkeys(SIGNAL_UNITS, "%")
    constant = True
    perturbs = {"F": "cell_scale", "M": "cell_scale", "omega": "gyro_scale"}

    def value(self, source: Source, draw: Float[Array, "3"]) -> Float[Array, "..."]:
        """Return the relative errors of the load cell's six scale factors, or of the gyro's three."""
        return of_channels(source.target, draw)
