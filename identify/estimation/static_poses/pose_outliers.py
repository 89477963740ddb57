"""Static poses that the others contradict.

A pose counts as an outlier by its externally studentised residuals (Belsley, Kuh, Welsch, Regression Diagnostics
(1980), 2.1): of the load cell's axes the worst, against Student's t at a chance that all axes of all poses share
(Bonferroni). Outliers that hide each other are found by Rosner's generalised many-outlier procedure (1983),
doi:10.1080/00401706.1983.10487848.
"""

from typing import NamedTuple

import numpy as np
import scipy
from jaxtyping import Bool, Float

from identify.estimation.static_poses.pose_fit import CHANNELS, Attitudes, PoseFit, PoseSignals, fit

LEAST_FREE = 1e-6
"""Part of a reading that the others tell, below which its residual is rounding."""
LEAST_POSES = 8
"""Fewer poses are not judged: their residuals have too few degrees of freedom."""
CHANCE = 1e-3
"""Chance of a false alarm in a series."""
MOST = 10
"""Largest number of outliers that are looked for."""
ROUNDING = 1e-6
"""Relative error of the readings, and part of the load, below which a residual says nothing."""


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
        root_redundancy = np.sqrt(np.maximum(1 - within.leverage, LEAST_FREE))
        studentised = np.abs(within.residuals) / root_redundancy
        place, axis = np.unravel_index(
            np.argmax(studentised / residual_scatter(within, measured)), root_redundancy.shape
        )
        candidates.append(int(np.flatnonzero(counted)[place]))
        limits = _limits(within)
        counted[candidates[-1]] = False
        within = fit(signals, attitudes, counted, memory=memory)
        if studentised[place, axis] > limits[axis] * residual_scatter(within, measured)[axis]:
            shown = len(candidates)
    counted = used.copy()
    counted[candidates[:shown]] = False
    clean = fit(signals, attitudes, counted, memory=memory)
    size = measured - clean.predicted(signals.specific_force, memory)
    ratios = np.zeros_like(size)
    ratios[used] = (
        np.sqrt(np.maximum(1 - everyone.leverage, 0)) * np.abs(size[used]) / residual_scatter(clean, measured)
    )
    # one that was looked at because worse ones hid each other may agree with the rest
    worst = [(pose, int(np.argmax(ratios[pose] / _limits(clean)))) for pose in candidates[:shown]]
    return [
        Outlier(pose=pose, axis=axis, size=float(size[pose, axis]), ratio=float(ratios[pose, axis]))
        for pose, axis in worst
        if ratios[pose, axis] > _limits(clean)[axis]
    ]


def residual_freedom(solution: PoseFit) -> Float[np.ndarray, "6"]:
    """Degrees of freedom of each component's residuals."""
    return np.asarray(np.maximum(len(solution.leverage) - solution.leverage.sum(axis=0), 1.0))


def _limits(solution: PoseFit) -> Float[np.ndarray, "6"]:
    """Studentised residual of each component that chance reaches once in ``1 / CHANCE`` series."""
    tests = 2 * CHANNELS * len(solution.leverage)
    return np.asarray(scipy.special.stdtrit(np.maximum(residual_freedom(solution) - 1, 1.0), 1 - CHANCE / tests))


def residual_scatter(solution: PoseFit, measured: Float[np.ndarray, "n 6"]) -> Float[np.ndarray, "6"]:
    """Standard deviation of each component of the readings, by the residuals."""
    rounding = ROUNDING**2 * np.repeat([np.square(part).mean() for part in (measured[:, :3], measured[:, 3:])], 3)
    return np.asarray(np.sqrt(np.square(solution.residuals).sum(axis=0) / residual_freedom(solution) + rounding))
