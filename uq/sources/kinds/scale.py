"""Scale factor of a signal: each channel reads too much or too little in proportion."""

from uq.sources.source import SIGNAL_UNITS, ErrorKind


class Scale(ErrorKind):
    """Multiplies each channel by 1 + θ."""

    name = "scale"
    targets = dict.fromkeys(SIGNAL_UNITS, "%")
    absence = "the scale factors of {} are exact"
    perturbs = {"F": "cell_scale", "M": "cell_scale", "omega": "gyro_scale"}
