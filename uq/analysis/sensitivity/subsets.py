"""First-order, total and Shapley effects from the variances that subsets of inputs cause: the combinatorics.

A subset of ``d`` inputs is a number from 0 to ``2**d - 1``, whose bit ``i`` says whether input ``i`` belongs to it. All
effects are linear in the cost ``c(u) = E[Var(Y | X_-u)]``, the variance that redrawing the inputs ``u`` alone causes:
``c`` of nothing is 0, of all inputs Var Y.
"""

from collections.abc import Sequence
from math import comb

import numpy as np
import scipy

MOST_PLAYERS = 10
"""Most players whose subsets are all visited."""


def effects_of_costs(players: Sequence[int], count: int) -> np.ndarray:
    """Return the matrix that takes costs to effects: first order of each player, total, Shapley, then the variance.

    First order ``Var E[Y | X_p] = c(all) - c(all without p)``; total ``E Var[Y | X_-p] = c(p)``; Shapley effect
    ``Σ_u |u|! (k - |u| - 1)! / k! (c(u ∪ p) - c(u))`` over the unions ``u`` of the k - 1 other players (Owen 2014,
    doi:10.1137/130936233; with this cost: Song, Nelson, Staum 2016, doi:10.1137/15M1048070).

    Args:
        players: the subset of inputs that each player holds; Shapley effects need a partition of all inputs.
        count: number of inputs d.

    Returns:
        (3 k + 1, 2^d) for k players.
    """
    everything, k = 2**count - 1, len(players)
    first, total, shapley = (np.zeros((k, 2**count)) for _ in range(3))
    for p, player in enumerate(players):
        first[p, everything] += 1
        first[p, everything & ~player] -= 1
        total[p, player] += 1
        for size, union in _unions([other for q, other in enumerate(players) if q != p]):
            weight = 1 / (k * comb(k - 1, size))
            shapley[p, union | player] += weight
            shapley[p, union] -= weight
    variance = np.eye(2**count)[[everything]]
    return np.concatenate([first, total, shapley, variance])


def _unions(players: Sequence[int]) -> list[tuple[int, int]]:
    """Number of members and union of every set of players."""
    unions = [(0, 0)]
    for player in players:
        unions += [(size + 1, union | player) for size, union in unions]
    return unions


def walsh(count: int) -> np.ndarray:
    """Return the Walsh–Hadamard matrix over subsets, normalised: (2^d, 2^d), ``(-1)^|v ∩ w| / 2^d``."""
    return scipy.linalg.hadamard(2**count) / 2**count


def effects_of_swaps(players: Sequence[int], count: int) -> np.ndarray:
    """Return the matrix that takes squared Walsh coefficients of one pair of draws to unbiased estimates of effects.

    Of two independent draws X and X', ``Y_w`` takes the inputs ``w`` from X and the others from X'. Any two of these
    outputs that differ by swapping ``s`` give ``½ (Y_w - Y_(w xor s))²``, whose expectation is ``c(s)`` (Jansen 1999,
    doi:10.1016/S0010-4655(98)00154-4). The mean of it over all w is ``Σ_v (1 - (-1)^|v ∩ s|) y_v²`` in the Walsh
    coefficients ``y = walsh(d) @ Y``. First orders so estimated are means of ``½ (Y_w - Y_(w xor p)) (Y_(w xor -p) -
    Y_(w xor all))``, a product of differences (Owen 2013, doi:10.1145/2457052.2457064): a small index has a small
    error. No estimate depends on the mean of Y, and none is biased.

    Args:
        players: as for :func:`effects_of_costs`.
        count: number of inputs d.

    Returns:
        (3 k + 1, 2^d): first order of each of the k players, total, Shapley effect, then the variance.
    """
    return effects_of_costs(players, count) @ (1.0 - scipy.linalg.hadamard(2**count))
