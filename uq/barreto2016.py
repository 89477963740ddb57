"""The source's simulated experiment beside its printed values (Table 2, section 4)."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from identify.exceptions import explains_names
from identify.reporting import Drawing, Result, Section, stem
from identify.rigid_body.inertia import MOMENTS, PRODUCTS
from identify.rounding import exact, significant
from identify.text_tables import Table
from uq.campaign.campaign import GRAM_METRE, MonteCarloResult, Statistics, montecarlo
from uq.campaign.campaign_options import RunOptions, SamplingPlan
from uq.campaign.campaign_result import INDEX, METHOD
from uq.experiment.experiment import Experiment, TrajectorySpec
from uq.report.assumptions import source_assumptions

if TYPE_CHECKING:
    from matplotlib.figure import FigureBase

TRAJECTORIES = ("T1", "T2", "T3", "T4")

PRINTED: Mapping[str, Mapping[str, float]] = {
    "3σ moments": {"T1": 2.82, "T2": 3.15, "T3": 4.78, "T4": 4.99},
    "% of nominal": {"T1": 5.13, "T2": 6.15, "T3": 10.3, "T4": 10.9},
    "moments against T4 %": {"T1": -43.5, "T2": -36.9, "T3": -4.21},
    "3σ products": {"T1": 1.86, "T2": 1.97, "T3": 3.41, "T4": 3.47},
    "products against T4 %": {"T1": -46.4, "T2": -43.2, "T3": -1.73},
}
"""The source's Table 2, in g·m² and per cent."""

SOURCE_ESTIMATOR = "central"
"""The preset's estimator that differentiates as the source does, by central differences."""

NAMES = {"load_cell": "load cell", "cg": "CG", "imu": "IMU"}

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
    """Our campaign on the preset ``barreto2016`` beside the source's printed figures.

    Example: ``paper(trials=100).to_frame().loc[("smoothed", "3σ moments", "T1")]``.
    """

    kind = "inertia paper"
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
            name: 100 * (effect(trajectory, group) / effect(other, group) - 1)
            for name, (group, trajectory, other, _) in PRINTED_EFFECTS.items()
        }

    def comparison_table(self, estimator: str) -> Table:
        """Return the comparison: each figure beside the printed one."""
        head = [estimator, *(cell for name in TRAJECTORIES for cell in (name, "source"))]
        rows = [
            [name, *(cell for t in TRAJECTORIES for cell in (_figure(ours.get(t)), _printed(PRINTED[name].get(t))))]
            for name, ours in self.table2(estimator).items()
        ]
        if estimator == SOURCE_ESTIMATOR:
            caption, note = "Table 2 of the source, g·m² and per cent", SOURCE_NOTE
        else:
            caption, note = f"The same figures by the estimator {estimator}, g·m² and per cent", NOT_OF_THE_SOURCE
        return Table(caption, head, rows, note)

    def effect_table(self, estimator: str) -> Table:
        """Return shares and effects beside the printed ones."""
        rows = [
            [f"{NAMES[group]}, share of total, T1 %", _figure(value), _printed(PRINTED_SHARES[group])]
            for group, value in self.shares(estimator).items()
        ]
        rows += [
            [name, _figure(value), _printed(PRINTED_EFFECTS[name][3])]
            for name, value in self.effects(estimator).items()
        ]
        printed, note = "source", ""
        if estimator != SOURCE_ESTIMATOR:
            printed, note = f"source, {SOURCE_ESTIMATOR}", f"{NOT_OF_THE_SOURCE} {IMU_NOTE}"
        return Table(
            f"Effects of the groups, estimator {estimator}, per cent", [estimator, "ours", printed], rows, note
        )

    @property
    def estimators(self) -> tuple[str, ...]:
        """Names of the estimators that were run."""
        return tuple(self.campaign.breakdowns["T1"])

    def to_dict(self) -> dict[str, Any]:
        """Return the content of result.json: the campaign's."""
        return self.campaign.to_dict() | self.form()

    def title(self) -> str:
        """Return what the tables are of."""
        c = self.campaign
        return f"Table 2, g·m²: ours ({c.trials:,} trials, seed {c.seed}) beside the source's (10,000 trials)"

    def tables(self) -> list[Table]:
        """Return Table 2 and the groups' effects beside the printed ones, then totals and the true tensor."""
        summary, *_, nominal = self.campaign.tables()
        return [*self._comparisons(), summary, nominal]

    def overview(self) -> list[Table]:
        """Return the comparisons, then what the campaign shows."""
        first, *others = self.campaign.overview()
        comparisons = [replace(table, caption="") for table in self._comparisons()]
        return [*comparisons, replace(first, caption=self.campaign.title()), *others]

    def _comparisons(self) -> list[Table]:
        tables = (self.comparison_table, self.effect_table)
        return [table(estimator) for table in tables for estimator in self.estimators]

    def notes(self) -> list[str]:
        """Return the campaign's findings."""
        return self.campaign.notes()

    def records(self) -> list[dict[str, Any]]:
        """Return each figure of Table 2, ours and the printed one, in g·m² and per cent."""
        return [
            {"estimator": estimator, "figure": name, "trajectory": t, "ours": value, "source": PRINTED[name].get(t)}
            for estimator in self.estimators
            for name, ours in self.table2(estimator).items()
            for t, value in ours.items()
        ]

    def drawings(self) -> list[Drawing]:
        """Return the source's figures 2 to 5, the last two kinds for each estimator."""
        return [
            Drawing(
                "figure2-spheres",
                "Figure 2. Angular velocity and acceleration of T1 in the body frame.",
                self._spheres,
            ),
            *(self._groups(name) for name in self.estimators),
            Drawing(
                "figure4-simple-motions",
                "Figure 4. Angular velocity of the simple harmonic motions (T3).",
                self._simple_motions,
            ),
            *(self._averages(name) for name in self.estimators),
        ]

    def _spheres(self) -> "FigureBase":
        from uq.barreto2016_figures import rates, spheres

        _, omega, alpha = rates(self._trajectory("T1"))
        return spheres(omega, alpha)

    def _simple_motions(self) -> "FigureBase":
        from uq.barreto2016_figures import angular_velocity, rates

        t, omega, _ = rates(self._trajectory("T3"))
        return angular_velocity(t, omega)

    def _trajectory(self, name: str) -> TrajectorySpec:
        return Experiment.from_dict(self.campaign.provenance["experiment"]).trajectories[name]

    def _groups(self, estimator: str) -> Drawing:
        def draw() -> "FigureBase":
            from uq.campaign.campaign_figures import contributions

            return contributions(self.campaign["T1", estimator].groups)

        caption = f"Figure 3, estimator {estimator}. T1: 3σ and mean error, all sources and each group alone."
        return Drawing(stem("figure3", "groups", "T1", estimator), caption, draw)

    def _averages(self, estimator: str) -> Drawing:
        def draw() -> "FigureBase":
            from uq.barreto2016_figures import averages

            return averages(self.campaign, estimator, PRINTED)

        caption = (
            f"Figure 5, estimator {estimator}. Average 3σ of moments and products beside the source's, and average "
            "magnitude of the mean errors, which the source does not print."
        )
        return Drawing(stem("figure5", "trajectories", estimator), caption, draw)

    def section(self) -> Section:
        """Return its part of a report."""
        return Section(
            title="Low uncertainty method for inertia tensor identification: the simulated experiment, reproduced",
            computed=[SOURCE, self.campaign.computed(), INDEX], findings=self.campaign.findings(),
            tables=self._comparisons(), drawings=self.drawings(),
            details=[*self.campaign.tables(), *self.campaign.details()],
            assumptions=[*METHOD, *source_assumptions(self.campaign.provenance), *PAPER_ASSUMPTIONS, *self._study()],
            provenance=self.campaign.provenance, verdict=f"{self._agreement()} {self.campaign.verdict()}",
            headline=len(self.estimators),
        )  # fmt: skip

    def _study(self) -> list[str]:
        return [SAMPLED_STUDY] if self.campaign.provenance.get("engine") == "sums" else []

    def _agreement(self) -> str:
        """Return a sentence on the difference of our 3σ from the printed ones, by the source's estimator."""
        ours = self.table2(SOURCE_ESTIMATOR)
        away = [
            abs(ours[name][t] / PRINTED[name][t] - 1) for name in ("3σ moments", "3σ products") for t in TRAJECTORIES
        ]
        words = f"By central differences every 3σ is within {100 * max(away):.1f} % of the source's Table 2."
        return words if np.isfinite(away).all() else ""


@explains_names
def paper(
    *,
    trials: int = 10_000,
    seed: int = 0,
    plan: SamplingPlan = SamplingPlan(),  # noqa: B008 - frozen
    options: RunOptions = RunOptions(),  # noqa: B008 - frozen
) -> PaperResult:
    """Reproduce the source's simulated experiment: preset ``barreto2016``, trajectories T1 to T4, both estimators.

    Arguments are those of :func:`uq.campaign.campaign.montecarlo`.

    Raises:
        ExperimentError: no trials.
    """
    return PaperResult(montecarlo(Experiment.load("barreto2016"), trials=trials, seed=seed, plan=plan, options=options))


def row(trajectory: str, trials: int, estimator: str, total: Statistics) -> str:
    """Return a column of Table 2 as one line, for a table that is printed as it comes."""
    figures = {"3σ moments": _average(total, MOMENTS), "3σ products": _average(total, PRODUCTS)}
    parts = [f"{name} {significant(value)} ({_printed(PRINTED[name][trajectory])})" for name, value in figures.items()]
    return f"{trajectory} {estimator:<9} {trials:>7,} trials, g·m² (source): {', '.join(parts)}"


def _average(statistics: Statistics, components: tuple[int, ...]) -> float:
    return GRAM_METRE * float(np.mean(statistics.three_sigma[list(components)]))


def _against_t4(values: Mapping[str, float]) -> dict[str, float]:
    return {name: 100 * (value / values["T4"] - 1) for name, value in values.items() if name != "T4"}


def _figure(value: float | None) -> str:
    return "–" if value is None else significant(value)


def _printed(value: float | None) -> str:
    return "–" if value is None else exact([value])[0]


SOURCE = (
    "J.P. Barreto, L.E. Muñoz, “Low uncertainty method for inertia tensor identification”, Mechanical Systems and "
    "Signal Processing 68–69 (2016) 207–216: its simulated experiment, its Table 2 and its figures 2 to 5, beside the "
    "values that it prints."
)
SOURCE_NOTE = (
    "“source”: the printed value, from 10,000 repetitions. The source prints no mean error; ours stand in the summary."
)
NOT_OF_THE_SOURCE = "The source has no such estimator: “source” are its figures by central differences, for comparison."
IMU_NOTE = (
    "A differentiator matched to the motion passes little of the gyro's noise, from which the IMU's share with central "
    "differences comes."
)
PAPER_ASSUMPTIONS = (
    "The source does not state six values: the sample rate, the duration, the ramp, the number of precessions, the "
    "pole of the path over the sphere, and the height of the centre of gravity over the platform's centre; nor any "
    "filtering. They are inferred from its own figures: Table 2, the CG effect and the IMU's share. So the agreement "
    "with these figures shows that a consistent reconstruction exists; it is fitted, not predicted.",
    "Not fitted are the shares of load cell and CG in the total, and the load cell's effect.",
    "The mean errors of the central difference follow from the inferred sample rate and from the absence of a filter. "
    "The source's own experiment, with I33 within 0.33 g·m² of its expected value, shows no such bias.",
)
SAMPLED_STUDY = (
    "The trials are on sums over the samples. A stored study of 10,000 trials by samples, of all four trajectories, "
    "gives the same: of 690 differences of 3σ and mean error the largest is 3.7 standard errors "
    "(docs/reference/studies.md, Campaigns; `inertia paper --samples` draws every sample again)."
)
