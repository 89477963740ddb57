"""Deviations of the rig from what is believed of it: gravity, the attitude, the point that keeps still.

These change the true wrench, which the load cell measures; alone they leave the estimate as it is.
"""

from uq.sources.source import ErrorKind


class Gravity(ErrorKind):
    """True minus stated gravity [m/s²]."""

    name = "bias"
    targets = {"gravity": "m/s^2"}
    absence = "gravity is as stated"
    shape = ()
    constant = True
    perturbs = {"gravity": "gravity"}


class StillPoint(ErrorKind):
    """True minus believed centre of gravity from the platform's centre, in B [m]: another point keeps still."""

    name = "bias"
    targets = {"r_cg_from_omb": "m"}
    absence = "the point that keeps still is as stated"
    constant = True
    perturbs = {"r_cg_from_omb": "r_cg_from_omb"}


class Tilt(ErrorKind):
    """Rotation vector in A that takes the level attitude to the true one at the start [rad]."""

    name = "bias"
    targets = {"tilt": "rad"}
    absence = "the platform starts level"
    constant = True
    perturbs = {"tilt": "tilt"}
