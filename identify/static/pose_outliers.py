"""Static poses that the others contradict, and readings that lag behind the load.

A pose counts as an outlier by its externally studentised residuals (Belsley, Kuh, Welsch, Regression Diagnostics
(1980), 2.1): of the load cell's axes the worst, against Student's t at a chance that all axes of all poses share
(Bonferroni). Outliers that hide each other are found by Rosner's generalised many-outlier procedure (1983),
doi:10.1080/00401706.1983.10487848.

A load cell that creeps, or has hysteresis, reads ``w + c (w' - w)`` where its load is w, and w' is what it remembers
of the loads before: ``w'_k = q w'_(k-1) + (1 - q) w_(k-1)``, with the q of :data:`MEMORY` that fits best.
"""

from typing import NamedTuple

import numpy as np
import scipy
from jaxtyping import Bool, Float

from identify.static.pose_fit import CHANNELS, LINEAR, Attitudes, PoseFit, PoseSignals, fit

LEAST_FREE = 1e-6
"""Part of a reading that the others tell, below which its residual is rounding."""
LEAST_POSES = 8
"""Fewer poses are not judged: their residuals have too few degrees of freedom."""
CHANCE = 1e-3
"""Chance of a false alarm in a series, of outliers and of creep each."""
MEMORY = tuple(0.1 * k for k in range(10))
"""Parts of what a load cell remembers at a pose that it still remembers at the next one."""
MOST = 10
"""Largest number of outliers that are looked for."""
ROUNDING = 1e-6
"""Relative error of the readings, and part of the load, below which a residual or a lag says nothing."""


class Outlier(NamedTuple):
    """A pose that the others contradict."""

    pose: int
    """Index of the pose."""
    axis: int
    """Index of the component of the wrench in which it is furthest out: Fx Fy Fz Mx My Mz in B."""
    size: float
    """Reading less what the other poses predict [N or N·m]."""
    ratio: float
    """Size of the residual over its standard deviation by the other poses."""


class Creep(NamedTuple):
    """Part of the change of load since the poses before that is missing in the reading, of force and moment."""

    part: Float[np.ndarray, "2"]
    standard_uncertainty: Float[np.ndarray, "2"]
    columns: Float[np.ndarray, "n 6 8"]
    """Columns of the wrench by which it is estimated, those of the unknown load before the first pose among them."""


def outliers(
    signals: PoseSignals,
    attitudes: Attitudes,
    used: Bool[np.ndarray, " n"],
    memory: Float[np.ndarray, "n 6 c"] | None = None,
) -> list[Outlier]:
    """Return the poses that the others contradict, worst first.

    Args:
        signals: of all poses.
        attitudes: how far attitudes may be off.
        used: poses that count.
        memory: further columns of the wrench.
    """
    counted, candidates, shown = used.copy(), list[int](), 0
    measured = np.hstack(signals[:2])
    within = everyone = fit(signals, attitudes, counted, memory=memory)
    while counted.sum() >= LEAST_POSES and len(candidates) < min(used.sum() // 4, MOST):
        own = np.sqrt(np.maximum(1 - within.leverage, LEAST_FREE))
        studentised = np.abs(within.residuals) / own
        place, axis = np.unravel_index(np.argmax(studentised / _scatter(within, measured)), own.shape)
        candidates.append(int(np.flatnonzero(counted)[place]))
        limits = _limits(within)
        counted[candidates[-1]] = False
        within = fit(signals, attitudes, counted, memory=memory)
        if studentised[place, axis] > limits[axis] * _scatter(within, measured)[axis]:
            shown = len(candidates)
    counted = used.copy()
    counted[candidates[:shown]] = False
    clean = fit(signals, attitudes, counted, memory=memory)
    size = measured - clean.predicted(signals.specific_force, memory)
    ratios = np.zeros_like(size)
    ratios[used] = np.sqrt(np.maximum(1 - everyone.leverage, 0)) * np.abs(size[used]) / _scatter(clean, measured)
    # one that was looked at because worse ones hid each other may agree with the rest
    worst = [(pose, int(np.argmax(ratios[pose] / _limits(clean)))) for pose in candidates[:shown]]
    return [
        Outlier(pose=pose, axis=axis, size=float(size[pose, axis]), ratio=float(ratios[pose, axis]))
        for pose, axis in worst
        if ratios[pose, axis] > _limits(clean)[axis]
    ]


def creep(signals: PoseSignals, attitudes: Attitudes, used: Bool[np.ndarray, " n"]) -> Creep | None:
    """Return by how much readings lag behind the load; None where the poses show no lag beyond chance.

    Args:
        signals: of all poses, in the order in which they were held.
        attitudes: how far attitudes may be off.
        used: poses that count and are no outliers.
    """
    if used.sum() < LEAST_POSES:
        return None
    plain = fit(signals, attitudes, used).values
    candidates = [_memory(signals.specific_force, plain, keeps) for keeps in MEMORY]
    fits = [(fit(signals, attitudes, used, memory=columns), columns) for columns in candidates]
    # the leverages' sum is the rank: where poses repeat in turn, a lag is not told from the load itself
    determined = [pair for pair in fits if pair[0].leverage.sum() > LINEAR + pair[1][used].any(axis=(0, 1)).sum() - 0.5]
    if not determined:
        return None
    best, columns = min(determined, key=lambda pair: np.log(_scatter(pair[0], np.hstack(signals[:2])[used])).sum())
    part, u = best.memory[:2], best.memory_uncertainty[:2]
    limit = scipy.special.stdtrit(_freedom(best).min(), 1 - CHANCE / (4 * len(MEMORY)))
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


def _freedom(solution: PoseFit) -> Float[np.ndarray, "6"]:
    """Degrees of freedom of each component's residuals."""
    return np.asarray(np.maximum(len(solution.leverage) - solution.leverage.sum(axis=0), 1.0))


def _limits(solution: PoseFit) -> Float[np.ndarray, "6"]:
    """Studentised residual of each component that chance reaches once in ``1 / CHANCE`` series."""
    tests = 2 * CHANNELS * len(solution.leverage)
    return np.asarray(scipy.special.stdtrit(np.maximum(_freedom(solution) - 1, 1.0), 1 - CHANCE / tests))


def _scatter(solution: PoseFit, measured: Float[np.ndarray, "n 6"]) -> Float[np.ndarray, "6"]:
    """Standard deviation of each component of the readings, by the residuals."""
    rounding = ROUNDING**2 * np.repeat([np.square(part).mean() for part in (measured[:, :3], measured[:, 3:])], 3)
    return np.asarray(np.sqrt(np.square(solution.residuals).sum(axis=0) / _freedom(solution) + rounding))
