"""The experiment's budget: which error source causes how much of the tensor's uncertainty, and which the mean error.

Every source is drawn twice, under its own name and under a twin's, and each pair of trials is solved with every choice
of one or the other. Two choices that differ by swapping some sources say what variance these sources cause
(:mod:`uq.subsets`); as the sources' draws are shared by all choices, only the gyro's cost anything, twice. The engine
of the Monte Carlo does it all: the sources, and the cases in which they act, are its inputs.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import jax
import numpy as np

from identify.precision import check_precision
from uq.budget_result import BudgetResult, Effects, MeanSquare, SourceBudget
from uq.campaign import Progress, Statistics, prepare_setup, run_trials
from uq.experiment import Experiment, ExperimentError
from uq.indices import mean, plain_variance, ratio, shares
from uq.provenance import provenance
from uq.sources import Source
from uq.subsets import MOST_PLAYERS, effects_of_swaps, walsh
from uq.trial import Case, Setup, cases_of

WEIGHTS = np.array([1.0, 2.0, 2.0, 1.0, 2.0, 1.0])
"""How often each packed component stands in the tensor: the sum of the variances of its nine entries, the trace of
their covariance, does not hang on the body frame's axes."""


def budget(
    experiment: Experiment,
    *,
    trials: int = 1000,
    seed: int = 0,
    trajectories: str | Sequence[str] | None = None,
    estimators: str | Sequence[str] | None = None,
    dtype: str = "float64",
    batch: int | None = None,
    devices: Sequence[jax.Device] | None = None,
    progress: Progress | None = None,
) -> BudgetResult:
    """Return who causes what: first-order, total and Shapley shares of every source and group, and its mean error.

    Shares are of the variance of each component, and of the whole tensor (the trace of the covariance of its nine
    entries); see :func:`uq.sensitivity.shapley` for the definitions and references. The mean errors are those that a
    source or group makes alone. Each figure has its standard error.

    Args:
        experiment: body, platform, trajectories, sources, estimators; at most ten sources.
        trials: pairs of trials, at least 2.
        seed: seed of every draw.
        trajectories: name or names of the trajectories; None for all.
        estimators: name or names of the estimators; None for all.
        dtype: precision of the draws and features, ``"float64"`` or ``"float32"``.
        batch: pairs that one device computes at a time; None for 1 on a CPU, 64 elsewhere.
        devices: devices to spread the pairs over; None for all.
        progress: called after each stretch of pairs.

    Raises:
        ExperimentError: too few trials, no source or too many, no such trajectory or estimator.
    """
    if trials < 2:
        raise ExperimentError(f"{trials} trials of a budget: ask for two or more")
    if not 0 < len(experiment.sources) <= MOST_PLAYERS:
        raise ExperimentError(
            f"{len(experiment.sources)} error sources in the experiment: a budget takes one to {MOST_PLAYERS}"
        )
    warned = check_precision(dtype)
    dtype = "float32" if warned else dtype
    devices = list(devices or jax.devices())
    batch = batch or (1 if devices[0].platform == "cpu" else 64)
    chosen = [experiment.estimator(name) for name in _names(estimators)] or list(experiment.estimators)
    if not chosen:
        raise ExperimentError("no [[estimator]] in the experiment: add one")
    budgets: dict[str, dict[str, SourceBudget]] = {}
    for name in _names(trajectories) or list(experiment.trajectories) or [experiment.select()[0]]:
        name, spec = experiment.select(name)
        setup = twinned(prepare_setup(experiment, spec, chosen, dtype=dtype))
        report = None if progress is None else lambda done, asked, name=name: progress(f"{name} budget", done, asked)
        estimates = run_trials(setup, trials, seed, devices, batch, report)
        errors = np.asarray(estimates.inertia) - np.asarray(experiment.body.inertia)
        budgets[name] = {e.name: budget_of(experiment.sources, errors[:, k]) for k, e in enumerate(chosen)}
    record = provenance(**experiment.inputs(), seed=seed, trials=trials, dtype=dtype, batch=batch)
    return BudgetResult(trials, seed, budgets, tuple(warned), record)


def _names(given: str | Sequence[str] | None) -> list[str]:
    """Names without repeats."""
    return list(dict.fromkeys([given] if isinstance(given, str) else given or []))


def twinned(setup: Setup) -> Setup:
    """Return the set-up with every source twice: cases of none, each group and each source alone, then every choice.

    The last 2^d cases choose a source or its twin: case ``w`` of them has the sources ``w`` from the first draws and
    the twins of the others. The first draws are those of the Monte Carlo's trials.
    """
    names = [source.name for source in setup.sources]
    mark = "′"
    while any(name + mark in names for name in names):
        mark += "′"
    twins = tuple(replace(source, name=source.name + mark) for source in setup.sources)
    choices = tuple(
        Case(f"choice:{w}", frozenset(name if w >> k & 1 else name + mark for k, name in enumerate(names)))
        for w in range(2 ** len(names))
    )
    alone = (Case("none", frozenset()), *cases_of(setup.sources)[1:])
    return replace(setup, sources=(*setup.sources, *twins), cases=(*alone, *choices))


class _Player(NamedTuple):
    """Sources that count together."""

    name: str
    sources: int
    """Which, as a subset's number."""


def budget_of(sources: Sequence[Source], errors: np.ndarray) -> SourceBudget:
    """Return the budget that errors of all cases of :func:`twinned` give.

    Args:
        sources: the experiment's.
        errors: estimate minus truth, (trials, cases, 6) [kg·m²]; trials with a NaN are left out.
    """
    d = len(sources)
    good = errors[np.isfinite(errors).all(axis=(1, 2))]
    none, alone, choices = good[:, 0], good[:, 1 : -(2**d)], good[:, -(2**d) :]
    groups = dict.fromkeys(source.group for source in sources)
    of_groups = [_Player(g, sum(1 << k for k, s in enumerate(sources) if s.group == g)) for g in groups]
    of_sources = [_Player(source.name, 1 << k) for k, source in enumerate(sources)]
    squares = (walsh(d) @ choices) ** 2
    variance = (effects_of_swaps([], d) @ squares)[:, 0]
    return SourceBudget(
        _effects(of_sources, squares, variance, alone[:, len(groups) :]),
        _effects(of_groups, squares, variance, alone[:, : len(groups)]),
        none[0] if len(none) else np.full(len(WEIGHTS), np.nan),
        _mean_square(choices.mean(1), variance),
        *ratio(variance, plain_variance(choices)),
        len(errors) - len(good),
    )


def _effects(players: Sequence[_Player], squares: np.ndarray, variance: np.ndarray, alone: np.ndarray) -> Effects:
    k, d = len(players), squares.shape[1].bit_length() - 1
    effects = effects_of_swaps([player.sources for player in players], d) @ squares
    first, total, shapley = (shares(effects[:, i * k : (i + 1) * k], variance, WEIGHTS) for i in range(3))
    statistics: Mapping[str, Statistics] = {p.name: Statistics.of(alone[:, i]) for i, p in enumerate(players)}
    return Effects(tuple(player.name for player in players), first, total, shapley, statistics)


def _mean_square(error: np.ndarray, variance: np.ndarray) -> MeanSquare:
    """Bias and dispersion of all sources together, from each trial's mean over its choices and its variance."""
    bias, bias_error = mean(error)
    of_variance, of_variance_error = mean(variance)
    each = np.array([_bias_share(error[:, [k]], variance[:, [k]], np.ones(1)) for k in range(len(WEIGHTS))])
    share, share_error = each.T
    whole, whole_error = _bias_share(error, variance, WEIGHTS)
    return MeanSquare(
        bias, bias_error, of_variance, of_variance_error, share, share_error, whole, whole_error
    )  # fmt: skip


def _bias_share(error: np.ndarray, variance: np.ndarray, weights: np.ndarray) -> tuple[float, float]:
    """Share of the squared mean error in the mean square, with its standard error.

    The square of a mean is unbiased by the mean's own variance taken off; its standard error holds near zero too, where
    the square is all noise: ``Var b̂² = 4 b² s² + 2 s⁴``.
    """
    n = len(error)
    if n < 2:
        return np.nan, np.nan
    bias, of_variance = error.mean(0), variance.mean(0)
    covariance = np.cov(error, rowvar=False).reshape(len(weights), len(weights)) / n
    square = weights @ (bias**2 - np.diag(covariance))
    of_square = 2 * (error - bias) @ (weights * bias)
    noise = 2 * np.sum(covariance**2 * np.outer(weights, weights))
    with np.errstate(invalid="ignore", divide="ignore"):
        whole = square + weights @ of_variance
        share = square / whole
        influence = (1 - share) * of_square - share * (variance - of_variance) @ weights
        of_first_order = influence.var(ddof=1) / n
        beyond = (1 - share) ** 2 * max(-noise, noise - of_square.var(ddof=1) / n)
    return float(share), float(np.sqrt(max(of_first_order + beyond, 0)) / whole)
