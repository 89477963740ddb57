"""A budget's results: shares, mean errors, the split of the mean square; as CSV and JSON."""

import csv
from collections.abc import Mapping
from dataclasses import dataclass
from io import StringIO
from typing import Any

from identify.reporting import Result, plain
from uq.campaign.statistics import ByTrajectory
from uq.sensitivity.budget_shares import SourceBudget


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
        """Return every figure as CSV: one a line, with its standard error and unit."""
        text, records = StringIO(), self.records()
        writer = csv.DictWriter(text, list(records[0]), lineterminator="\n")
        writer.writeheader()
        writer.writerows(records)
        return text.getvalue()

    def files(self) -> dict[str, bytes]:
        """Return budget.csv."""
        return {f"{self.name}.csv": self.csv().encode()}
