"""Which choices of draws a budget visits, and what effects their outputs give: every subset, or some random walks.

A choice ``w`` takes the players ``w`` (a subset's number) from a pair's first draw and the others from its second.
Up to ten players all 2^d choices are visited (:mod:`uq.sensitivity.subsets`). Beyond, each of a few walks starts at a
random choice ``w`` and swaps one player after the other in a random order. The step that swaps ``p`` after ``u`` gives
``½ (Y_w - Y_(w xor p)) (Y_(w xor u) - Y_(w xor u xor p))``, whose expectation is what p adds to u, averaged with the
same step of the way back (after the walks of Goda 2021, doi:10.1016/j.ress.2021.107702; a product of differences, so
that a small share has a small error). First orders and totals are taken at both ends. The variance is the sum of the
steps.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from uq.sensitivity.subsets import MOST_PLAYERS, effects_of_swaps, walsh
from uq.sensitivity.variance_shares import ratio

WALKS = 8
"""Random walks beyond ten players."""


class PairEffects(NamedTuple):
    """What each pair of trials says, (pairs, players, outputs), without bias."""

    first: np.ndarray
    total: np.ndarray
    shapley: np.ndarray
    variance: np.ndarray
    """(pairs, outputs)."""
    walks: np.ndarray | None = None
    """Shapley effects by walk, (walks, pairs, players, outputs); None where every subset is visited."""


class Walk(NamedTuple):
    """Where a walk starts, and in which order it swaps the players."""

    start: int
    order: tuple[int, ...]


class Design(NamedTuple):
    """The choices that are visited, for players that hold some of ``draws`` independent draws."""

    draws: int
    games: tuple[tuple[int, ...], ...]
    """Who plays: partitions of the draws, as subsets' numbers; a player of nothing may be among them."""
    walks: tuple[tuple[Walk, ...], ...]
    """By game; empty where every subset is visited."""
    choices: tuple[int, ...]

    @classmethod
    def of(cls, count: int, games: Sequence[Sequence[int]]) -> "Design":
        """Return the design for some games: the same whenever they are."""
        played = tuple(map(tuple, games))
        if count <= MOST_PLAYERS:
            return cls(count, played, tuple(() for _ in played), tuple(range(2**count)))
        generator, full = np.random.default_rng(count), 2**count - 1
        bits = [generator.integers(2, size=count) for _ in range(WALKS)]
        starts = [sum(int(bit) << k for k, bit in enumerate(row)) for row in bits]
        walks = tuple(
            tuple(Walk(start, tuple(generator.permutation(len(players)).tolist())) for start in starts)
            for players in played
        )
        visited = {v for game, of in zip(played, walks, strict=True) for walk in of for v in _visited(walk, game, full)}
        return cls(count, played, walks, tuple(sorted(visited)))

    def effects(self, outputs: np.ndarray, game: int) -> PairEffects:
        """Return what outputs of all choices, (pairs, choices, outputs), say of a game's players."""
        players = self.games[game]
        if not self.walks[game]:
            found = effects_of_swaps(players, self.draws) @ (walsh(self.draws) @ outputs) ** 2
            first, total, shapley = np.split(found[:, :-1], 3, axis=1)
            return PairEffects(first, total, shapley, found[:, -1])
        place = {choice: k for k, choice in enumerate(self.choices)}
        y, full = lambda v: outputs[:, place[v]], 2**self.draws - 1
        walked = [_walked(walk, players, y, full) for walk in self.walks[game]]
        first, total, shapley, variance = (np.stack(parts) for parts in zip(*(one[:4] for one in walked), strict=True))
        return PairEffects(first.mean(0), total.mean(0), shapley.mean(0), variance.mean(0), shapley)


def _visited(walk: Walk, players: Sequence[int], full: int) -> set[int]:
    ends = {end ^ swap for end in (walk.start, walk.start ^ full) for swap in (0, *players)}
    return ends | set(_steps(walk, players))


def _steps(walk: Walk, players: Sequence[int]) -> list[int]:
    """The choices that a walk passes, from its start to the opposite choice."""
    steps = [walk.start]
    for player in walk.order:
        steps.append(steps[-1] ^ players[player])
    return steps


def _walked(walk: Walk, players: Sequence[int], y, full: int) -> PairEffects:
    start, end, steps = y(walk.start), y(walk.start ^ full), _steps(walk, players)
    ones, others = ([y(at ^ player) for player in players] for at in (walk.start, walk.start ^ full))
    first = [(start - a) * (b - end) / 2 for a, b in zip(ones, others, strict=True)]
    total = [((start - a) ** 2 + (end - b) ** 2) / 4 for a, b in zip(ones, others, strict=True)]
    shapley = np.empty((len(start), len(players), start.shape[-1]))
    for k, p in enumerate(walk.order):
        shapley[:, p] = (y(steps[k]) - y(steps[k + 1])) * (start - ones[p] + others[p] - end) / 4
    return PairEffects(np.stack(first, axis=1), np.stack(total, axis=1), shapley, shapley.sum(1))


def walk_variance(walks: np.ndarray, variance: np.ndarray) -> np.ndarray:
    """Return the variance that the choice of walks adds to a Shapley share: (players, outputs).

    The scatter of the walks' means less what the pairs' own scatter explains of it (analysis of variance), over the
    number of walks; nought where players do not interact.

    Args:
        walks: Shapley effects, (walks, pairs, players, outputs).
        variance: of the outputs, (pairs, outputs).
    """
    own, pairs = walks - walks.mean(0), walks.shape[1]
    within = own.var(axis=1, ddof=1).sum(0) / (len(walks) - 1) / pairs
    between = np.maximum(own.mean(1).var(axis=0, ddof=1) - within, 0)
    scale, _ = ratio(np.ones_like(variance), variance)
    return between / len(walks) * scale**2
