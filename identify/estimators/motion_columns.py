"""Moments that follow the motion though no rigid body on a rigid platform makes them, as columns of a regression.

A mounting that flexes makes the moment ``M`` grow with ``f²``, axis by axis (the IMU on the platform); a cable adds
its stiffness times the angle turned; cross-talk between the load cell's channels adds ``G F`` and ``H M``, of which the
antisymmetric part of ``G`` is an error of r_CG, and the symmetric part of ``H`` a tensor's.
"""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from identify.signals.power_spectrum import without_line

CLEAR = 30.0
"""Power of a line's fitted moment over that of the gyro's noise in it, from which it counts as the motion's."""
SLOW = 0.01
"""Part of the moment's power in the slowest lines, where the angle is little but drift of the integral."""
SYMMETRIC = np.array([[[1, 0, 0], [0, 0, 0], [0, 0, 0]], [[0, 0, 0], [0, 1, 0], [0, 0, 0]],
                      [[0, 0, 0], [0, 0, 0], [0, 0, 1]], [[0, 1, 0], [1, 0, 0], [0, 0, 0]],
                      [[0, 0, 1], [0, 0, 0], [1, 0, 0]], [[0, 0, 0], [0, 0, 1], [0, 1, 0]]])  # fmt: skip
ANTISYMMETRIC = np.array([[[0, 1, 0], [-1, 0, 0], [0, 0, 0]], [[0, 0, 1], [0, 0, 0], [-1, 0, 0]],
                          [[0, 0, 0], [0, 0, 1], [0, -1, 0]]])  # fmt: skip


def motion_columns(
    moment: Float[np.ndarray, "k 3"],
    force: Float[np.ndarray, "k 3"],
    angle: Float[np.ndarray, "k 3"],
    frequency: Float[np.ndarray, " k"],
    noise: Float[np.ndarray, "k 3"],
) -> Float[np.ndarray, "k 3 15"]:
    """Return fifteen columns: ``f² M`` and the angle by axis, a symmetric ``G F``, an antisymmetric ``H M``.

    Args:
        moment: fitted, of lines of the cosine transform [N·m].
        force: measured [N].
        angle: that the body has turned by; see :func:`angle_turned` [rad].
        frequency: of the lines [Hz].
        noise: power of the gyro's noise in ``moment`` [(N·m)²]; ``f²`` would bring out a line that holds little else.
    """
    grown = np.where(moment**2 > CLEAR * noise, moment, 0.0) * frequency[:, None] ** 2
    power = np.cumsum((moment**2).sum(axis=1))
    turned = np.where(power[:, None] > SLOW * power[-1], angle, 0.0)
    by_axis = [signal[:, :, None] * np.eye(3) for signal in (grown, turned)]
    across = [np.einsum("nab,kb->kan", maps, signal) for maps, signal in ((SYMMETRIC, force), (ANTISYMMETRIC, moment))]
    return np.concatenate([*by_axis, *across], axis=2)


def angle_turned(omega: Float[np.ndarray, "n 3"], segments: Sequence[slice], rate: float) -> Float[np.ndarray, "n 3"]:
    """Return the integral of the angular velocity over each segment without a gap, less its straight line [rad].

    The straight line holds the gyro's bias. Good for angles of a few tenths of a radian.
    """
    angle = np.zeros_like(omega)
    for segment in segments:
        angle[segment] = without_line(np.cumsum(omega[segment], axis=0).T / rate).T
    return angle
