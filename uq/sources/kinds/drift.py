"""Drift of a signal: a slope from the start of the run."""

from uq.sources.source import SIGNAL_UNITS, ErrorKind


class Drift(ErrorKind):
    """Adds θ t to the signal."""

    name = "drift"
    targets = {target: f"{unit}/s" for target, unit in SIGNAL_UNITS.items()}
    absence = "there is no drift in {}"
    perturbs = {"F": "cell_drift", "M": "cell_drift", "omega": "gyro_drift"}
