"""Results of the law of propagation for an experiment: typed, as tables, as result.json."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy

from identify.floating_point import MESSAGE
from identify.reporting import Drawing, Result, Section, Shown
from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE
from identify.rounding import finest, fixed, rounded, significant, with_uncertainty
from identify.text_tables import Table
from uq.campaign.by_trajectory import ByTrajectory
from uq.campaign.campaign_result import MonteCarloResult, breakdown_drawings
from uq.campaign.result_coverage import by_component
from uq.campaign.statistics import Breakdown, Statistics, verdict_on_mean_errors
from uq.report.assumptions import source_assumptions
from uq.report.input_tables import source_tables


@dataclass(frozen=True, repr=False)
class LawStatistics(Shown):
    """The law's results for one case, in kg·m², in the order of ``COMPONENTS``."""

    mean_error: np.ndarray
    """Expected estimate minus truth: the bias."""
    covariance: np.ndarray
    """Covariance of the six components [(kg·m²)²]."""
    textbook_value: np.ndarray
    """The error of the estimate from the noise-free run: what the textbook's first order takes for the mean error."""
    textbook_mean_error: np.ndarray
    """The textbook's second-order mean, ``½ tr(H Σ)`` about the noise-free run."""
    textbook_covariance: np.ndarray
    """The textbook's ``J Σ Jᵀ`` about the noise-free run."""

    standard_uncertainty: np.ndarray
    """Standard uncertainty of the GUM: less than the standard deviation where a source is Student's t, which enters
    with its scale."""
    degrees_of_freedom: np.ndarray
    """Effective degrees of freedom of ``standard_uncertainty`` (GUM G.4)."""

    def coverage_interval(self, probability: float = 0.95) -> tuple[np.ndarray, np.ndarray]:
        """Return the ends of the estimate's error, ``mean error ± k u``, k from Student's t (GUM G.3)."""
        half = scipy.special.stdtrit(self.degrees_of_freedom, (1 + probability) / 2) * self.standard_uncertainty
        return self.mean_error - half, self.mean_error + half

    def textbook_interval(self, probability: float = 0.95) -> tuple[np.ndarray, np.ndarray]:
        """Return those of the textbook's first-order law, about the error of the noise-free run's estimate."""
        half = scipy.special.ndtri((1 + probability) / 2) * np.sqrt(np.diag(self.textbook_covariance))
        return self.textbook_value - half, self.textbook_value + half

    @property
    def three_sigma(self) -> np.ndarray:
        """Three standard deviations."""
        return 3 * np.sqrt(np.diag(self.covariance))

    @property
    def three_rms(self) -> np.ndarray:
        """Three times the root mean square error, ``3 √(σ² + b²)``, b the mean error."""
        return 3 * np.sqrt(np.diag(self.covariance) + self.mean_error**2)

    @property
    def textbook_three_sigma(self) -> np.ndarray:
        """Three standard deviations of the textbook's first-order law."""
        return 3 * np.sqrt(np.diag(self.textbook_covariance))

    def rows(self, beside: "LawStatistics | None" = None) -> list[list[str]]:
        """Return mean error and 3σ of each component, and the textbook's 3σ, in g·m²."""
        figures = {"3σ": self.three_sigma, "3σ, textbook": self.textbook_three_sigma}
        widths = [[name, *_figures(values)] for name, values in figures.items()]
        return [["mean error", *_mean_errors(self, beside)], *widths]

    def tables(self) -> list[Table]:
        """Return mean error and 3σ of each component, and the textbook's 3σ, in g·m²."""
        return [Table("", ["g·m²", *COMPONENTS], self.rows())]

    def to_dict(self) -> dict[str, Any]:
        """Return the figures by component, in g·m²; the covariance in (g·m²)², rows in the order of the components."""
        figures = {
            name: by_component(getattr(self, name))
            for name in ("mean_error", "three_sigma", "textbook_mean_error", "textbook_three_sigma")
        }
        covariance = GRAM_METRE**2 * self.covariance
        return figures | {"covariance": covariance.tolist() if np.isfinite(covariance).all() else None}


@dataclass(frozen=True, repr=False)
class LawResult(ByTrajectory[Breakdown[LawStatistics]], Result):
    """The law of propagation for an experiment. ``result["T1", "central"]`` is one :class:`Breakdown`.

    Example: ``law(Experiment.load("barreto2016")).to_frame().loc[("T1", "central", "total")]``.
    """

    name = "law"
    kind = "inertia law"
    nominal: np.ndarray
    """The true tensor, packed [kg·m²]."""
    breakdowns: Mapping[str, Mapping[str, Breakdown[LawStatistics]]]
    """Breakdown of each case, by trajectory, then by estimator."""
    warnings: tuple[str, ...]
    """Warnings, among them every trajectory and estimator of which a mean error exceeds its 3σ."""
    inputs: Callable[[], Mapping[str, Any]] = field(repr=False, compare=False)
    """Makes the provenance when it is asked for: it takes as long as the law of a changed figure."""
    adjustable: Callable[[], Mapping[str, Any]] | None = field(default=None, repr=False, compare=False)
    """Makes the numbers from which a page redraws the law for other figures; None: it cannot."""

    @property
    def by_trajectory(self) -> Mapping[str, Mapping[str, Breakdown[LawStatistics]]]:
        """Breakdown of each case, by trajectory, then by estimator."""
        return self.breakdowns

    @cached_property
    def provenance(self) -> Mapping[str, Any]:
        """Provenance of the result: inputs, versions, machine, time."""
        return self.inputs()

    def to_dict(self) -> dict[str, Any]:
        """Return the content of result.json, in g·m²: shaped as the Monte Carlo's, without standard errors."""
        return {
            **self.form(),
            "unit": "g*m^2",
            "trajectories": {
                trajectory: {estimator: breakdown.to_dict() for estimator, breakdown in of_trajectory.items()}
                for trajectory, of_trajectory in self.breakdowns.items()
            },
            "warnings": list(self.warnings),
            "provenance": dict(self.provenance),
        }

    def notes(self) -> list[str]:
        """Return the warnings, a line each, but for that of the precision: Python gave it as the law was made."""
        return [f"attention: {text}" for text in self.warnings if text != MESSAGE]

    def rows(self) -> tuple[list[str], list[list[str]]]:
        """Return head and rows of the summary: mean error and 3σ of each component, in g·m²; the textbook's below."""
        rows = []
        for trajectory, estimator in self.pairs():
            first, *others = self[trajectory, estimator].total.rows()
            rows += [[trajectory, estimator, *first], *(["", "", *row] for row in others)]
        return ["trajectory", "estimator", "g·m²", *COMPONENTS], rows

    def source_rows(self) -> tuple[list[str], list[list[str]]]:
        """Return head and rows of the breakdown: each group's and source's mean error and 3σ alone, in g·m²."""
        rows = []
        for trajectory, estimator in self.pairs():
            breakdown = self[trajectory, estimator]
            for name, s in [*breakdown.groups.items(), *breakdown.sources.items()]:
                label = name.replace("_", " ")
                rows.append([trajectory, estimator, label, "mean error", *_mean_errors(s, breakdown.total)])
                rows.append(["", "", "", "3σ", *_figures(s.three_sigma)])
        return ["trajectory", "estimator", "alone", "g·m²", *COMPONENTS], rows

    def title(self) -> str:
        """Return what the tables are of."""
        return "Law of propagation about the expected sums"

    def tables(self) -> list[Table]:
        """Return the summary, and what each group and source does alone."""
        return [Table("", *self.rows()), Table("", *self.source_rows(), long=True)]

    def drawings(self) -> list[Drawing]:
        """Return two figures of each breakdown, named as the Monte Carlo's, which shows the same."""
        return breakdown_drawings({pair: drawn(self[pair]) for pair in self.pairs()}, " by the law")

    def section(self) -> Section:
        """Return its part of a report, with a table of sources whose figures can be changed in the page."""
        summary, alone = self.tables()
        details = [replace(alone, caption="Each group and source alone, by the law"), *source_tables(self.provenance)]
        return Section(
            title=self.title(), computed=[COMPUTED],
            findings=[f"By the law of propagation: {text}" for text in self.warnings],
            tables=[replace(summary, caption=self.title())], drawings=self.drawings(), details=details,
            assumptions=[ASSUMPTION, *source_assumptions(self.provenance)], provenance=self.provenance,
            adjustable=[] if self.adjustable is None else [self.adjustable()],
            verdict=verdict_on_mean_errors({pair: self[pair].total for pair in self.pairs()}),
        )  # fmt: skip

    def records(self) -> list[dict[str, Any]]:
        """Return mean error and 3σ of each case and component, and the textbook's, in g·m²."""
        return [
            {"trajectory": trajectory, "estimator": estimator, **record}
            for trajectory, estimator in self.pairs()
            for record in self[trajectory, estimator].records()
        ]


def drawn(breakdown: Breakdown[LawStatistics]) -> Breakdown[Statistics]:
    """Return the law's results as figures take them: they have no standard errors."""
    exact = np.full(len(COMPONENTS), np.nan)
    groups, sources = (
        {name: Statistics(case.mean_error, exact, case.three_sigma, exact) for name, case in cases.items()}
        for cases in (breakdown.groups, breakdown.sources)
    )
    return Breakdown(groups, sources)


COMPUTED = (
    "The law of propagation (GUM) about the expected sums, to the second order; beside it the textbook's, of the first "
    "order about the noise-free run."
)

ASSUMPTION = (
    "The law takes errors for normal where their squares matter; it leaves out products of a constant error's and the "
    "noise's effects."
)


def _figures(values: np.ndarray) -> list[str]:
    return [significant(GRAM_METRE * x, 4) for x in values]


def _mean_errors(s: LawStatistics, beside: LawStatistics | None = None) -> list[str]:
    """Return mean errors in text, with the decimals that matter beside 3σ."""
    places = finest(GRAM_METRE * (beside or s).three_sigma)
    return [fixed(GRAM_METRE * x, places) for x in s.mean_error]


def beside(law: LawResult, result: MonteCarloResult) -> list[Table]:
    """Return the law beside a Monte Carlo of the same experiment, all sources together, a table a pair.

    ``apart`` is their difference, law minus Monte Carlo, in the Monte Carlo's standard errors.
    """
    tables = []
    for trajectory, estimator in law.pairs():
        ours, theirs = law[trajectory, estimator].total, result[trajectory, estimator].total
        columns: list[list[str]] = []
        for name in ("mean_error", "three_sigma"):
            by_law, by_trials, error = (
                GRAM_METRE * values
                for values in (getattr(ours, name), getattr(theirs, name), getattr(theirs, f"{name}_standard_error"))
            )
            away = np.divide(by_law - by_trials, error, out=np.zeros(6), where=error > 0)
            columns.append([rounded(*figures) for figures in zip(by_law, error, strict=True)])
            columns.append([with_uncertainty(*figures) for figures in zip(by_trials, error, strict=True)])
            columns.append([fixed(value, 2) for value in away])
        rows = [list(row) for row in zip(COMPONENTS, *columns, strict=True)]
        tables.append(Table(f"{trajectory}, {estimator}", HEAD_BESIDE, rows, BESIDE_NOTE))
    return tables


HEAD_BESIDE = ("g·m²", "mean error, law", "Monte Carlo", "apart", "3σ, law", "Monte Carlo", "apart")
BESIDE_NOTE = "All sources together. apart: law minus Monte Carlo, in standard errors of the Monte Carlo."
