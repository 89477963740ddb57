"""First-order, total and Shapley effects from a model's outputs with choices between two draws.

A choice ``w`` takes the players ``w`` (a subset's number) from a pair's first draw and the others from its second.
Which choices are evaluated depends on which effects are wanted and what they cost:

- all 2^d of them, up to ten players (:func:`of_all_subsets`, :mod:`uq.analysis.sensitivity.subsets`);
- both draws and each player swapped, for first orders and totals alone (:func:`of_swapped_players`, ``uq.sobol``);
- beyond ten players of a model, a random permutation for each pair (:func:`of_permutations`, ``uq.shapley``), so that
  the error falls with the number of pairs;
- beyond ten sources of an experiment, a few walks that all pairs share (:class:`ChoiceDesign`, ``uq.budget``), because
  every choice is a case that must be compiled, and then costs little once its pair is drawn.

A walk starts at a random choice ``w`` and swaps one player after the other in a random order. The step that swaps ``p``
after ``u`` gives ``½ (Y_w - Y_(w xor p)) (Y_(w xor u) - Y_(w xor u xor p))``, whose expectation is what p adds to u,
averaged with the same step of the way back (after the walks of Goda 2021, doi:10.1016/j.ress.2021.107702; a product of
differences, so that a small share has a small error). First orders and totals are taken at both ends. The variance is
the sum of the steps.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from uq.analysis.sensitivity.subsets import MOST_PLAYERS, effects_of_costs, effects_of_swaps, walsh
from uq.analysis.sensitivity.variance_shares import Indices, ratio, shares

WALKS = 8
"""Random walks beyond ten players."""
Outputs = Float[np.ndarray, "pairs choices outputs"]


class PairEffects(NamedTuple):
    """Unbiased estimates from each pair of trials, (pairs, players, outputs); None: not asked for."""

    first: np.ndarray | None
    total: np.ndarray | None
    shapley: np.ndarray | None
    variance: np.ndarray
    """Sample variance of each output from each pair, (pairs, outputs)."""
    walks: np.ndarray | None = None
    """Shapley effects by walk, (walks, pairs, players, outputs); None where every pair has its own walk, or every
    subset."""

    def averaged(self, average: Callable[[np.ndarray], np.ndarray]) -> "PairEffects":
        """Return the same with means over some pairs, as over a replicate's, in the place of pairs."""
        kinds = (self.first, self.total, self.shapley, self.variance)
        return PairEffects(*(None if effects is None else average(effects) for effects in kinds))  # type: ignore[arg-type]

    def indices(self, weights: Float[np.ndarray, " outputs"]) -> tuple[Indices | None, Indices | None, Indices | None]:
        """Return first-order, total and Shapley shares; ``weights``: of the outputs in the generalised shares."""
        first, total, shapley = (
            None if effects is None else shares(effects, self.variance, weights)
            for effects in (self.first, self.total, self.shapley)
        )
        if shapley is not None and self.walks is not None:
            output_variance = walk_variance(self.walks, self.variance)
            generalised = walk_variance((self.walks @ weights)[..., None], (self.variance @ weights)[:, None])[:, 0]
            shapley = shapley.widened(output_variance, generalised)
        return first, total, shapley


def of_all_subsets(outputs: Outputs, players: Sequence[int], draws: int, *, correlated: bool = False) -> PairEffects:
    """Return the effects that outputs of all 2^draws choices give.

    Args:
        outputs: of choice ``k`` in place ``k``.
        players: the draws that each player holds, as subsets' numbers.
        draws: how many draws there are.
        correlated: inputs are redrawn given the fixed ones, so that outputs compare with the first draw's alone.
    """
    if correlated:
        redrawn = outputs[:, ::-1]  # subset u is redrawn where its complement is kept
        effects = effects_of_costs(players, draws) @ (redrawn - outputs[:, -1:]) ** 2 / 2
    else:
        effects = effects_of_swaps(players, draws) @ (walsh(draws) @ outputs) ** 2
    first, total, shapley = np.split(effects[:, :-1], 3, axis=1)
    return PairEffects(first, total, shapley, effects[:, -1])


def swapped_players(players: int) -> list[int]:
    """Return the choices of :func:`of_swapped_players`: all players, none, each alone, all but each."""
    everything = 2**players - 1
    alone = [1 << p for p in range(players)]
    return [everything, 0, *alone, *(everything & ~p for p in alone)]


def of_swapped_players(outputs: Outputs) -> PairEffects:
    """Return first orders and totals from outputs of :func:`swapped_players` (:func:`uq.sobol`)."""
    both, none, alone, others = np.split(outputs, [1, 2, 1 + outputs.shape[1] // 2], axis=1)
    pairs = np.concatenate([both - none, alone - others], axis=1)
    return PairEffects(
        (both - others) * (alone - none) / 2,
        ((both - others) ** 2 + (none - alone) ** 2) / 4,
        None,
        (pairs**2).mean(1) / 2,
    )


def of_permutations(
    outputs: Outputs, order: Int[np.ndarray, "pairs players"], *, correlated: bool = False
) -> PairEffects:
    """Return Shapley effects from outputs as one player after the other is redrawn, in an order drawn for each pair."""
    start, end = outputs[:, :1], outputs[:, -1:]
    if correlated:
        increments = np.diff((outputs - start) ** 2, axis=1) / 2
    else:  # the walk and its reverse at once
        increments = np.diff(outputs, axis=1) * (end - start) / 2
    effects = np.empty_like(increments)
    np.put_along_axis(effects, order[:, :, None], increments, axis=1)
    return PairEffects(None, None, effects, increments.sum(1))


class Walk(NamedTuple):
    """The start of a walk, and the order in which it swaps the players."""

    start: int
    order: tuple[int, ...]


class ChoiceDesign(NamedTuple):
    """The choices that are evaluated, for players that hold some of ``draws`` independent draws."""

    draws: int
    games: tuple[tuple[int, ...], ...]
    """Partitions of the draws among players, as subsets' numbers; a player may hold no draw."""
    walks: tuple[tuple[Walk, ...], ...]
    """Walks of each game; empty where every subset is visited."""
    choices: tuple[int, ...]

    @classmethod
    def of(cls, count: int, games: Sequence[Sequence[int]]) -> "ChoiceDesign":
        """Return the design for some games; the same games give the same design."""
        partitions = tuple(map(tuple, games))
        if count <= MOST_PLAYERS:
            return cls(count, partitions, tuple(() for _ in partitions), tuple(range(2**count)))
        generator, full = np.random.default_rng(count), 2**count - 1
        bits = [generator.integers(2, size=count) for _ in range(WALKS)]
        starts = [sum(int(bit) << k for k, bit in enumerate(row)) for row in bits]
        walks = tuple(
            tuple(Walk(start, tuple(generator.permutation(len(players)).tolist())) for start in starts)
            for players in partitions
        )
        pairs = [(walk, game) for game, game_walks in zip(partitions, walks, strict=True) for walk in game_walks]
        visited: set[int] = set().union(*(_visited(walk, game, full) for walk, game in pairs))
        return cls(count, partitions, walks, tuple(sorted(visited)))

    def effects(self, outputs: np.ndarray, game: int) -> PairEffects:
        """Return the effects of a game's players from the outputs of all choices, (pairs, choices, outputs)."""
        players = self.games[game]
        if not self.walks[game]:
            return of_all_subsets(outputs, players, self.draws)
        places = {choice: k for k, choice in enumerate(self.choices)}
        y, full = lambda v: outputs[:, places[v]], 2**self.draws - 1
        walks = [_walked(walk, players, y, full) for walk in self.walks[game]]
        first, total, shapley, variance = map(np.stack, zip(*(effects[:4] for effects in walks), strict=True))
        return PairEffects(
            first=first.mean(0), total=total.mean(0), shapley=shapley.mean(0), variance=variance.mean(0), walks=shapley
        )


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
    from_start, from_end = ([y(at ^ player) for player in players] for at in (walk.start, walk.start ^ full))
    first = [(start - a) * (b - end) / 2 for a, b in zip(from_start, from_end, strict=True)]
    total = [((start - a) ** 2 + (end - b) ** 2) / 4 for a, b in zip(from_start, from_end, strict=True)]
    shapley = np.empty((len(start), len(players), start.shape[-1]))
    for k, p in enumerate(walk.order):
        shapley[:, p] = (y(steps[k]) - y(steps[k + 1])) * (start - from_start[p] + from_end[p] - end) / 4
    return PairEffects(np.stack(first, axis=1), np.stack(total, axis=1), shapley, shapley.sum(1))


def walk_variance(walks: np.ndarray, variance: np.ndarray) -> np.ndarray:
    """Return the variance that the choice of walks adds to a Shapley share: (players, outputs).

    The scatter of the walks' means less what the pairs' own scatter explains of it (analysis of variance), over the
    number of walks; zero where players do not interact.

    Args:
        walks: Shapley effects, (walks, pairs, players, outputs).
        variance: of the outputs, (pairs, outputs).
    """
    centred, pairs = walks - walks.mean(0), walks.shape[1]
    within = centred.var(axis=1, ddof=1).sum(0) / (len(walks) - 1) / pairs
    between = np.maximum(centred.mean(1).var(axis=0, ddof=1) - within, 0)
    scale, _ = ratio(np.ones_like(variance), variance)
    return between / len(walks) * scale**2
