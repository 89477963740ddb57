"""How large the mean square of a signal can be that repeats: exact, by the corners of a polytope.

A signal of band B that repeats within less than ``(K+1)/B`` is a sum of at most K harmonics. Of two periods with K
harmonics the longer makes the same amplitudes' integral larger; so the shortest, ``K/B``, allows most: there the K-th
harmonic is the band's edge. Bounds of signal and integral at some instants of the period make a polytope of amplitudes,
and it holds all those that keep within the bounds at every instant. The mean square is convex, so largest at one of its
corners. The sine of the fundamental may be taken as zero: time can be counted from elsewhere.
"""

from functools import cache

import numpy as np
from jaxtyping import Float
from scipy.spatial import HalfspaceIntersection

INSTANTS = (64, 64, 32, 12)
"""Of the polytope, in a period of the highest harmonic, for one to four of them: the corners multiply."""


@cache
def repeating_mean_square(ratio: float, harmonics: int) -> float:
    """Return what the mean square of a signal that repeats cannot exceed, for a modulus of at most one.

    Args:
        ratio: largest modulus of the signal's integral over what a bound of one and the band's edge give, ``2πB v / a``
            for ``|x| ≤ a`` and ``|∫x| ≤ v``; at least one.
        harmonics: K, so that the signal repeats within less than (K + 1)/B; 1 to 4.
    """
    return max(_largest(ratio, number) for number in range(1, harmonics + 1))


def _largest(ratio: float, harmonics: int) -> float:
    """Return the largest mean square of so many harmonics, the last of which is the band's edge."""
    number, instants = np.arange(1, harmonics + 1), INSTANTS[harmonics - 1] * harmonics
    angle = 2 * np.pi * np.arange(instants)[:, None] / instants * number
    signal = np.hstack([np.cos(angle), np.sin(angle[:, 1:])])
    integral = np.hstack([np.sin(angle) / number, -np.cos(angle[:, 1:]) / number[1:]]) * harmonics / ratio
    if harmonics == 1:
        return float(1 / max(np.abs(signal).max(), np.abs(integral).max()) ** 2 / 2)
    faces = np.concatenate([signal, -signal, integral, -integral])
    corners = HalfspaceIntersection(np.hstack([faces, -np.ones((len(faces), 1))]), np.zeros(faces.shape[1]))
    return float((corners.intersections**2).sum(axis=1).max() / 2)


def ramp_mean_square(window: Float[np.ndarray, "3 n"], speed: float, stroke: float) -> float:
    """Return what the mean square in a ramp cannot exceed, for a modulus of at most one.

    A position q whose rate, acceleration and modulus are bounded, times a window w, has the acceleration
    ``w q'' + 2 w' q' + w'' q``; its modulus is at most the sum of what each term may be, and at most one.

    Args:
        window: w with two derivatives at uniform instants of the ramp.
        speed: largest modulus of q' for ``|q''| ≤ 1`` [s].
        stroke: largest modulus of q, alike [s²].
    """
    most = np.array([1.0, 2 * speed, stroke]) @ np.abs(window)
    return float((np.minimum(most, 1.0) ** 2).mean())
