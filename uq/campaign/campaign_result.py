"""The outcome of a campaign: tables, findings and the content of result.json."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from identify.figure_style import LINES, display_name
from identify.reporting import Drawing, Result, Section, stem
from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE
from identify.rounding import exact, fixed, rounded, significant, with_uncertainty
from identify.text_tables import Table
from uq.campaign.by_trajectory import ByTrajectory
from uq.campaign.result_coverage import coverage_record, stability_record
from uq.campaign.statistics import Breakdown, Statistics, large_mean_error, verdict_on_mean_errors
from uq.coverage.adaptive_procedure import Stability
from uq.coverage.coverage_intervals import CoverageInterval, Kind, shortest_interval, symmetric_interval
from uq.report.assumptions import source_assumptions
from uq.report.input_tables import source_tables
from uq.sources.quasi_random import Points

if TYPE_CHECKING:
    from matplotlib.figure import FigureBase
    from xarray import DataArray


@dataclass(frozen=True, repr=False)
class MonteCarloResult(ByTrajectory[Breakdown[Statistics]], Result):
    """The outcome of a campaign. ``result["T1", "central"]`` is one :class:`Breakdown`.

    Example: ``montecarlo(Experiment.load("barreto2016"), trials=200).to_frame().loc[("T1", "central", "total")]``.
    """

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

    @property
    def by_trajectory(self) -> Mapping[str, Mapping[str, Breakdown[Statistics]]]:
        """Breakdown of each case, by trajectory, then by estimator."""
        return self.breakdowns

    def total_errors(self, trajectory: str, estimator: str) -> np.ndarray:
        """Return estimate minus truth of every trial with all sources together, (trials, 6) [kg·m²]."""
        self.checked((trajectory, estimator))
        index = list(self.breakdowns[trajectory]).index(estimator)
        return self.errors[trajectory][:, index, 0]

    def interval(
        self, trajectory: str, estimator: str, probability: float = 0.95, kind: Kind = "symmetric"
    ) -> CoverageInterval:
        """Return the coverage intervals of the six components' errors, all sources together [kg·m²]."""
        of = symmetric_interval if kind == "symmetric" else shortest_interval
        return of(self.total_errors(trajectory, estimator), probability, self.points)

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
                    for estimator, breakdown in of_trajectory.items()
                }
                for trajectory, of_trajectory in self.breakdowns.items()
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

    def title(self) -> str:
        """Return what the tables are of."""
        how = "" if self.stability is None else ", adaptive"
        points = "" if self.points == "random" else f"{self.points} "
        return f"Monte Carlo{how}, {self.trials:,} {points}trials, seed {self.seed}"

    def tables(self) -> list[Table]:
        """Return totals, coverage intervals, what an adaptive campaign reached, the true tensor; in g·m²."""
        adaptive = [] if self.stability is None else [self.tolerance_table()]
        nominal = Table("True tensor, g·m²", list(COMPONENTS), [exact(GRAM_METRE * self.nominal)])
        return [self.summary_table(), self.interval_table(), *adaptive, nominal]

    def overview(self) -> list[Table]:
        """Return totals and shares, and of an adaptive campaign intervals and what was reached."""
        adaptive = [] if self.stability is None else [self.interval_table(), self.tolerance_table()]
        shown = [replace(table, caption="", head=[*HEAD, *COMPONENTS]) for table in (self.summary_table(), *adaptive)]
        return [shown[0], self.share_table(), *shown[1:]]

    def notes(self) -> list[str]:
        """Return the findings, a line each."""
        return [f"attention: {text}" for text in self.findings()]

    def records(self) -> list[dict[str, Any]]:
        """Return the four statistics of each case and component, in g·m²."""
        return [
            {"trajectory": trajectory, "estimator": estimator, **record}
            for trajectory, estimator in self.pairs()
            for record in self[trajectory, estimator].records()
        ]

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

    def summary_table(self) -> Table:
        """Return mean error and 3σ of each component with standard errors, in g·m²."""
        rows = []
        for pair in self.pairs():
            first, second = self[pair].total.rows()
            rows += [[*pair, *first], ["", "", *second]]
        return Table("All sources together, g·m²", [*HEAD[:2], "", *COMPONENTS], rows)

    def share_table(self) -> Table:
        """Return the breakdown in short: each group's and source's 3σ alone over the total's, per cent."""
        breakdowns = [self[pair] for pair in self.pairs()]
        rows, small = [], 0
        for label, names in (("group ", breakdowns[0].groups), ("", breakdowns[0].sources)):
            shares = {name: [b.share(name) for b in breakdowns] for name in names if name != "total"}
            for name in sorted(shares, key=lambda name: -np.nanmax([*shares[name], 0.0])):
                if not label and np.nanmax(np.abs([*shares[name], 0.0])) < SMALL:
                    small += 1
                    continue
                rows.append([label + name.replace("_", " "), *map(_percent, shares[name])])
        if small:
            rows.append([f"{small} more, below {100 * SMALL:g} each", *("" for _ in breakdowns)])
        return Table("", ["3σ alone, % of total", *map(", ".join, self.pairs())], rows)

    def interval_table(self) -> Table:
        """Return the 95 % coverage intervals of the errors with standard errors, in g·m²."""
        rows = []
        for pair in self.pairs():
            for kind in ("symmetric", "shortest"):
                interval = self.interval(*pair, kind=kind)
                low = map(with_uncertainty, GRAM_METRE * interval.low, GRAM_METRE * interval.low_standard_error)
                high = map(with_uncertainty, GRAM_METRE * interval.high, GRAM_METRE * interval.high_standard_error)
                rows += [[*(pair if kind == "symmetric" else ("", "")), f"{kind}, from", *low], ["", "", "to", *high]]
        note = "symmetric: as much on either side; shortest: JCGM 101, 7.7."
        return Table("95 % coverage intervals of the error, g·m²", [*HEAD[:2], "", *COMPONENTS], rows, note)

    def tolerance_table(self) -> Table:
        """Return each component's tolerance in an adaptive campaign and what is reached, in g·m²."""
        rows = []
        for trajectory, of_trajectory in (self.stability or {}).items():
            for estimator, reached in of_trajectory.items():
                pairs = (reached.tolerance, reached.reached)
                tolerance, half_width = ([significant(GRAM_METRE * x, 2) for x in values] for values in pairs)
                rows += [[trajectory, estimator, "tolerance", *tolerance], ["", "", "reached", *half_width]]
        note = "tolerance: half a unit of the last significant digit of u, or as asked; JCGM 101, 7.9."
        return Table("Adaptive Monte Carlo, g·m²", [*HEAD[:2], "", *COMPONENTS], rows, note)

    def breakdown_table(self, trajectory: str, estimator: str) -> Table:
        """Return one breakdown: every group and source alone, its mean error, 3σ and share, in g·m²."""
        breakdown, rows = self[trajectory, estimator], []
        for name, statistics in breakdown.cases.items():
            first, second = statistics.rows(breakdown.total)
            rows += [[display_name(name), *first, ""], ["", *second, _percent(breakdown.share(name))]]
        head = ["alone", "", *COMPONENTS, "share %"]
        note = "share: 3σ alone over the total's, averaged over the components."
        return Table(f"{trajectory}, {estimator}: groups and sources alone, g·m²", head, rows, note)

    def drawings(self) -> list[Drawing]:
        """Return two figures of each breakdown: first all by group, then all by source."""
        return breakdown_drawings({pair: self[pair] for pair in self.pairs()})

    def section(self) -> Section:
        """Return its part of a report."""
        pairs = [self.pair_table(*pair) for pair in self.pairs()]
        few, tables = len(pairs) <= FEW, self.tables()
        details = [table for table in (*tables[:2], *self.details()) if few or table != tables[0]]
        return Section(
            title="Monte Carlo of an inertia tensor", computed=[self.computed(), INDEX], findings=self.findings(),
            tables=[*(pairs if few else tables[:1]), *tables[2:]], drawings=self.drawings(), details=details,
            assumptions=[*METHOD, *source_assumptions(self.provenance)], provenance=self.provenance,
            verdict=self.verdict(), headline=len(pairs) if few else 1,
        )  # fmt: skip

    def verdict(self) -> str:
        """Return in a sentence whether mean errors exceed their dispersion."""
        return verdict_on_mean_errors({pair: self[pair].total for pair in self.pairs()})

    def pair_table(self, trajectory: str, estimator: str) -> Table:
        """Return mean error, 95 % interval and 3σ of one trajectory and estimator, a component a row, in g·m²."""
        total, interval = self[trajectory, estimator].total, self.interval(trajectory, estimator)
        errors = GRAM_METRE * np.maximum(interval.low_standard_error, interval.high_standard_error)
        ends = [map(rounded, GRAM_METRE * values, errors) for values in (interval.low, interval.high)]
        mean = map(with_uncertainty, GRAM_METRE * total.mean_error, GRAM_METRE * total.mean_error_standard_error)
        sigma = map(with_uncertainty, GRAM_METRE * total.three_sigma, GRAM_METRE * total.three_sigma_standard_error)
        rows = [
            [name, error, f"{low} … {high}", three_sigma]
            for name, error, low, high, three_sigma in zip(COMPONENTS, mean, *ends, sigma, strict=True)
        ]
        head = ["", "mean error", "95 % interval", "3σ"]
        return Table(f"{trajectory}, {estimator}: error of the estimate, g·m²", head, rows)

    def computed(self) -> str:
        """Return what was computed, in a paragraph."""
        names = {estimator: None for of_trajectory in self.breakdowns.values() for estimator in of_trajectory}
        by_samples = [
            f" {name}, {case} by samples: {reason}."
            for name, computed in self.provenance.get("computed", {}).items()
            for case, reason in computed.get("by_samples", {}).items()
        ]
        return (
            f"{self.trials:,} {self.points} trials on {self.provenance.get('engine', 'sums')}, seed {self.seed}. "
            f"Trajectories: {', '.join(self.breakdowns)}. "
            f"Estimators: {', '.join(names)}. In each trial every error source is drawn once; the tensor is then "
            "estimated with all sources together, with each group alone and with each source alone."
            f"{''.join(by_samples)}"
        )

    def details(self) -> list[Table]:
        """Return every breakdown, and the sources as declared."""
        return [*(self.breakdown_table(*pair) for pair in self.pairs()), *source_tables(self.provenance)]


def breakdown_drawings(breakdowns: Mapping[tuple[str, str], Breakdown[Statistics]], how: str = "") -> list[Drawing]:
    """Return two figures of each trajectory and estimator: first all by group, then all by source.

    Args:
        breakdowns: by trajectory and estimator.
        how: what their captions add, such as " by the law".
    """

    def drawing(kind: str, pair: tuple[str, str], cases: Mapping[str, Statistics]) -> Drawing:
        def draw() -> "FigureBase":
            from uq.campaign.campaign_figures import contributions

            return contributions(cases)

        most = f", the {LINES} largest of {len(cases) - 1}" if len(cases) - 1 > LINES else ""
        what = f"3σ and mean error of each component{how}, all sources and each {kind} alone{most}."
        return Drawing(stem(f"{kind}s", *pair), f"{', '.join(pair)}: {what}", draw)

    by_group = [drawing("group", pair, of.groups) for pair, of in breakdowns.items()]
    return [*by_group, *(drawing("source", pair, {"total": of.total, **of.sources}) for pair, of in breakdowns.items())]


def _percent(share: float) -> str:
    return significant(100 * share) if share >= 1e-4 else fixed(100 * share, 2)


SMALL = 1e-3
"""Share of the 3σ below which a terminal counts sources together; a report shows all of them."""
HEAD = ("trajectory", "estimator", "g·m²")
FEW = 4
"""Most cases (a trajectory with an estimator) for which a page has a table each."""
INDEX = (
    "3σ is three standard deviations of the estimates over the trials, the source's index of uncertainty. It does not "
    "contain the mean error (mean of estimate minus truth), which therefore stands beside it everywhere. The figure "
    "after ± is a standard error, from the finite number of trials."
)
METHOD = (
    "The body is rigid, and turns exactly as the trajectory says. The error of the believed centre of gravity enters "
    "through the moment of the force that the estimator removes, not through the motion.",
    "The tensor is estimated by ordinary least squares over all samples; the angular acceleration is the numerical "
    "derivative of the measured angular velocity.",
    "Groups and sources alone are computed from the same draws as the total; shares need not add up to one.",
)
"""Assumptions of every campaign, whatever sources are declared."""
