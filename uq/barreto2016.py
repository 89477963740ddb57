"""The source's simulated experiment, reproduced beside its printed values (Table 2 and the shares of section 4)."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from identify.rigid_body.inertia import MOMENTS, PRODUCTS
from identify.text_tables import html_table, text_table
from uq.campaign.campaign import GRAM_METRE, MonteCarloResult, Progress, Shown, Statistics, montecarlo
from uq.experiment.experiment import Experiment
from uq.trials.checkpoint import Checkpoint

TRAJECTORIES = ("T1", "T2", "T3", "T4")

PRINTED: Mapping[str, Mapping[str, float]] = {
    "3σ moments": {"T1": 2.82, "T2": 3.15, "T3": 4.78, "T4": 4.99},
    "% of nominal": {"T1": 5.13, "T2": 6.15, "T3": 10.3, "T4": 10.9},
    "moments against T4 %": {"T1": -43.5, "T2": -36.9, "T3": -4.21},
    "3σ products": {"T1": 1.86, "T2": 1.97, "T3": 3.41, "T4": 3.47},
    "products against T4 %": {"T1": -46.4, "T2": -43.2, "T3": -1.73},
}
"""The source's Table 2, in g·m² and per cent."""

NAMES = {"load_cell": "load cell", "cg": "CG", "imu": "IMU"}

PRINTED_SHARES: Mapping[str, float] = {"load_cell": 97.0, "cg": 20.0, "imu": 6.0}
"""Effect of each group alone on T1, per cent of the total 3σ, average of the six components."""

PRINTED_EFFECTS: Mapping[str, tuple[str, str, str, float]] = {
    "load cell, T1 against T3 %": ("load_cell", "T1", "T3", -45.0),
    "load cell, T2 against T4 %": ("load_cell", "T2", "T4", -45.0),
    "CG, T1 against T2 %": ("cg", "T1", "T2", -50.0),
    "CG, T3 against T4 %": ("cg", "T3", "T4", -50.0),
}
"""Effect of a group under one trajectory against another: (group, trajectory, other, printed)."""


@dataclass(frozen=True)
class PaperResult:
    """Our campaign on the preset ``barreto2016`` beside the source's printed figures."""

    campaign: MonteCarloResult

    def table2(self, estimator: str) -> dict[str, dict[str, float]]:
        """Return Table 2 for an estimator, with the rows of ``PRINTED``, in g·m² and per cent."""
        totals = {name: self.campaign[name, estimator].total for name in TRAJECTORIES}
        moments = {name: _average(total, MOMENTS) for name, total in totals.items()}
        products = {name: _average(total, PRODUCTS) for name, total in totals.items()}
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
            name: 100 * (effect(one, group) / effect(other, group) - 1)
            for name, (group, one, other, _) in PRINTED_EFFECTS.items()
        }

    def rows(self, estimator: str) -> tuple[list[str], list[list[str]]]:
        """Return head and rows of the comparison: each figure beside the printed one."""
        head = [estimator, *(cell for name in TRAJECTORIES for cell in (name, "source"))]
        rows = [
            [name, *(cell for t in TRAJECTORIES for cell in (_figure(ours.get(t)), _figure(PRINTED[name].get(t))))]
            for name, ours in self.table2(estimator).items()
        ]
        return head, rows

    def effect_rows(self, estimator: str) -> tuple[list[str], list[list[str]]]:
        """Return head and rows of shares and effects beside the printed ones."""
        rows = [
            [f"{NAMES[group]}, share of total, T1 %", _figure(value), _figure(PRINTED_SHARES[group])]
            for group, value in self.shares(estimator).items()
        ]
        rows += [
            [name, _figure(value), _figure(PRINTED_EFFECTS[name][3])] for name, value in self.effects(estimator).items()
        ]
        return [estimator, "ours", "source"], rows

    @property
    def estimators(self) -> tuple[str, ...]:
        """Names of the estimators that were run."""
        return tuple(self.campaign.breakdowns["T1"])

    def to_dict(self) -> dict[str, Any]:
        """Return the content of result.json: the campaign's."""
        return self.campaign.to_dict()

    def _title(self) -> str:
        c = self.campaign
        return f"Table 2, g·m²: ours ({c.trials:,} trials, seed {c.seed}) beside the source's (10,000 trials)"

    def __repr__(self) -> str:
        tables = [text_table(*self.rows(estimator)) for estimator in self.estimators]
        effects = [text_table(*self.effect_rows(estimator)) for estimator in self.estimators]
        return "\n\n".join([self._title(), *tables, *effects, repr(self.campaign)])

    def _repr_html_(self) -> str:
        tables = [html_table(*self.rows(estimator), caption=self._title()) for estimator in self.estimators]
        effects = [html_table(*self.effect_rows(estimator)) for estimator in self.estimators]
        return "".join([*tables, *effects, self.campaign._repr_html_()])


def paper(
    *,
    trials: int = 10_000,
    seed: int = 0,
    dtype: str = "float64",
    progress: Progress | None = None,
    checkpoint: Checkpoint | str | Path | None = None,
    shown: Shown | None = None,
) -> PaperResult:
    """Reproduce the source's simulated experiment: preset ``barreto2016``, trajectories T1 to T4, both estimators.

    Arguments are those of :func:`uq.campaign.campaign.montecarlo`.

    Raises:
        ExperimentError: no trials.
    """
    experiment = Experiment.load("barreto2016")
    return PaperResult(
        montecarlo(
            experiment, trials=trials, seed=seed, dtype=dtype, progress=progress, checkpoint=checkpoint, shown=shown
        )
    )


def row(trajectory: str, trials: int, estimator: str, total: Statistics) -> str:
    """Return a column of Table 2 as one line, for a table that is printed as it comes."""
    figures = {"3σ moments": _average(total, MOMENTS), "3σ products": _average(total, PRODUCTS)}
    parts = [f"{name} {value:.3g} ({PRINTED[name][trajectory]:.3g})" for name, value in figures.items()]
    return f"{trajectory} {estimator:<9} {trials:>7,} trials, g·m² (source): {', '.join(parts)}"


def _average(statistics: Statistics, components: tuple[int, ...]) -> float:
    return GRAM_METRE * float(np.mean(statistics.three_sigma[list(components)]))


def _against_t4(values: Mapping[str, float]) -> dict[str, float]:
    return {name: 100 * (value / values["T4"] - 1) for name, value in values.items() if name != "T4"}


def _figure(value: float | None) -> str:
    return "–" if value is None else f"{value:.3g}".replace("-", "−")
