"""The command of a platform or an arm at uniform instants, which motion files hold."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from identify.motion.serial_arm.joint_series import JointStates


@dataclass(frozen=True)
class PlatformCommand:
    """The motion that a platform is commanded."""

    t: Float[np.ndarray, " n"]
    """Instants of the command [s]."""
    position: Float[np.ndarray, "n 3"]
    """Position of OMB from home, in A [m]."""
    rotation: Float[np.ndarray, "n 3 3"]
    """Attitude R_AB, from components in B to components in A."""
    length: Float[np.ndarray, "n 6"]
    """Lengths of the legs [m]."""
    legs: Callable[[np.ndarray, np.ndarray], np.ndarray]
    """Inverse kinematics: lengths of the legs from position and attitude."""

    def at_rate(self, rate: int) -> "PlatformCommand":
        """Return the command at a rate [Hz] that divides its own."""
        step = round(1 / (self.t[1] * rate))
        return replace(self, **{name: getattr(self, name)[::step] for name in ("t", "position", "rotation", "length")})


@dataclass(frozen=True)
class JointCommand:
    """The motion that an arm's joints are commanded."""

    names: Sequence[str]
    t: Float[np.ndarray, " n"]
    """Instants of the command [s]."""
    joints: JointStates
    turning: bool
    """Whether every joint turns."""
