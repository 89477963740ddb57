"""The outcome of a campaign: its figures, findings and the content of result.json."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

import numpy as np

from identify.reporting import Result
from identify.rigid_body.inertia import COMPONENTS
from uq.campaign.result_coverage import coverage_record, stability_record
from uq.campaign.statistics import Breakdown, ByTrajectory, Statistics, large_mean_error
from uq.coverage.adaptive_procedure import Stability
from uq.coverage.coverage_intervals import CoverageInterval, Kind, shortest_interval, symmetric_interval
from uq.sources.quasi_random import Points

if TYPE_CHECKING:
    from xarray import DataArray


@dataclass(frozen=True, repr=False)
class MonteCarloResult(ByTrajectory[Breakdown[Statistics]], Result):
    """The outcome of a campaign. ``result["T1", "central"]`` is one :class:`Breakdown`.

    Example: ``montecarlo(Experiment.load("barreto2016"), trials=200).to_frame().loc[("T1", "central", "total")]``.
    """

    unit_of_columns = "kg·m²"

    kind = "inertia montecarlo"
    trials: int
    seed: int
    nominal: np.ndarray
    """The true tensor, packed [kg·m²]."""
    breakdowns: Mapping[str, Mapping[str, Breakdown[Statistics]]]
    """Breakdown of each case, by trajectory, then by estimator."""
    warnings: tuple[str, ...]
    provenance: Mapping[str, Any]
    errors: Mapping[str, np.ndarray] = field(compare=False)
    """Estimate minus truth of every trial, by trajectory: (trials, estimators, cases, 6) [kg·m²]."""
    stability: Mapping[str, Mapping[str, Stability]] | None = field(default=None, compare=False)
    """Stability that an adaptive campaign reached [kg·m²], by trajectory and estimator; None: the number of trials was
    given."""
    points: Points = "random"
    """Kind of points that the trials were drawn from: random or quasi-random."""

    def total_errors(self, trajectory: str, estimator: str) -> np.ndarray:
        """Return estimate minus truth of every trial with all sources together, (trials, 6) [kg·m²]."""
        self.checked((trajectory, estimator))
        index = list(self.breakdowns[trajectory]).index(estimator)
        return self.errors[trajectory][:, index, 0]

    def interval(
        self, trajectory: str, estimator: str, probability: float = 0.95, kind: Kind = "symmetric"
    ) -> CoverageInterval:
        """Return the coverage intervals of the six components' errors, all sources together [kg·m²]."""
        coverage_interval = symmetric_interval if kind == "symmetric" else shortest_interval
        return coverage_interval(self.total_errors(trajectory, estimator), probability, self.points)

    def to_dict(self) -> dict[str, Any]:
        """Return the content of result.json, in g·m²."""
        return {
            **self.form(),
            "trials": self.trials,
            "seed": self.seed,
            "unit": "g*m^2",
            "adaptive": stability_record(self.stability),
            "trajectories": {
                trajectory: {
                    estimator: {
                        **breakdown.to_dict(),
                        "failed_trials": breakdown.failed,
                        "coverage": coverage_record(self.total_errors(trajectory, estimator), self.points),
                    }
                    for estimator, breakdown in breakdowns.items()
                }
                for trajectory, breakdowns in self.breakdowns.items()
            },
            "warnings": self.findings(),
            "provenance": dict(self.provenance),
        }

    def findings(self) -> list[str]:
        """Return what a reader must not miss: warnings, failed trials, mean errors larger than their 3σ."""
        findings = list(self.warnings)
        for trajectory, estimator in self.pairs():
            breakdown = self[trajectory, estimator]
            if breakdown.failed:
                findings.append(
                    f"{trajectory}, {estimator}: {breakdown.failed} of {self.trials} trials failed and are left out."
                )
            findings += large_mean_error(f"{trajectory}, {estimator}", breakdown.total)
        return findings

    def to_xarray(self) -> "DataArray":
        """Return estimate minus truth of every trial [kg·m²], (trajectory, trial, estimator, case, component).

        A case is ``total``, a group alone or a source alone; the coordinate ``true_tensor`` is the truth by component.
        A trial that could not be solved is NaN.

        Raises:
            ModuleNotFoundError: xarray is not installed.
        """
        try:
            from xarray import DataArray
        except ImportError:
            raise ModuleNotFoundError("xarray is missing for to_xarray(): pip install xarray") from None
        first = next(iter(self.breakdowns.values()))
        names: dict[str, Any] = {
            "trajectory": list(self.breakdowns), "trial": np.arange(self.trials), "estimator": list(first),
            "case": list(next(iter(first.values())).cases), "component": list(COMPONENTS),
        }  # fmt: skip
        samples = np.stack([self.errors[name] for name in self.breakdowns])
        about = {"units": "kg m2", "long_name": "estimate minus truth", "seed": self.seed, "points": self.points}
        truth = {"true_tensor": ("component", self.nominal)}
        return DataArray(samples, names | truth, tuple(names), "error", about)
