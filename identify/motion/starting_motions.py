"""Motions of one period from which a search for the best one starts."""

import numpy as np
from jaxtyping import Float

from identify.motion.periodic_motion import Periodic

SIZE = 0.5
"""Root-mean-square acceleration of a leg with which a search starts, of its limit."""
PLACE = 0.6
"""Frequency of the spiral, of the highest one."""


def start(
    periodic: Periodic, r_cg_from_omb: Float[np.ndarray, "3"], generator: np.random.Generator, number: int
) -> Float[np.ndarray, " u"]:
    """Return the unknowns of a start: random, but the second is a spiral that keeps the centre of gravity still.

    Args:
        periodic: the harmonics.
        r_cg_from_omb: centre of gravity from the platform's centre, in B [m].
        generator: of the random ones.
        number: which start, from 0.
    """
    if number == 1 and len(periodic.frequency) >= 3:
        return spiral(periodic, r_cg_from_omb)
    return SIZE / np.sqrt(len(periodic.frequency)) * generator.normal(size=periodic.unknowns)


def spiral(periodic: Periodic, r_cg_from_omb: Float[np.ndarray, "3"]) -> Float[np.ndarray, " u"]:
    """Return the unknowns of ``alpha = (sin Ωt cos εt, cos Ωt, sin Ωt sin εt)``, the centre of gravity still.

    The paper's T1 in small angles, with ε of one turn a period; each harmonic of the period has its own place.
    """
    count = len(periodic.frequency)
    middle = min(max(round(PLACE * count), 2), count - 1) - 1
    alpha = np.zeros((2, 3, count))  # of cosines and sines
    alpha[1, 0, [middle - 1, middle + 1]] = 0.5
    alpha[0, 1, middle] = 1.0
    alpha[0, 2, middle - 1], alpha[0, 2, middle + 1] = 0.5, -0.5
    turn = -alpha / (2 * np.pi * periodic.frequency) ** 2
    shift = -np.cross(turn, r_cg_from_omb, axisa=1, axisc=1)
    unknowns = periodic.unknowns_of(np.concatenate([shift, turn], axis=1))
    return SIZE * unknowns / np.sqrt((unknowns**2).sum() / 12)
