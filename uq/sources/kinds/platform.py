"""Deviations of the rig from what is believed of it: gravity, the attitude, the point that keeps still.

These change the true wrench, which the load cell measures; alone they leave the estimate as it is.
"""

from uq.sources.source import RigConstant


class Gravity(RigConstant):
    """True minus stated gravity [m/s²]."""

    targets = {"gravity": "m/s^2"}
    absence = "gravity is as stated"
    shape = ()


class StillPoint(RigConstant):
    """True minus believed centre of gravity from the platform's centre, in B [m]: another point keeps still."""

    targets = {"r_cg_from_omb": "m"}
    absence = "the point that keeps still is as stated"


class Tilt(RigConstant):
    """Rotation vector in A that takes the level attitude to the true one at the start [rad]."""

    targets = {"tilt": "rad"}
    absence = "the platform starts level"
