"""Bias of a signal: one constant an experiment."""

from uq.sources.source import SIGNAL_UNITS, ErrorKind


class Bias(ErrorKind):
    """Adds θ to the signal."""

    name = "bias"
    targets = SIGNAL_UNITS
    absence = "the offsets of {} are zero"
    perturbs = {"F": "cell_bias", "M": "cell_bias", "omega": "gyro_bias"}
