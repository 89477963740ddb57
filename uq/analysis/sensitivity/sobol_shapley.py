"""Causes of the spread of a measurement model's output: Sobol indices and Shapley effects with standard errors.

A model is a function of one trial, ``model({name: value}) -> output``, of a scalar or an array; its inputs are
distributions by name. Trials are points of scrambled Sobol sequences (:mod:`uq.sources.quasi_random`), or random. Every
index has its standard error: from its influence values, of the replicates or of the random trials, which are
independent. No input is left out, however small.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, get_args

import numpy as np

from identify.display.reporting import Result
from identify.exceptions import explains_names
from uq.analysis.sensitivity.effects import (
    PairEffects,
    of_all_subsets,
    of_permutations,
    of_swapped_players,
    swapped_players,
)
from uq.analysis.sensitivity.redraws import Correlation, Model, Redraws, correlated
from uq.analysis.sensitivity.subsets import MOST_PLAYERS
from uq.analysis.sensitivity.variance_shares import Indices, closure, mean, plain_variance
from uq.monte_carlo.trials.trial_loop import finite_trials
from uq.sources.distributions import Distribution
from uq.sources.quasi_random import REPLICATES, Points

TRIALS = 1024 * REPLICATES
"""Pairs of draws unless they are given."""


@dataclass(frozen=True, repr=False)
class Sensitivity(Result):
    """Indices of every player (an input, or a group of inputs) for every output.

    Example: ``sobol(lambda x: x["a"] * x["b"], inputs).to_frame().loc["a"]``.
    """

    players: tuple[str, ...]
    trials: int
    failed: int
    """Trials with an output that is not finite; they are left out."""
    evaluations: int
    """Evaluations of the model."""
    first: Indices | None
    """First-order indices, ``Var E[Y | X_p] / Var Y``; None where random permutations give Shapley effects alone."""
    total: Indices | None
    """Total indices, ``E Var[Y | all but X_p] / Var Y``; None where random permutations give Shapley effects alone."""
    shapley: Indices | None
    """Shapley effects, which add up to one also when inputs interact or are correlated; None from :func:`sobol`."""
    variance: np.ndarray
    """Variance of each output, (outputs,)."""
    variance_standard_error: np.ndarray
    closure: np.ndarray
    """The variance that the effects share out over the ordinary sample variance of the outputs, (outputs,): about 1."""
    closure_standard_error: np.ndarray
    points: Points = "random"
    """Kind of points that the trials were drawn from: random or quasi-random."""

    @property
    def indices(self) -> dict[str, Indices]:
        """First order, total and Shapley, as far as they were computed."""
        kinds = {"first order": self.first, "total": self.total, "Shapley": self.shapley}
        return {name: indices for name, indices in kinds.items() if indices is not None}

    def records(self) -> list[dict[str, Any]]:
        """Return every index with its standard error, by input and output."""
        return [
            {"input": player, "index": name, "output": output}
            | {"value": indices.value[p, output], "standard_error": indices.standard_error[p, output]}
            for p, player in enumerate(self.players)
            for name, indices in self.indices.items()
            for output in range(indices.value.shape[1])
        ]


@explains_names
def sobol(
    model: Model,
    inputs: Mapping[str, Distribution],
    *,
    trials: int = TRIALS,
    seed: int = 0,
    points: Points = "quasi-random",
    groups: Mapping[str, Sequence[str]] | None = None,
) -> Sensitivity:
    """Return first-order and total Sobol indices of independent inputs, from 2 k + 2 evaluations a trial.

    With two independent draws X and X', and ``Y_u`` the output for the inputs u from X and the others from X',
    ``V_p = E ½ (Y_all - Y_-p)(Y_p - Y_∅)`` (Owen 2013, doi:10.1145/2457052.2457064),
    ``T_p = E ¼ [(Y_all - Y_-p)² + (Y_∅ - Y_p)²]`` (Jansen 1999, doi:10.1016/S0010-4655(98)00154-4), and the variance
    is that of all k + 1 pairs without a common input (the design of Saltelli 2002, doi:10.1016/S0010-4655(02)00280-1).
    All three are unbiased and do not depend on the mean of Y.

    Args:
        model: the measurement model of one trial; an output of any shape counts as its raveled components.
        inputs: the distributions of its inputs, independent of one another.
        trials: pairs of draws; of quasi-random ones best 8 × 2^k.
        seed: seed of every draw.
        points: ``"quasi-random"``; or ``"random"``, as good below some hundred trials, where an input's draws do not
            depend on which others there are.
        groups: inputs that count as one player, by the group's name; inputs in no group count alone.

    Raises:
        ValueError: no trials, unknown points, or a group of unknown inputs or of inputs that another group holds.
    """
    names, players = _players(inputs, groups, trials, points)
    fixed = _inputs_fixed(swapped_players(len(players)), players, len(inputs))
    all_outputs = Redraws(model, inputs, joint=None, trials=trials, seed=seed, points=points).outputs(fixed)
    good, _ = finite_trials(all_outputs)
    return _result(names, of_swapped_players(good), good, all_outputs, points)


@explains_names
def shapley(
    model: Model,
    inputs: Mapping[str, Distribution],
    *,
    correlation: Correlation | None = None,
    trials: int = TRIALS,
    seed: int = 0,
    points: Points = "quasi-random",
    groups: Mapping[str, Sequence[str]] | None = None,
) -> Sensitivity:
    """Return Shapley effects: each player's fair part of the variance, also when inputs are correlated.

    Up to ten players every subset is visited, which gives first-order and total indices too; beyond, each trial walks
    one random permutation of the players (Song, Nelson, Staum 2016, doi:10.1137/15M1048070; Goda 2021,
    doi:10.1016/j.ress.2021.107702). The cost of a subset is ``E Var(Y | X_-u)``, estimated without bias by ``½ (Y -
    Y')²`` where Y' redraws the inputs u given the others; the ``Var E(Y | X_u)`` of a double loop has a bias. Shapley
    effects of a variance: Owen 2014, doi:10.1137/130936233; of correlated inputs: Owen and Prieur 2017,
    doi:10.1137/16M1097717.

    Args:
        model: the measurement model of one trial; an output of any shape counts as its raveled components.
        inputs: the distributions of its inputs.
        correlation: correlation coefficients of pairs of scalar normal inputs; pairs left out are uncorrelated.
        trials: pairs of draws; of quasi-random ones best 8 × 2^k.
        seed: seed of every draw.
        points: ``"quasi-random"``; or ``"random"``, as good below some hundred trials, where an input's draws do not
            depend on which others there are.
        groups: inputs that count as one player, by the group's name; inputs in no group count alone.

    Raises:
        ValueError: no trials; unknown points; a group of unknown inputs or of inputs that another group holds; a
            correlation of inputs that are unknown or not normal, or that no joint distribution has.
    """
    names, players = _players(inputs, groups, trials, points)
    joint, k = correlated(inputs, correlation), len(players)
    redraws = Redraws(model, inputs, joint=joint, trials=trials, seed=seed, points=points)
    if k > MOST_PLAYERS:
        order, all_outputs = redraws.walks(_inputs_held(players, len(inputs)))
        good, _ = finite_trials(all_outputs)
        order = order[np.isfinite(all_outputs).all(axis=(1, 2))]
        effects = of_permutations(good, order, correlated=joint is not None)
        return _result(names, effects, good[:, [0, -1]], all_outputs, points)
    fixed = _inputs_fixed(range(2**k), players, len(inputs))
    all_outputs = redraws.outputs(fixed)
    good, _ = finite_trials(all_outputs)
    effects = of_all_subsets(good, [1 << p for p in range(k)], k, correlated=joint is not None)
    return _result(names, effects, good if joint is None else good[:, -1:], all_outputs, points)


def _players(
    inputs: Mapping[str, Distribution], groups: Mapping[str, Sequence[str]] | None, trials: int, points: Points
) -> tuple[tuple[str, ...], list[int]]:
    """Names of the players, and the subset of inputs that each holds."""
    if points not in get_args(Points):
        raise ValueError(f"Argument `points` must be {' or '.join(get_args(Points))}, but is {points}.")
    if trials < 2:
        raise ValueError(f"Argument `trials` must be two or more, but is {trials}.")
    group_of: dict[str, str] = {}
    for group, members in (groups or {}).items():
        for name in members:
            if name not in inputs:
                raise ValueError(f"Argument `groups` must name inputs, but '{name}' is none of {', '.join(inputs)}.")
            if name in group_of:
                raise ValueError(
                    f"Argument `groups` must not overlap, but '{name}' is in '{group_of[name]}' and '{group}'."
                )
            group_of[name] = group
    player = [group_of.get(name, name) for name in inputs]
    names = tuple(dict.fromkeys(player))
    return names, [sum(1 << k for k, holder in enumerate(player) if holder == name) for name in names]


def _inputs_held(subsets: Sequence[int], count: int) -> np.ndarray:
    """Return the mask of the inputs that each of these subsets holds, (subsets, inputs)."""
    return np.array([[subset >> k & 1 for k in range(count)] for subset in subsets], bool)


def _inputs_fixed(choices: Sequence[int], players: Sequence[int], count: int) -> np.ndarray:
    """Return the mask of the inputs that each choice of players takes from the first draw, (choices, inputs)."""
    unions = [sum(player for p, player in enumerate(players) if choice >> p & 1) for choice in choices]
    return _inputs_held(unions, count)


def _result(
    names: tuple[str, ...], effects: PairEffects, sample: np.ndarray, all_outputs: np.ndarray, points: Points
) -> Sensitivity:
    """The indices; ``sample`` holds outputs of the good trials that have the distribution of Y."""
    good = np.isfinite(all_outputs).all(axis=(1, 2))
    average = _average(np.flatnonzero(good), points)
    effects = effects.averaged(average)
    trials, rows, outputs = all_outputs.shape
    first, total, shapley = effects.indices(np.ones(outputs))
    variance, variance_error = mean(effects.variance)
    ratio, ratio_error = closure(effects.variance, plain_variance(sample, average))
    return Sensitivity(
        players=names, trials=trials, failed=int(np.sum(~good)), evaluations=trials * rows,
        first=first, total=total, shapley=shapley, variance=variance, variance_standard_error=variance_error,
        closure=ratio, closure_standard_error=ratio_error, points=points,
    )  # fmt: skip


def _average(numbers: np.ndarray, points: Points) -> Callable[[np.ndarray], np.ndarray]:
    """Return independent figures from those of the trials of these numbers: means over each replicate."""
    if points == "random":
        return lambda figures: figures
    replicates = numbers % REPLICATES
    return lambda figures: np.stack([figures[replicates == replicate].mean(0) for replicate in np.unique(replicates)])
