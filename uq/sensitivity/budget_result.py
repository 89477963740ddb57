"""A budget's results: shares, mean errors, the split of the mean square; as tables, figures, CSV and JSON."""

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from io import StringIO
from typing import TYPE_CHECKING, Any

from identify.reporting import Drawing, Result, Section, plain, stem
from identify.text_tables import Table
from uq.campaign.by_trajectory import ByTrajectory
from uq.report.assumptions import source_assumptions
from uq.report.input_tables import source_tables
from uq.sensitivity.budget_shares import FEW_PAIRS, SourceBudget

if TYPE_CHECKING:
    from matplotlib.figure import FigureBase


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
    budgets: Mapping[str, Mapping[str, SourceBudget]]
    """Budget of each case, by trajectory, then by estimator."""
    warnings: tuple[str, ...]
    provenance: Mapping[str, Any]

    @property
    def by_trajectory(self) -> Mapping[str, Mapping[str, SourceBudget]]:
        """Budget of each case, by trajectory, then by estimator."""
        return self.budgets

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
        """Return every figure as CSV: one a line, with its standard error and unit."""
        text, records = StringIO(), self.records()
        writer = csv.DictWriter(text, list(records[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(records)
        return text.getvalue()

    def files(self) -> dict[str, bytes]:
        """Return budget.csv."""
        return {f"{self.name}.csv": self.csv().encode()}

    def verdicts(self) -> list[str]:
        """Return the culprit of each budget, and how much of its error is bias, in a sentence each."""
        return [f"{', '.join(pair)}: {self[pair].verdict}" for pair in self.pairs()]

    def findings(self) -> list[str]:
        """Return what a reader must not miss: warnings, failed trials, shares that do not add up."""
        findings = list(self.warnings)
        if self.trials < FEW_PAIRS:
            findings.append(
                f"{self.trials} pairs of trials are few: the standard errors of the shares come out too small; take "
                f"{FEW_PAIRS} or more."
            )
        for pair in self.pairs():
            if self[pair].failed:
                findings.append(
                    f"{', '.join(pair)}: {self[pair].failed} of {self.trials} pairs of trials failed and are left out."
                )
            if not self[pair].closes:
                findings.append(
                    f"{', '.join(pair)}: the shares do not add up to the sample variance: take more trials."
                )
        return findings

    def title(self) -> str:
        """Return what the tables are of."""
        return f"Budget, {self.trials:,} pairs of trials × {self.choices} choices of draws, seed {self.seed}"

    def tables(self) -> list[Table]:
        """Return each budget's shares of the whole tensor's variance."""
        return [
            Table(f"{', '.join(pair)}: shares of the tensor's variance", *self[pair].tensor_rows())
            for pair in self.pairs()
        ]

    def overview(self) -> list[Table]:
        """Return each budget's shares of the tensor and of the components, and its mean errors."""
        return [
            Table("" if k else ", ".join(pair), *rows)
            for pair in self.pairs()
            for k, rows in enumerate((self[pair].tensor_rows(), self[pair].component_rows(), self[pair].mean_rows()))
        ]

    def details(self) -> list[Table]:
        """Return each budget's shares by component and mean errors, and the sources as declared."""
        tables = [
            Table(f"{', '.join(pair)}: {title}", *rows)
            for pair in self.pairs()
            for title, rows in [
                *(("shares by component", self[pair].component_rows(kind)) for kind in ("shapley", "first", "total")),
                ("mean errors", self[pair].mean_rows()),
            ]
        ]
        return [*tables, *source_tables(self.provenance)]

    def notes(self) -> list[str]:
        """Return verdicts and findings, a line each."""
        return [*self.verdicts(), *(f"attention: {text}" for text in self.findings())]

    def drawings(self) -> list[Drawing]:
        """Return the whole tensor of every pair, then each budget by component."""

        def overview() -> "FigureBase":
            from uq.sensitivity.budget_figures import overview

            return overview({pair: self[pair] for pair in self.pairs()})

        caption = "The whole tensor: Shapley shares of its variance, and how much of its mean squared error is bias."
        return [Drawing("budget", caption, overview), *map(self._shares, self.pairs())]

    def _shares(self, pair: tuple[str, str]) -> Drawing:
        def draw() -> "FigureBase":
            from uq.sensitivity.budget_figures import shares

            return shares(self[pair])

        each = "Shapley shares by component and of the tensor, and bias and dispersion in the mean square."
        return Drawing(stem("budget", *pair), f"{', '.join(pair)}: {each}", draw)

    def section(self) -> Section:
        """Return its part of a report."""
        return Section(
            title="Budget of an inertia tensor's uncertainty",
            computed=[f"{self.trials:,} pairs of trials with seed {self.seed}. {COMPUTED}", " ".join(self.verdicts())],
            findings=self.findings(),
            tables=self.tables(),
            drawings=self.drawings(),
            details=self.details(),
            assumptions=[ASSUMPTION, *source_assumptions(self.provenance)],
            provenance=self.provenance,
        )


COMPUTED = (
    "In each pair every source is drawn twice, and the tensor is estimated for every choice of one draw or the other. "
    "First order: the share of the variance that a source causes by itself; total: with its interactions; Shapley: "
    "interactions shared in equal parts, so that the shares add up to one. The tensor's variance is the sum over its "
    "nine entries. Closure: what the shares add up to over the ordinary sample variance. The figure after ± is a "
    "standard error. Every figure is in budget.csv."
)
ASSUMPTION = (
    "Shares are of the variance, the dispersion about the mean; the mean error (bias) of a source alone stands in a "
    "table of its own, since biases of several sources need not add up."
)
