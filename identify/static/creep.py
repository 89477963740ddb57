"""Static poses in which the load cell drifts or creeps, whose mean is not the weight."""

from collections.abc import Sequence

import numpy as np
import scipy
from jaxtyping import Bool, Float

BLOCK = 0.2
"""Seconds whose mean counts as one independent reading."""
CHANCE = 1e-4
"""Chance of a false alarm, for each pose."""
BEYOND = 3.0
"""Change within a pose over the typical one above which the pose is left out."""


def changes(signal: Float[np.ndarray, "n k"], rate: float) -> tuple[Float[np.ndarray, " k"], Bool[np.ndarray, " k"]]:
    """Return how much signals change within a pose, by a straight line, and whether that is beyond their noise.

    The line is fitted to means over a fifth of a second, so that noise which is correlated over less counts once; what
    a parabola leaves is the noise, since creep bends.

    Args:
        signal: samples of one pose.
        rate: sample rate [Hz].
    """
    size = max(round(BLOCK * rate), 1)
    count = len(signal) // size
    if count < 5:
        return np.zeros(signal.shape[1]), np.zeros(signal.shape[1], bool)
    means = signal[: count * size].reshape(count, size, -1).mean(axis=1)
    time = np.linspace(-0.5, 0.5, count)
    slope = time @ (means - means.mean(axis=0)) / (time @ time)
    bend = time**2 - (time**2).mean()
    residuals = means - means.mean(axis=0) - np.outer(time, slope) - np.outer(bend, bend @ means / (bend @ bend))
    sigma = np.sqrt((residuals**2).sum(axis=0) / (count - 3) / (time @ time))
    limit = scipy.special.stdtrit(count - 3, 1 - CHANCE / (2 * signal.shape[1]))
    return slope, np.abs(slope) > limit * sigma


def creeping(
    poses: Sequence[Float[np.ndarray, "_ 6"]], rate: float
) -> tuple[Bool[np.ndarray, " poses"], Float[np.ndarray, "poses 6"], bool]:
    """Return which poses drift or creep, the change within each, and whether most of them drift.

    A pose counts where a component changes beyond its noise and three times as much as it typically does in a pose.

    Args:
        poses: force and moment of each [N, N·m].
        rate: sample rate [Hz].
    """
    tested = [changes(pose, rate) for pose in poses]
    slopes, beyond = np.array([slope for slope, _ in tested]), np.array([significant for _, significant in tested])
    typical = np.median(np.abs(slopes), axis=0)
    creeps = (beyond & (np.abs(slopes) > BEYOND * typical)).any(axis=1)
    return creeps, slopes, bool(beyond.any(axis=1).mean() > 0.5)
