"""Drift of the load cell's zero over static poses, as it warms up, told apart from creep and from turned axes.

The zero of a pose is ``F0 + Σ c_k P_k(x)``, x the progress of the series from -1 to 1 and P_k Legendre's polynomials,
for each of the six components; beyond the line only as far as the poses show it. Poses in small steps turn gravity as
steadily as a zero drifts: so it must show beside a free turn of the attitudes' axes, and leave less than that turn.
"""

from typing import NamedTuple

import numpy as np
import scipy
from jaxtyping import Bool, Float

from identify.display.rounding import with_uncertainty
from identify.estimation.static_poses.pose_fit import CHANNELS, LINEAR, Attitudes, PoseFit, PoseSignals, fit
from identify.estimation.static_poses.pose_outliers import (
    CHANCE,
    LEAST_POSES,
    ROUNDING,
    residual_freedom,
    residual_scatter,
)
from identify.rigid_body.regressor import cross_matrices

Columns = Float[np.ndarray, "n 6 _"]
ORDERS = 3
"""Highest power of the progress in the drift of a zero."""
LEAST_BENDING = 20
"""Poses from which a drift may bend: fewer would follow any pose."""


class ZeroDrift(NamedTuple):
    """Drift of force and moment's zero over a series of poses."""

    change: Float[np.ndarray, "6"]
    """Change from the first pose to the last [N, N·m]."""
    standard_uncertainty: Float[np.ndarray, "6"]
    columns: Columns
    """Columns of the wrench by which it is estimated."""
    rival: str = ""
    """Words for another explanation that fits as well; empty: there is none."""

    def __str__(self) -> str:
        pairs = [with_uncertainty(x, u) for x, u in zip(self.change, self.standard_uncertainty, strict=True)]
        return f"({', '.join(pairs[:3])}) N and ({', '.join(pairs[3:])}) N·m"


def zero_drift(
    signals: PoseSignals, attitudes: Attitudes, used: Bool[np.ndarray, " n"], progress: Float[np.ndarray, " n"],
    beside: Columns | None = None,
) -> ZeroDrift | None:  # fmt: skip
    """Return the drift of the zero; None where the poses show none beyond chance.

    Args:
        signals: of all poses.
        attitudes: how far attitudes may be off.
        used: poses that count and are no outliers.
        progress: order or time of the poses, in any unit.
        beside: columns of another explanation, beside which the drift must show.
    """
    if used.sum() < LEAST_POSES or not np.ptp(progress[used]) > 0:
        return None
    start, stop = progress[used].min(), progress[used].max()
    x = (2 * progress - start - stop) / (stop - start)
    turn = _turn_columns(signals, attitudes, used)
    others = turn if beside is None else np.concatenate([turn, beside], axis=2)
    shown: list[np.ndarray] = []
    for order in range(1, 1 + (ORDERS if used.sum() >= LEAST_BENDING else 1)):
        shape = np.polynomial.legendre.legval(x, np.eye(1 + ORDERS)[order])
        columns = np.concatenate([*shown, np.multiply.outer(shape, np.eye(CHANNELS))], axis=2)
        if not _shows(signals, attitudes, used, columns, others):
            break
        shown.append(columns[:, :, -CHANNELS:])
    if not shown:
        return None
    columns = np.concatenate(shown, axis=2)
    drifting, turned = (fit(signals, attitudes, used, memory=memory) for memory in (columns, turn))
    if misfit(drifting, signals, used) > misfit(turned, signals, used):
        return None
    odd, u = (x.reshape(-1, CHANNELS)[::2] for x in (drifting.memory, drifting.memory_uncertainty))
    return ZeroDrift(2 * odd.sum(axis=0), 2 * np.sqrt(np.square(u).sum(axis=0)), columns)


def misfit(solution: PoseFit, signals: PoseSignals, used: Bool[np.ndarray, " n"]) -> float:
    """Return minus twice the logarithm of a fit's likelihood, but for a constant."""
    return 2 * float(used.sum() * np.log(residual_scatter(solution, np.hstack(signals[:2])[used])).sum())


def _shows(
    signals: PoseSignals, attitudes: Attitudes, used: Bool[np.ndarray, " n"], columns: Columns, others: Columns
) -> bool:
    """Whether the last six of some columns are beyond chance, by themselves and beside others."""
    for memory in (columns, np.concatenate([others, columns], axis=2)):
        solution = fit(signals, attitudes, used, memory=memory)
        if solution.leverage.sum() < LINEAR + memory.shape[2] - 0.5:
            return False
        size, u = np.abs(solution.memory[-CHANNELS:]), solution.memory_uncertainty[-CHANNELS:]
        limit = scipy.special.stdtrit(residual_freedom(solution).min(), 1 - CHANCE / (2 * CHANNELS * ORDERS))
        scale = np.repeat([np.abs(part).max() for part in signals[:2]], 3)
        if not (size > limit * u + ROUNDING * scale).any():
            return False
    return True


def _turn_columns(signals: PoseSignals, attitudes: Attitudes, used: Bool[np.ndarray, " n"]) -> Columns:
    """Columns of a small turn of the attitudes' axes."""
    plain, f = fit(signals, attitudes, used).values, signals.specific_force
    change = -cross_matrices(f)
    moment = np.cross(plain[4:7], change, axisb=1, axisc=1)
    return np.concatenate([plain[0] * change, moment], axis=1)
