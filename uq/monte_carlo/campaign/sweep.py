"""Campaigns over values of numbers of an experiment, from the same draws.

A number in an experiment is no constant of the compiled trials: where the shapes stay, as for a sigma, a gain or a
moment of the body, the first campaign compiles for all. Each has the draws of the same seed, so that differences
between values are far sharper than the values themselves.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product
from typing import TYPE_CHECKING, Any

import numpy as np

from identify.display.reporting import Result, plain
from identify.exceptions import UnknownNameError, explains_names
from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE
from rig.exceptions import choose, quoted
from uq.experiment.experiment import Experiment, ExperimentError
from uq.files.provenance import provenance
from uq.monte_carlo.campaign.campaign import RunOptions, SamplingPlan, montecarlo
from uq.monte_carlo.campaign.campaign_result import MonteCarloResult
from uq.monte_carlo.campaign.spread_ratio import SpreadComparison, compared
from uq.progress_bar import Progress, progress_of

if TYPE_CHECKING:
    from xarray import Dataset

FIGURES = ("mean_error", "mean_error_standard_error", "three_sigma", "three_sigma_standard_error")
TABLES = ("source", "trajectory", "estimator", "body")


@dataclass(frozen=True, repr=False)
class SweepResult(Result):
    """Campaigns over values of numbers of an experiment. ``result["0.2 N*m"]`` is the campaign of a value.

    Example: ``sweep(experiment, {"body.mass": ["10 kg", "20 kg"]}, trials=200).to_xarray().three_sigma``.
    """

    unit_of_columns = "kg·m²"
    kind = "inertia sweep"

    values: Mapping[str, tuple[str, ...]]
    """Values of each key, as they were written."""
    campaigns: Mapping[tuple[str, ...], MonteCarloResult]
    """Campaign of each combination of values, in the order of the keys."""
    provenance: Mapping[str, Any]
    warnings: tuple[str, ...] = ()

    def __getitem__(self, value: str | tuple[str, ...]) -> MonteCarloResult:
        """Return the campaign of a value, or of a value of each key."""
        key = value if isinstance(value, tuple) else (value,)
        if key not in self.campaigns:
            raise UnknownNameError(value, [x[0] if len(x) == 1 else x for x in self.campaigns])
        return self.campaigns[key]

    def against(self, value: str | tuple[str, ...]) -> SpreadComparison:
        """Return 3σ at every other value over that at one, of each trajectory and estimator, from the same draws.

        Args:
            value: as it was written; of several keys, the value of each.

        Raises:
            KeyError: no campaign has it; the message names those that there are.
        """
        self[value]
        key = value if isinstance(value, tuple) else (value,)
        campaigns = self.campaigns.items()
        cases = {(*k, *pair): campaign.total_errors(*pair) for k, campaign in campaigns for pair in campaign.pairs()}
        others = {(*k, *pair): (*key, *pair) for k, campaign in campaigns for pair in campaign.pairs() if k != key}
        points = next(iter(self.campaigns.values())).points
        return compared(cases, others, (*self.values, "trajectory", "estimator"), ", ".join(key), points)

    def records(self) -> list[dict[str, Any]]:
        """Return mean error, 3σ and their standard errors [kg·m²] of each case and component, by value."""
        return [
            dict(zip(self.values, key, strict=True)) | record
            for key, campaign in self.campaigns.items()
            for record in campaign.records()
        ]

    def figures_of(self, trajectory: str, estimator: str, case: str = "total") -> dict[str, np.ndarray]:
        """Return the four figures of a case at every value, each (values of each key …, 6) [kg·m²]."""
        shape = (*map(len, self.values.values()), len(COMPONENTS))
        cases = [campaign[trajectory, estimator].cases[case] for campaign in self.campaigns.values()]
        return {name: np.reshape([getattr(x, name) for x in cases], shape) for name in FIGURES}

    def to_xarray(self) -> "Dataset":
        """Return the four figures [kg·m²], each by value, trajectory, estimator, case and component.

        Raises:
            ModuleNotFoundError: xarray is not installed.
        """
        try:
            from xarray import Dataset
        except ImportError:
            raise ModuleNotFoundError("xarray is missing for to_xarray(): pip install xarray") from None
        first = next(iter(self.campaigns.values()))
        trajectories, estimators = list(first.breakdowns), list(next(iter(first.breakdowns.values())))
        cases = list(first[trajectories[0], estimators[0]].cases)
        by_case = [[[self.figures_of(t, e, case) for case in cases] for e in estimators] for t in trajectories]
        dims = [*self.values, "trajectory", "estimator", "case", "component"]
        count = len(self.values)

        def stacked(name: str) -> np.ndarray:
            array = np.array([[[figures[name] for figures in e] for e in t] for t in by_case])
            return np.moveaxis(array, range(3), range(count, count + 3))

        names = {"trajectory": trajectories, "estimator": estimators, "case": cases, "component": list(COMPONENTS)}
        data = {name: (dims, stacked(name), {"units": "kg m2"}) for name in FIGURES}
        return Dataset(data, coords={**{key: list(x) for key, x in self.values.items()}, **names})

    def to_dict(self) -> dict[str, Any]:
        """Return the content of sweep.json, in g·m²."""
        rows = [
            {name: GRAM_METRE * x if name in FIGURES and x is not None else x for name, x in record.items()}
            for record in self.records()
        ]
        about = {"values": plain(self.values), "unit": "g*m^2", "rows": rows, "warnings": list(self.warnings)}
        return {**self.form(), **about, "provenance": dict(self.provenance)}


@explains_names
def sweep(
    experiment: Experiment,
    values: Mapping[str, Sequence[Any]],
    *,
    trials: int | None = None,
    seed: int = 0,
    trajectories: str | Sequence[str] | None = None,
    estimators: str | Sequence[str] | None = None,
    plan: SamplingPlan = SamplingPlan(),  # noqa: B008 - frozen
    options: RunOptions = RunOptions(),  # noqa: B008 - frozen
) -> SweepResult:
    """Run a campaign at every value of some numbers of an experiment, from the same draws.

    Example: ``sweep(experiment, {"source.M_precision.sigma": ["0.2 N*m", "0.4 N*m", "0.8 N*m"]})``.

    Args:
        experiment: body, platform, trajectories, sources, estimators.
        values: by key, ``source.NAME.KEY``, ``trajectory.NAME.KEY``, ``estimator.NAME.KEY`` or ``body.KEY``, written as
            in an experiment file; of several keys, every combination.
        trials: of each campaign; this and all others as for :func:`montecarlo`.
        seed: seed of every draw.
        trajectories: name or names of the trajectories; None for all.
        estimators: name or names of the estimators; None for all.
        plan: how the trials are drawn.
        options: where and how they are run; without a checkpoint.

    Raises:
        ExperimentError: no values, an unknown key, a value that cannot be, or what :func:`montecarlo` refuses.
    """
    if not values or not all(len(x) for x in values.values()):
        raise ExperimentError("no values to sweep: give a key and its values")
    if options.checkpoint is not None:
        raise ExperimentError("a sweep keeps no checkpoint: give each campaign its own")
    written = {key: tuple(map(_written, x)) for key, x in values.items()}
    changed = {}
    for combination in product(*(zip(written[key], x, strict=True) for key, x in values.items())):
        varied = experiment
        for key, (_, value) in zip(values, combination, strict=True):
            varied = with_value(varied, key, value)
        changed[tuple(text for text, _ in combination)] = varied
    campaigns = {
        key: montecarlo(
            varied, trials=trials, seed=seed, trajectories=trajectories, estimators=estimators, plan=plan,
            options=replace(options, progress=_named(options, ", ".join(key))),
        )
        for key, varied in changed.items()
    }  # fmt: skip
    warnings = dict.fromkeys(text for campaign in campaigns.values() for text in campaign.warnings)
    first = next(iter(campaigns.values()))
    record = provenance(**experiment.inputs(), trials=first.trials, seed=seed, sweep=plain(written))
    return SweepResult(values=written, campaigns=campaigns, provenance=record, warnings=tuple(warnings))


def with_value(experiment: Experiment, key: str, value: Any) -> Experiment:
    """Return the experiment with another value of a key such as ``source.M_bias.sigma`` or ``body.inertia.I33``.

    Raises:
        ExperimentError: there is no such key, or the value cannot be.
    """
    table, *path = key.split(".")
    if table not in TABLES or len(path) < 1 + (table != "body"):
        forms = ["source.NAME.KEY", "trajectory.NAME.KEY", "estimator.NAME.KEY", "body.KEY"]
        raise ExperimentError(f"unknown key {quoted(key)}: {choose(key, forms)}")
    if table == "body":
        below = experiment.document.get("body", {})
        for name in reversed(path[1:]):
            value = {**below.get(path[0], {}), name: value}
        return experiment.with_body(**{path[0]: value})
    change = {"source": experiment.with_source, "trajectory": experiment.with_trajectory,
              "estimator": experiment.with_estimator}[table]  # fmt: skip
    return change(path[0], **{".".join(path[1:]): value})


def _written(value: Any) -> str:
    return ", ".join(map(str, value)) if isinstance(value, list | tuple) else str(value)


def _named(options: RunOptions, text: str) -> Progress:
    """The progress of the options, with the values before the trajectory's name."""
    progress = progress_of(options.progress)
    return lambda name, *trials: progress(f"{text} {name}", *trials)
