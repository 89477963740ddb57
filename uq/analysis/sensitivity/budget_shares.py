"""The budget of one estimator on one trajectory: shares of the variance, mean errors, the split of the mean square.

Budgets of an experiment together give CSV and JSON.
"""

import csv
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from io import StringIO
from typing import Any, NamedTuple

import numpy as np

from identify.display.reporting import Result, Shown, plain
from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE
from uq.analysis.sensitivity.variance_shares import Indices
from uq.monte_carlo.campaign.statistics import ByTrajectory, Statistics

TENSOR = "tensor"
"""Name of the whole tensor among the components."""
COLUMNS = (*COMPONENTS, TENSOR)
FEWEST_PAIRS, FEW_PAIRS = 4, 50
"""Pairs of trials below which there are no standard errors, and below which a finding calls them too small: two of them
hold the share 92 times in a hundred of 50 pairs, 87 of 10, 84 of 4."""
CLOSURE_LIMIT = 4
"""Standard errors beyond which a budget's closure is reported as off."""


class Effects(NamedTuple):
    """Effects of each player (a source or a group) on each component and on the whole tensor."""

    players: tuple[str, ...]
    first: Indices
    """Share of the variance that the player causes by itself, ``Var E[I | X_p] / Var I``."""
    total: Indices
    """Share of the variance that the player causes with its interactions, ``E Var[I | all but X_p] / Var I``."""
    shapley: Indices
    """Shapley effect of the player: interactions are divided in equal parts, and the shares add up to one."""
    alone: Mapping[str, Statistics]
    """Mean error and 3σ with the others off, by player."""


class MeanSquare(NamedTuple):
    """All sources together: how much of the mean squared error is bias and how much dispersion."""

    mean_error: np.ndarray
    """Mean error by component [kg·m²]."""
    mean_error_standard_error: np.ndarray
    variance: np.ndarray
    """Variance by component [(kg·m²)²]."""
    variance_standard_error: np.ndarray
    bias_share: np.ndarray
    """Square of the mean error over the mean squared error, by component; the rest is dispersion."""
    bias_share_standard_error: np.ndarray
    tensor_bias_share: float
    """Square of the mean error over the mean squared error, for the whole tensor."""
    tensor_bias_share_standard_error: float

    @property
    def three_sigma(self) -> np.ndarray:
        """Three standard deviations by component [kg·m²]."""
        return 3 * np.sqrt(self.variance)

    @property
    def three_sigma_standard_error(self) -> np.ndarray:
        """Standard error of ``three_sigma`` [kg·m²]."""
        with np.errstate(invalid="ignore", divide="ignore"):
            return np.where(self.variance > 0, 1.5 * self.variance_standard_error / np.sqrt(self.variance), 0.0)


@dataclass(frozen=True, repr=False)
class SourceBudget(Shown):
    """The budget of one estimator on one trajectory."""

    sources: Effects
    groups: Effects
    without: np.ndarray
    """The estimator's error with all sources off, by component [kg·m²]."""
    mean_square: MeanSquare
    closure: np.ndarray
    """Variance that the Shapley effects share out over the ordinary sample variance of the estimates, by component."""
    closure_standard_error: np.ndarray
    """Standard error of a closure of one: its distance from one by chance alone."""
    failed: int
    """Pairs of trials in which some case could not be solved; they are left out."""

    @property
    def culprit(self) -> str:
        """The source with the largest Shapley share of the whole tensor."""
        return self.sources.players[int(np.nanargmax(np.nan_to_num(self.sources.shapley.generalised, nan=-1)))]

    @property
    def closes(self) -> bool:
        """Whether the closure is one within :data:`CLOSURE_LIMIT` standard errors on every component."""
        return not bool((np.abs(self.closure - 1) > CLOSURE_LIMIT * self.closure_standard_error).any())

    def values(self) -> Iterator[tuple[str, str, str, str, float, float, str]]:
        """Yield kind of player, player, component, quantity, value, standard error and unit of every figure."""
        for kind, effects in (("source", self.sources), ("group", self.groups)):
            for quantity in ("first", "total", "shapley"):
                indices = getattr(effects, quantity)
                values = np.column_stack([indices.value, indices.generalised])
                errors = np.column_stack([indices.standard_error, indices.generalised_standard_error])
                for p, name in enumerate(effects.players):
                    for column, value, error in zip(COLUMNS, values[p], errors[p], strict=True):
                        yield kind, name, column, quantity, value, error, "1"
            for name, s in effects.alone.items():
                for quantity in ("mean_error", "three_sigma"):
                    values, errors = (GRAM_METRE * getattr(s, quantity + end) for end in ("", "_standard_error"))
                    for column, value, error in zip(COMPONENTS, values, errors, strict=True):
                        yield kind, name, column, f"{quantity}_alone", value, error, "g*m^2"
        yield from self._of_all()

    def _of_all(self) -> Iterator[tuple[str, str, str, str, float, float, str]]:
        m, square = self.mean_square, GRAM_METRE**2
        for k, column in enumerate(COMPONENTS):
            mean = GRAM_METRE * m.mean_error[k], GRAM_METRE * m.mean_error_standard_error[k]
            yield "all", "all", column, "mean_error", *mean, "g*m^2"
            variance = square * m.variance[k], square * m.variance_standard_error[k]
            yield "all", "all", column, "variance", *variance, "(g*m^2)^2"
            yield "all", "all", column, "bias_share", m.bias_share[k], m.bias_share_standard_error[k], "1"
            yield "all", "all", column, "closure", self.closure[k], self.closure_standard_error[k], "1"
        yield "all", "all", TENSOR, "bias_share", m.tensor_bias_share, m.tensor_bias_share_standard_error, "1"


@dataclass(frozen=True, repr=False)
class BudgetResult(ByTrajectory[SourceBudget], Result):
    """Budgets of an experiment. ``result["T1", "central"]`` is one :class:`SourceBudget`.

    Example: ``budget(Experiment.load("barreto2016"), trials=100).to_frame().loc[("T1", "central", "source", "r_cg")]``.
    """

    name = "budget"
    """Stem of the names of the result's files, and its key in the result.json of a campaign."""
    trials: int
    """Number of pairs of trials."""
    seed: int
    choices: int
    """Number of choices between the two draws for which each pair is solved."""
    breakdowns: Mapping[str, Mapping[str, SourceBudget]]
    """Budget of each case, by trajectory, then by estimator."""
    warnings: tuple[str, ...]
    provenance: Mapping[str, Any]

    def records(self) -> list[dict[str, Any]]:
        """Return every figure as a record with its unit; a value that does not exist is None."""
        return [
            {
                "trajectory": trajectory, "estimator": estimator, "of": kind, "name": name, "component": component,
                "quantity": quantity, "value": plain(float(value)), "standard_error": plain(float(error)), "unit": unit,
            }
            for trajectory, estimator in self.pairs()
            for kind, name, component, quantity, value, error, unit in self[trajectory, estimator].values()
        ]  # fmt: skip

    def to_dict(self) -> dict[str, Any]:
        """Return the budget's part of result.json."""
        return {
            "trials": self.trials,
            "seed": self.seed,
            "choices": self.choices,
            "figures": self.records(),
            "failed_trials": {f"{t}, {e}": self[t, e].failed for t, e in self.pairs()},
            "warnings": list(self.warnings),
            "provenance": dict(self.provenance),
        }

    def csv(self) -> str:
        """Return every figure as CSV: one per line, with its standard error and unit."""
        text, records = StringIO(), self.records()
        writer = csv.DictWriter(text, list(records[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(records)
        return text.getvalue()

    def files(self) -> dict[str, bytes]:
        """Return budget.csv."""
        return {f"{self.name}.csv": self.csv().encode()}
