"""The experiment's budget: which error source causes how much of the tensor's uncertainty, and which the mean error.

Every source is drawn twice, under its own name and under a twin's, and each pair of trials is solved with every choice
of one or the other. Two choices that differ by swapping some sources give the variance that these sources cause
(:mod:`uq.analysis.sensitivity.effects`). The Monte Carlo's engine computes it all: the sources, and the cases in which
they act, are its inputs.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import NamedTuple

import jax
import numpy as np

from identify.exceptions import explains_names
from identify.floating_point import check_precision
from identify.rigid_body.inertia import ENTRIES
from uq.analysis.sensitivity.budget_shares import FEWEST_PAIRS, BudgetResult, Effects, MeanSquare, SourceBudget
from uq.analysis.sensitivity.effects import ChoiceDesign, PairEffects
from uq.analysis.sensitivity.variance_shares import closure, mean, plain_variance
from uq.experiment.experiment import Experiment, ExperimentError
from uq.files.provenance import provenance
from uq.monte_carlo.campaign.statistics import Statistics
from uq.monte_carlo.campaign.trial_setup import prepare_engine
from uq.monte_carlo.gram_sums.cases import Case
from uq.monte_carlo.trials.chooser import EngineName
from uq.monte_carlo.trials.trial_loop import finite_trials
from uq.progress_bar import Progress, progress_of
from uq.sources.draws import Mixing
from uq.sources.source import Source


@explains_names
def budget(
    experiment: Experiment,
    *,
    trials: int = 1000,
    seed: int = 0,
    trajectories: str | Sequence[str] | None = None,
    estimators: str | Sequence[str] | None = None,
    engine: EngineName = "sums",
    dtype: str = "float64",
    batch: int | None = None,
    devices: Sequence[jax.Device] | None = None,
    progress: Progress | bool | None = None,
) -> BudgetResult:
    """Return first-order, total and Shapley shares of the variance, and the mean error, of every source and group.

    Shares are of the variance of each component, and of the whole tensor (the trace of the covariance of its nine
    entries); see :func:`uq.analysis.sensitivity.sobol_shapley.shapley` for the definitions and references. The mean
    errors are those that a source or group makes alone. Each figure has its standard error.

    Args:
        experiment: body, platform, trajectories, sources, estimators. Sources that are correlated count as one. With
            more than ten, Shapley shares come from random walks over the choices, whose scatter is in their errors.
        trials: pairs of trials, at least 4; a finding says so below 50, where two standard errors hold less often than
            95 times in a hundred.
        seed: seed of every draw.
        trajectories: name or names of the trajectories; None for all.
        estimators: name or names of the estimators; None for all.
        engine: ``"sums"``, or ``"samples"`` for every sample (:class:`uq.monte_carlo.campaign.campaign.SamplingPlan`).
        dtype: precision of samples that are drawn, ``"float64"`` or ``"float32"``.
        batch: pairs that one device computes at a time; None for what suits the engine.
        devices: devices to spread the pairs over; None for all.
        progress: called after each segment of pairs; True: a bar.

    Raises:
        ExperimentError: too few trials, no source, no such trajectory or estimator.
    """
    if trials < FEWEST_PAIRS:
        raise ExperimentError(f"{trials} pairs of trials for a budget: ask for {FEWEST_PAIRS} or more")
    if not any(source.drawn for source in experiment.sources):
        raise ExperimentError("no [[source]] in the experiment from which anything is drawn: add one")
    warnings = check_precision(dtype)
    dtype = "float32" if warnings else dtype
    chosen = experiment.selected_estimators(estimators)
    twins = twinned(experiment.sources, experiment.mixing)
    doubled = replace(experiment, sources=twins.doubled, mixing=twins.mixing)
    budgets: dict[str, dict[str, SourceBudget]] = {}
    tell = progress_of(progress, "pairs")
    for name, spec in experiment.selected_trajectories(trajectories).items():
        prepared, _ = prepare_engine(doubled, spec, chosen, cases=twins.cases, engine=engine, dtype=dtype)
        loop = prepared.loop(seed, devices=devices, batch=batch)
        loop.reach(trials, partial(tell, f"{name} budget"))
        errors = np.asarray(loop.results(trials)) - np.asarray(experiment.body.inertia)
        budgets[name] = {e.name: budget_of(twins, errors[:, k]) for k, e in enumerate(chosen)}
    record = provenance(**experiment.inputs(), seed=seed, trials=trials, engine=engine, dtype=dtype)
    return BudgetResult(
        trials=trials, seed=seed, choices=len(twins.design.choices), breakdowns=budgets, warnings=tuple(warnings),
        provenance=record,
    )  # fmt: skip


class Player(NamedTuple):
    """Sources that count together: a source, with those correlated with it, or a group."""

    name: str
    sources: frozenset[str]
    draws: int
    """Independent draws that belong to the player, as a subset's number; saturation and quantisation draw nothing."""


class Twinned(NamedTuple):
    """Every source twice, and the cases that a budget needs."""

    doubled: tuple[Source, ...]
    """The sources, then their twins."""
    mixing: tuple[Mixing, ...]
    cases: tuple[Case, ...]
    """Cases: no source, each group's player alone, each source's alone, then the choices between the two draws."""
    sources: tuple[Player, ...]
    groups: tuple[Player, ...]
    design: ChoiceDesign


def twinned(sources: Sequence[Source], mixing: Sequence[Mixing]) -> Twinned:
    """Return a twin of every source, and the cases that a budget needs.

    A choice has the sources of some draws from the first draws, which are those of the Monte Carlo's trials, and the
    twins of the others.
    """
    mark = "′"
    while any(s.name + mark in {other.name for other in sources} for s in sources):
        mark += "′"
    draws = _independent(sources, mixing)
    players = _players({s.name: s.name for s in sources}, draws)
    groups = _players({s.name: s.group for s in sources}, draws)
    design = ChoiceDesign.of(len(draws), [[p.draws for p in players], [p.draws for p in groups]])
    alone = [Case("none", frozenset()), *(Case(f"alone:{p.name}", p.sources) for p in (*groups, *players))]
    fixed = {source.name for source in sources if not source.drawn}

    def choice(w: int) -> Case:
        active = [n if w >> k & 1 else n + mark for k, names in enumerate(draws) for n in names]
        return Case(f"choice:{w}", frozenset([*fixed, *active]))

    return Twinned(
        doubled=(*sources, *(replace(s, name=s.name + mark) for s in sources)),
        mixing=(*mixing, *(replace(m, names=tuple(n + mark for n in m.names)) for m in mixing)),
        cases=(*alone, *map(choice, design.choices)), sources=players, groups=groups, design=design,
    )  # fmt: skip


def _independent(sources: Sequence[Source], mixing: Sequence[Mixing]) -> list[frozenset[str]]:
    """The sources that are drawn, each with those that are correlated with it."""
    joint = {name: frozenset(mix.names) for mix in mixing for name in mix.names}
    return list(dict.fromkeys(joint.get(s.name, frozenset([s.name])) for s in sources if s.drawn))


def _players(label: Mapping[str, str], draws: Sequence[frozenset[str]]) -> tuple[Player, ...]:
    """The sources of one label, joined with those of another where correlation joins them."""
    labels = dict.fromkeys(label.values())
    sets = [frozenset(name for name in label if label[name] == shared) for shared in labels]
    for names in draws:
        joined = frozenset().union(*(members for members in sets if members & names))
        sets = list(dict.fromkeys(joined if members & names else members for members in sets))
    players = []
    for names in sets:
        name = " + ".join(dict.fromkeys(label[name] for name in label if name in names))
        players.append(Player(name, names, sum(1 << k for k, correlated in enumerate(draws) if correlated <= names)))
    return tuple(players)


def budget_of(twins: Twinned, errors: np.ndarray) -> SourceBudget:
    """Return the budget that the errors of all cases give.

    Args:
        twins: the set-up whose cases they are.
        errors: estimate minus truth, (pairs, cases, 6) [kg·m²]; pairs with a NaN are left out.
    """
    good, failed = finite_trials(errors)
    size, g = len(twins.design.choices), len(twins.groups)
    none, alone, choices = good[:, 0], good[:, 1:-size], good[:, -size:]
    source_effects, group_effects = (twins.design.effects(choices, game) for game in (0, 1))
    ratio, ratio_error = closure(source_effects.variance, plain_variance(choices))
    return SourceBudget(
        sources=_effects(twins.sources, source_effects, alone[:, g:]),
        groups=_effects(twins.groups, group_effects, alone[:, :g]),
        without=none[0] if len(none) else np.full(len(ENTRIES), np.nan),
        mean_square=_mean_square(choices.mean(1), source_effects.variance),
        closure=ratio, closure_standard_error=ratio_error, failed=failed,
    )  # fmt: skip


def _effects(players: Sequence[Player], effects: PairEffects, alone: np.ndarray) -> Effects:
    first, total, shapley = effects.indices(ENTRIES)
    assert first is not None and total is not None and shapley is not None  # noqa: S101, PT018 - a design gives all
    statistics: Mapping[str, Statistics] = {p.name: Statistics.of(alone[:, i]) for i, p in enumerate(players)}
    return Effects(
        players=tuple(player.name for player in players), first=first, total=total, shapley=shapley, alone=statistics
    )


def _mean_square(error: np.ndarray, variance: np.ndarray) -> MeanSquare:
    """Bias and dispersion of all sources together, from each trial's mean over its choices and its variance."""
    # the sum of the variances of the tensor's nine entries does not depend on the body frame's axes
    bias, bias_error = mean(error)
    mean_variance, variance_error = mean(variance)
    component_shares = np.array([_bias_share(error[:, [k]], variance[:, [k]], np.ones(1)) for k in range(len(ENTRIES))])
    share, share_error = component_shares.T
    tensor_share, tensor_share_error = _bias_share(error, variance, ENTRIES)
    return MeanSquare(
        mean_error=bias, mean_error_standard_error=bias_error, variance=mean_variance,
        variance_standard_error=variance_error, bias_share=share, bias_share_standard_error=share_error,
        tensor_bias_share=tensor_share, tensor_bias_share_standard_error=tensor_share_error,
    )  # fmt: skip


def _bias_share(error: np.ndarray, variance: np.ndarray, weights: np.ndarray) -> tuple[float, float]:
    """Share of the squared mean error in the mean square, with its standard error.

    The square of a mean is unbiased by the mean's own variance taken off; its standard error holds near zero too, where
    the square is all noise: ``Var b̂² = 4 b² s² + 2 s⁴``.
    """
    n = len(error)
    if n < 2:
        return np.nan, np.nan
    bias, mean_variance = error.mean(0), variance.mean(0)
    covariance = np.cov(error, rowvar=False).reshape(len(weights), len(weights)) / n
    square = weights @ (bias**2 - np.diag(covariance))
    square_influence = 2 * (error - bias) @ (weights * bias)
    noise = 2 * np.sum(covariance**2 * np.outer(weights, weights))
    with np.errstate(invalid="ignore", divide="ignore"):
        mean_square = square + weights @ mean_variance
        share = square / mean_square
        influence = (1 - share) * square_influence - share * (variance - mean_variance) @ weights
        first_order = influence.var(ddof=1) / n
        beyond = (1 - share) ** 2 * max(-noise, noise - square_influence.var(ddof=1) / n)
    return float(share), float(np.sqrt(max(first_order + beyond, 0)) / mean_square)
