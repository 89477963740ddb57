"""Roll, pitch and yaw of an attitude ``R_AB = Rz(yaw) Ry(pitch) Rx(roll)``, as platforms and their files state it."""

import numpy as np
import scipy
from jaxtyping import Float

ORDER = "ZYX"
"""Rotation order of the angles (yaw, pitch, roll), about turned axes."""


def roll_pitch_yaw(rotation: Float[np.ndarray, "n 3 3"]) -> Float[np.ndarray, "n 3"]:
    """Return the angles of attitudes R_AB [rad]."""
    return scipy.spatial.transform.Rotation.from_matrix(rotation).as_euler(ORDER)[:, ::-1]


def attitude_of(angles: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3 3"]:
    """Return the attitudes R_AB of roll, pitch and yaw [rad]."""
    return scipy.spatial.transform.Rotation.from_euler(ORDER, angles[:, ::-1]).as_matrix()
