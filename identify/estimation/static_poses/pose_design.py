"""Static poses that determine mass and centre of gravity best: chosen out of many by exchange.

Each set of poses is judged by the logarithm of its predicted covariance's determinant (D-optimality), which units do
not change. The set is improved by exchanging one pose for another as long as that helps (Fedorov's exchange; Atkinson,
Donev, Tobias, Optimum Experimental Designs (2007), chapter 12).
"""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from identify.estimation.static_poses.centre import predicted_covariance
from identify.estimation.static_poses.pose_fit import EXACT, Attitudes

Cost = Callable[[np.ndarray], float]
"""Function from the indices of a set of poses to the cost that the design minimises."""
GAIN = 1e-9
"""Least improvement for which a pose is exchanged."""


def best_poses(candidates: int, count: int, cost: Cost, *, starts: int = 4, seed: int = 0) -> np.ndarray:
    """Return the numbers of the poses of the cheapest set that exchanges reach, in increasing order.

    Args:
        candidates: how many poses there are to choose from; one may be chosen several times.
        count: how many are wanted.
        cost: of a set, infinite where it does not determine the parameters.
        starts: random sets to begin with.
        seed: of those.

    Raises:
        ValueError: no set that was tried has a finite cost.
    """
    generator = np.random.default_rng(seed)
    designs = [_improved(_start(generator, candidates, count, cost), candidates, cost) for _ in range(starts)]
    best = min(designs, key=cost)
    if not np.isfinite(cost(best)):
        raise ValueError(f"no {count} of {candidates} poses determine the centre of gravity")
    return np.sort(best)


def _start(generator: np.random.Generator, candidates: int, count: int, cost: Cost) -> np.ndarray:
    """A random set, of finite cost if one of a few draws has it."""
    chosen = generator.integers(candidates, size=count)
    for _ in range(20):
        if np.isfinite(cost(chosen)):
            break
        chosen = generator.integers(candidates, size=count)
    return chosen


def _improved(chosen: np.ndarray, candidates: int, cost: Cost) -> np.ndarray:
    """The set after exchanges, each the best for its place, until none helps."""
    least, better = cost(chosen), True
    while better:
        better = False
        for place in range(len(chosen)):
            others = [np.r_[chosen[:place], other, chosen[place + 1 :]] for other in range(candidates)]
            costs = [cost(other) for other in others]
            k = int(np.argmin(costs))
            if costs[k] < least - GAIN:
                chosen, least, better = others[k], costs[k], True
    return chosen


def log_determinant(
    specific_force: Float[np.ndarray, "n 3"],
    mass: float,
    r_cg: Float[np.ndarray, "3"],
    scatter: Float[np.ndarray, "6 6"],
    attitudes: Attitudes = EXACT,
) -> float:
    """Return the log determinant of the covariance of mass and centre; infinite where poses do not determine them.

    Args:
        specific_force: of the poses, opposite to gravity, in B [m/s²].
        mass: expected [kg].
        r_cg: expected centre of gravity from Q, in B [m].
        scatter: covariance of each pose's mean force and moment.
        attitudes: how far the poses' attitudes may be off.
    """
    if np.linalg.matrix_rank(specific_force - specific_force.mean(axis=0), tol=1e-3) < 2:
        return np.inf
    covariance = predicted_covariance(specific_force, mass, r_cg, scatter, attitudes)[:4, :4]
    sign, value = np.linalg.slogdet(covariance)
    return float(value) if sign > 0 else np.inf
