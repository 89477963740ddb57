"""The paper's simulated experiment beside its printed values (Table 2, section 4)."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from identify.display.reporting import Result
from identify.exceptions import explains_names
from identify.rigid_body.inertia import GRAM_METRE, MOMENTS, PRODUCTS
from uq.experiment.experiment import Experiment
from uq.monte_carlo.campaign.campaign import RunOptions, SamplingPlan, montecarlo
from uq.monte_carlo.campaign.campaign_result import MonteCarloResult
from uq.monte_carlo.campaign.statistics import Statistics

TRAJECTORIES = ("T1", "T2", "T3", "T4")

PRINTED: Mapping[str, Mapping[str, float]] = {
    "3σ moments": {"T1": 2.82, "T2": 3.15, "T3": 4.78, "T4": 4.99},
    "% of nominal": {"T1": 5.13, "T2": 6.15, "T3": 10.3, "T4": 10.9},
    "moments against T4 %": {"T1": -43.5, "T2": -36.9, "T3": -4.21},
    "3σ products": {"T1": 1.86, "T2": 1.97, "T3": 3.41, "T4": 3.47},
    "products against T4 %": {"T1": -46.4, "T2": -43.2, "T3": -1.73},
}
"""The paper's Table 2, in g·m² and per cent."""

SOURCE_ESTIMATOR = "central"
"""The preset's estimator that differentiates as the paper does, by central differences."""

PRINTED_SHARES: Mapping[str, float] = {"load_cell": 97.0, "cg": 20.0, "imu": 6.0}
"""Effect of each group alone on T1, per cent of the total 3σ, averaged over the six components."""

PRINTED_EFFECTS: Mapping[str, tuple[str, str, str, float]] = {
    "load cell, T1 against T3 %": ("load_cell", "T1", "T3", -45.0),
    "load cell, T2 against T4 %": ("load_cell", "T2", "T4", -45.0),
    "CG, T1 against T2 %": ("cg", "T1", "T2", -50.0),
    "CG, T3 against T4 %": ("cg", "T3", "T4", -50.0),
}
"""Effect of a group under one trajectory against another: (group, trajectory, other, printed)."""


@dataclass(frozen=True, repr=False)
class PaperResult(Result):
    """Our campaign on the preset ``barreto2016`` beside the paper's printed figures.

    Example: ``paper(trials=100).to_frame().loc[("smoothed", "3σ moments", "T1")]``.
    """

    kind = "inertia paper"
    campaign: MonteCarloResult

    def table2(self, estimator: str) -> dict[str, dict[str, float]]:
        """Return Table 2 for an estimator, with the rows of ``PRINTED``, in g·m² and per cent."""
        totals = {name: self.campaign[name, estimator].total for name in TRAJECTORIES}
        moments = {name: average_three_sigma(total, MOMENTS) for name, total in totals.items()}
        products = {name: average_three_sigma(total, PRODUCTS) for name, total in totals.items()}
        nominal = self.campaign.nominal[list(MOMENTS)]
        return {
            "3σ moments": moments,
            "% of nominal": {
                name: 100 * float(np.mean(total.three_sigma[list(MOMENTS)] / nominal)) for name, total in totals.items()
            },
            "moments against T4 %": _against_t4(moments),
            "3σ products": products,
            "products against T4 %": _against_t4(products),
        }

    def shares(self, estimator: str, trajectory: str = "T1") -> dict[str, float]:
        """Return each group's share of the total 3σ, per cent."""
        return {group: 100 * self.campaign[trajectory, estimator].share(group) for group in PRINTED_SHARES}

    def effects(self, estimator: str) -> dict[str, float]:
        """Return the change of a group's average 3σ between trajectories, with the rows of ``PRINTED_EFFECTS``."""

        def effect(trajectory: str, group: str) -> float:
            return float(np.mean(self.campaign[trajectory, estimator].groups[group].three_sigma))

        return {
            name: 100 * (effect(trajectory, group) / effect(other, group) - 1)
            for name, (group, trajectory, other, _) in PRINTED_EFFECTS.items()
        }

    @property
    def estimators(self) -> tuple[str, ...]:
        """Names of the estimators that were run."""
        return tuple(self.campaign.breakdowns["T1"])

    def to_dict(self) -> dict[str, Any]:
        """Return the content of result.json: the campaign's."""
        return self.campaign.to_dict() | self.form()

    def records(self) -> list[dict[str, Any]]:
        """Return each figure of Table 2, ours and the printed one, in g·m² and per cent."""
        return [
            {"estimator": estimator, "figure": name, "trajectory": t, "ours": value, "source": PRINTED[name].get(t)}
            for estimator in self.estimators
            for name, ours in self.table2(estimator).items()
            for t, value in ours.items()
        ]


@explains_names
def paper(
    *,
    trials: int = 10_000,
    seed: int = 0,
    plan: SamplingPlan = SamplingPlan(),  # noqa: B008 - frozen
    options: RunOptions = RunOptions(),  # noqa: B008 - frozen
) -> PaperResult:
    """Reproduce the paper's simulated experiment: preset ``barreto2016``, trajectories T1 to T4, both estimators.

    Arguments are those of :func:`uq.monte_carlo.campaign.campaign.montecarlo`.

    Raises:
        ExperimentError: no trials.
    """
    return PaperResult(montecarlo(Experiment.load("barreto2016"), trials=trials, seed=seed, plan=plan, options=options))


def average_three_sigma(statistics: Statistics, components: tuple[int, ...]) -> float:
    """Return the average 3σ of some components [g·m²]."""
    return GRAM_METRE * float(np.mean(statistics.three_sigma[list(components)]))


def _against_t4(values: Mapping[str, float]) -> dict[str, float]:
    return {name: 100 * (value / values["T4"] - 1) for name, value in values.items() if name != "T4"}
