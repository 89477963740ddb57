"""The outcome of a campaign: tables, findings and the content of result.json."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from html import escape
from typing import Any

import numpy as np

from identify.rigid_body.inertia import COMPONENTS
from identify.text_tables import html_table, text_table, with_error
from uq.campaign.result_coverage import coverage_record, stability_record
from uq.campaign.statistics import GRAM_METRE, Breakdown, Statistics
from uq.coverage.adaptive_procedure import Stability
from uq.coverage.coverage_intervals import CoverageInterval, Kind, shortest_interval, symmetric_interval


@dataclass(frozen=True)
class MonteCarloResult:
    """The outcome of a campaign. ``result["T1", "central"]`` is one :class:`Breakdown`."""

    trials: int
    seed: int
    nominal: np.ndarray
    """The true tensor, packed [kg·m²]."""
    breakdowns: Mapping[str, Mapping[str, Breakdown[Statistics]]]
    """By trajectory, then by estimator."""
    warnings: tuple[str, ...]
    provenance: Mapping[str, Any] = field(repr=False)
    errors: Mapping[str, np.ndarray] = field(repr=False, compare=False)
    """Estimate minus truth of every trial, by trajectory: (trials, estimators, cases, 6) [kg·m²]."""
    stability: Mapping[str, Mapping[str, Stability]] | None = field(default=None, repr=False, compare=False)
    """What an adaptive campaign reached [kg·m²], by trajectory and estimator; None: the trials were given."""

    def __getitem__(self, key: tuple[str, str]) -> Breakdown[Statistics]:
        trajectory, estimator = key
        return self.breakdowns[trajectory][estimator]

    def total_errors(self, trajectory: str, estimator: str) -> np.ndarray:
        """Return estimate minus truth of every trial with all sources together, (trials, 6) [kg·m²]."""
        index = list(self.breakdowns[trajectory]).index(estimator)
        return self.errors[trajectory][:, index, 0]

    def interval(
        self, trajectory: str, estimator: str, probability: float = 0.95, kind: Kind = "symmetric"
    ) -> CoverageInterval:
        """Return the coverage intervals of the six components' errors, all sources together [kg·m²]."""
        of = symmetric_interval if kind == "symmetric" else shortest_interval
        return of(self.total_errors(trajectory, estimator), probability)

    def to_dict(self) -> dict[str, Any]:
        """Return the content of result.json, in g·m²."""
        return {
            "trials": self.trials,
            "seed": self.seed,
            "unit": "g*m^2",
            "adaptive": stability_record(self.stability),
            "trajectories": {
                trajectory: {
                    estimator: {
                        **breakdown.to_dict(),
                        "failed_trials": breakdown.failed,
                        "coverage": coverage_record(self.total_errors(trajectory, estimator)),
                    }
                    for estimator, breakdown in of_trajectory.items()
                }
                for trajectory, of_trajectory in self.breakdowns.items()
            },
            "warnings": list(self.warnings),
            "provenance": dict(self.provenance),
        }

    def rows(self) -> tuple[list[str], list[list[str]]]:
        """Return head and rows of the summary: mean error and 3σ of each component with standard errors, in g·m²."""
        rows = []
        for trajectory, estimator in self.pairs():
            s = self[trajectory, estimator].total
            mean = map(with_error, GRAM_METRE * s.mean_error, GRAM_METRE * s.mean_error_standard_error)
            sigma = map(with_error, GRAM_METRE * s.three_sigma, GRAM_METRE * s.three_sigma_standard_error)
            rows += [[trajectory, estimator, "mean error", *mean], ["", "", "3σ", *sigma]]
        return ["trajectory", "estimator", "g·m²", *COMPONENTS], rows

    def share_rows(self) -> tuple[list[str], list[list[str]]]:
        """Return head and rows of the breakdown: each group's and source's 3σ alone over the total's, per cent."""
        first = self[self.pairs()[0]]
        names = [name for name in (*first.groups, *first.sources) if name != "total"]
        rows = []
        for trajectory, estimator in self.pairs():
            with np.errstate(invalid="ignore", divide="ignore"):
                shares = [100 * self[trajectory, estimator].share(name) for name in names]
            rows.append([trajectory, estimator, *(f"{round(x, 6):.3g}" if np.isfinite(x) else "–" for x in shares)])
        return ["3σ alone, % of total", "", *(name.replace("_", " ") for name in names)], rows

    def interval_rows(self) -> tuple[list[str], list[list[str]]]:
        """Return head and rows of the 95 % coverage intervals of the errors with standard errors, in g·m²."""
        rows = []
        for pair in self.pairs():
            for kind in ("symmetric", "shortest"):
                interval = self.interval(*pair, kind=kind)
                low = map(with_error, GRAM_METRE * interval.low, GRAM_METRE * interval.low_standard_error)
                high = map(with_error, GRAM_METRE * interval.high, GRAM_METRE * interval.high_standard_error)
                rows += [[*(pair if kind == "symmetric" else ("", "")), f"{kind}, from", *low], ["", "", "to", *high]]
        return ["trajectory", "estimator", "g·m²", *COMPONENTS], rows

    def tolerance_rows(self) -> tuple[list[str], list[list[str]]]:
        """Return head and rows of an adaptive campaign: each component's tolerance and what is reached, in g·m²."""
        rows = []
        for trajectory, of_trajectory in (self.stability or {}).items():
            for estimator, found in of_trajectory.items():
                tolerance, reached = ([f"{GRAM_METRE * x:.2g}" for x in xs] for xs in (found.tolerance, found.reached))
                rows += [[trajectory, estimator, "tolerance", *tolerance], ["", "", "reached", *reached]]
        return ["trajectory", "estimator", "g·m²", *COMPONENTS], rows

    def pairs(self) -> list[tuple[str, str]]:
        """Return every trajectory with every estimator."""
        return [(trajectory, estimator) for trajectory, of in self.breakdowns.items() for estimator in of]

    def findings(self) -> list[str]:
        """Return what a reader must not miss: warnings, failed trials, mean errors larger than their 3σ."""
        found = list(self.warnings)
        for trajectory, estimator in self.pairs():
            breakdown = self[trajectory, estimator]
            if breakdown.failed:
                found.append(
                    f"{trajectory}, {estimator}: {breakdown.failed} of {self.trials} trials failed and are left out."
                )
            mean, sigma = np.abs(breakdown.total.mean_error), breakdown.total.three_sigma
            excess = [
                f"{COMPONENTS[k]} {GRAM_METRE * breakdown.total.mean_error[k]:.3g} g·m² "
                f"({mean[k] / sigma[k]:.3g} × 3σ)".replace("-", "−")
                for k in np.flatnonzero(mean > sigma)
            ]
            if excess:
                found.append(f"{trajectory}, {estimator}: the mean error exceeds 3σ: {', '.join(excess)}.")
        return found

    def _title(self) -> str:
        how = "" if self.stability is None else ", adaptive"
        return f"Monte Carlo{how}, {self.trials:,} trials, seed {self.seed}"

    def _adaptive_tables(self) -> list[tuple[list[str], list[list[str]]]]:
        return [] if self.stability is None else [self.interval_rows(), self.tolerance_rows()]

    def __repr__(self) -> str:
        found = [f"attention: {text}" for text in self.findings()]
        tables = [text_table(*self.rows()), "", text_table(*self.share_rows())]
        for table in self._adaptive_tables():
            tables += ["", text_table(*table)]
        return "\n".join([self._title(), *tables, *([""] if found else []), *found])

    def _repr_html_(self) -> str:
        listed = "".join(f"<li>{escape(text)}</li>" for text in self.findings())
        tables = html_table(*self.rows(), caption=self._title()) + html_table(*self.share_rows())
        tables += "".join(html_table(*table) for table in self._adaptive_tables())
        return tables + (f"<ul>{listed}</ul>" if listed else "")
