"""Creep of the load cell: readings that change within a static pose, and readings that lag behind the loads before.

A load cell that creeps, or has hysteresis, reads ``w + c (w' - w)`` where its load is w, and w' is what it remembers
of the loads before: ``w'_k = q w'_(k-1) + (1 - q) w_(k-1)``, with the q of :data:`MEMORY` that fits best.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy
from jaxtyping import Bool, Float

from identify.estimation.static_poses.pose_fit import CHANNELS, LINEAR, Attitudes, PoseSignals, fit
from identify.estimation.static_poses.pose_outliers import (
    CHANCE,
    LEAST_POSES,
    ROUNDING,
    residual_freedom,
    residual_scatter,
)

BLOCK = 0.2
"""Seconds whose mean counts as one independent reading."""
POSE_CHANCE = 1e-4
"""Chance of a false alarm of a change within a pose."""
BEYOND = 3.0
"""Change within a pose over the typical one above which the pose is left out."""
MEMORY = tuple(0.1 * k for k in range(10))
"""Parts of what a load cell remembers at a pose that it still remembers at the next one."""


class Creep(NamedTuple):
    """Part of the change of load since the poses before that is missing in the reading, of force and moment."""

    part: Float[np.ndarray, "2"]
    standard_uncertainty: Float[np.ndarray, "2"]
    columns: Float[np.ndarray, "n 6 8"]
    """Columns of the wrench by which it is estimated, those of the unknown load before the first pose among them."""


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
    limit = scipy.special.stdtrit(count - 3, 1 - POSE_CHANCE / (2 * signal.shape[1]))
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


def creep(
    signals: PoseSignals, attitudes: Attitudes, used: Bool[np.ndarray, " n"],
    beside: Float[np.ndarray, "n 6 c"] | None = None,
) -> Creep | None:  # fmt: skip
    """Return by how much readings lag behind the load; None where the poses show no lag beyond chance.

    Args:
        signals: of all poses, in the order in which they were held.
        attitudes: how far attitudes may be off.
        used: poses that count and are no outliers.
        beside: columns of another explanation, beside which the lag must show.
    """
    if used.sum() < LEAST_POSES:
        return None
    plain = fit(signals, attitudes, used, memory=beside).values
    more = np.zeros((len(used), CHANNELS, 0)) if beside is None else beside
    candidates = [np.concatenate([_memory(signals.specific_force, plain, keeps), more], axis=2) for keeps in MEMORY]
    fits = [(fit(signals, attitudes, used, memory=columns), columns) for columns in candidates]
    # the leverages' sum is the rank: where poses repeat in turn, a lag is not told from the load itself
    determined = [pair for pair in fits if pair[0].leverage.sum() > LINEAR + pair[1][used].any(axis=(0, 1)).sum() - 0.5]
    if not determined:
        return None
    best, columns = min(
        determined, key=lambda pair: np.log(residual_scatter(pair[0], np.hstack(signals[:2])[used])).sum()
    )
    part, u = best.memory[:2], best.memory_uncertainty[:2]
    limit = scipy.special.stdtrit(residual_freedom(best).min(), 1 - CHANCE / (4 * len(MEMORY)))
    columns = columns[:, :, : 2 + CHANNELS]
    return Creep(part, u, columns) if (np.abs(part) > limit * u + ROUNDING).any() else None


def _memory(f: Float[np.ndarray, "n 3"], plain: Float[np.ndarray, "10"], keeps: float) -> Float[np.ndarray, "n 6 8"]:
    """Columns of a lag: of force and moment, and of the load that the load cell remembers at the first pose."""
    lagging = np.zeros_like(f)
    for k in range(1, len(f)):
        lagging[k] = keeps * lagging[k - 1] + (1 - keeps) * f[k - 1]
    columns = np.zeros((len(f), CHANNELS, 2 + CHANNELS))
    columns[:, :3, 0], columns[:, 3:, 1] = plain[0] * (lagging - f), np.cross(plain[4:7], lagging - f)
    columns[:, :, 2:] = np.multiply.outer(keeps ** np.arange(len(f)), np.eye(CHANNELS))
    return columns
