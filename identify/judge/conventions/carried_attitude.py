"""The attitude that gyro and accelerometer tell together: the gyro carries axes along, gravity keeps them upright."""

import numpy as np
from jaxtyping import Float

from identify.rigid_body.rotation import cumulative_product, exponential
from identify.signals.filters import moving_average

RECALL = 20.0
"""Time over which the accelerometer tells gravity's direction along axes that the gyro keeps [s].

Choice: longer than periods of a motion, over which acceleration averages out.
"""


def carried_gravity(
    step: float, omega: Float[np.ndarray, "n 3"], specific: Float[np.ndarray, "n 3"]
) -> Float[np.ndarray, "n 3"]:
    """The opposite of gravity in the body frame [m/s²]: the specific force's usual size along its carried direction."""
    size = float(np.median(np.linalg.norm(specific, axis=1)))
    return size * carried_attitude(step, omega, specific)[:, 2]


def carried_by_gyro(step: float, omega: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3 3"]:
    """Rotations from B at each sample to B at the first, ``step`` apart [s]."""
    return cumulative_product(exponential(np.concatenate([np.zeros((1, 3)), step / 2 * (omega[1:] + omega[:-1])])))


def carried_attitude(
    step: float, omega: Float[np.ndarray, "n 3"], specific: Float[np.ndarray, "n 3"]
) -> Float[np.ndarray, "n 3 3"]:
    """Rotations from B to axes at rest whose z is up, the yaw by the gyro alone.

    The upward direction along the axes at the start is the specific force's mean over ``RECALL`` about each instant.
    """
    attitude = carried_by_gyro(step, omega)
    along_start = np.einsum("nij,nj->ni", attitude, specific)
    up = moving_average(along_start, 2 * round(RECALL / step / 2) + 1, ends="fewer")
    up /= np.maximum(np.linalg.norm(up, axis=1, keepdims=True), 1e-12)
    x = np.cross(np.eye(3)[int(np.argmin(np.abs(up.mean(axis=0))))], up)
    x /= np.maximum(np.linalg.norm(x, axis=1, keepdims=True), 1e-12)
    return np.stack([x, np.cross(up, x), up], axis=1) @ attitude
