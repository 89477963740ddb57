"""The view of a campaign: totals, shares, coverage intervals, breakdowns; in g·m²."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np

from identify.display.reporting import Section, section_of
from identify.display.rounding import exact, rounded, significant
from identify.display.text_tables import Table, counted
from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE
from uq.monte_carlo.campaign.campaign_result import MonteCarloResult
from uq.report.assumptions import source_assumptions
from uq.report.figures.style import display_name
from uq.report.input_tables import source_tables
from uq.report.tables.cases import (
    PAIR,
    breakdown_drawings,
    breakdown_table,
    case_table,
    grams,
    percent,
    rows_of,
    verdict_on_mean_errors,
)

SMALL = 1e-3
"""Share of the 3σ below which a terminal counts sources together; a report shows all of them."""
FEW = 4
"""Most cases (a trajectory with an estimator) for which a page has a table each."""


def title(result: MonteCarloResult) -> str:
    """Return what the tables are of."""
    how = "" if result.stability is None else ", adaptive"
    points = "" if result.points == "random" else f"{result.points} "
    return f"Monte Carlo{how}, {counted(result.trials, f'{points}trial')}, seed {result.seed}"


def tables(result: MonteCarloResult) -> list[Table]:
    """Return totals, coverage intervals, what an adaptive campaign reached, the true tensor; in g·m²."""
    nominal = Table("True tensor, g·m²", list(COMPONENTS), [exact(GRAM_METRE * result.nominal)])
    return [_summary(result), _intervals(result), *_tolerances(result), nominal]


def overview(result: MonteCarloResult) -> list[Table]:
    """Return totals and shares, and of an adaptive campaign intervals and what was reached."""
    adaptive = [] if result.stability is None else [_intervals(result), *_tolerances(result)]
    first, *others = (
        replace(table, caption="", head=[*PAIR, "g·m²", *COMPONENTS]) for table in (_summary(result), *adaptive)
    )
    return [first, shares(result), *others]


def notes(result: MonteCarloResult) -> list[str]:
    """Return the findings, a line each."""
    return [f"attention: {text}" for text in result.findings()]


drawings = breakdown_drawings


def section(result: MonteCarloResult) -> Section:
    """Return its part of a report."""
    pairs = [_pair(result, *pair) for pair in result.pairs()]
    few, shown = len(pairs) <= FEW, tables(result)
    return section_of(
        result, title="Monte Carlo of an inertia tensor", computed=[computed(result), INDEX],
        findings=result.findings(), tables=[*(pairs if few else shown[:1]), *shown[2:]],
        details=[*(shown[:2] if few else shown[1:2]), *details(result)],
        assumptions=[*METHOD, *source_assumptions(result.provenance)], verdict=verdict_on_mean_errors(result),
        headline=len(pairs) if few else 1,
    )  # fmt: skip


def _differentiator(table: Mapping[str, Any]) -> str:
    """Return in brackets how an estimator differentiates the angular velocity, as its table says."""
    name = table.get("differentiator")
    if not name:
        return ""
    band = f" matched to {table['band']}" if "band" in table else ""
    return f" (angular acceleration by {'central difference' if name == 'central' else name.title()}{band})"


def computed(result: MonteCarloResult) -> str:
    """Return what was computed, in a paragraph."""
    names = {estimator: None for breakdowns in result.breakdowns.values() for estimator in breakdowns}
    declared = {table["name"]: table for table in result.provenance.get("experiment", {}).get("estimator", [])}
    estimators = [f"{name}{_differentiator(declared.get(name, {}))}" for name in names]
    by_samples = [
        f" {name}, {case} by samples: {reason}."
        for name, choice in result.provenance.get("computed", {}).items()
        for case, reason in choice.get("by_samples", {}).items()
    ]
    return (
        f"{counted(result.trials, f'{result.points} trial')} on {result.provenance.get('engine', 'sums')}, "
        f"seed {result.seed}. Trajectories: {', '.join(result.breakdowns)}. "
        f"Estimators: {', '.join(estimators)}. In each trial every error source is drawn once; the tensor is then "
        "estimated with all sources together, with each group alone and with each source alone."
        f"{''.join(by_samples)}"
    )


def details(result: MonteCarloResult) -> list[Table]:
    """Return every breakdown, and the sources as declared."""
    breakdowns = []
    for pair in result.pairs():
        caption, breakdown = f"{', '.join(pair)}: groups and sources alone, g·m²", result[pair]
        parts = {name: percent(breakdown.share(name)) for name in breakdown.cases}
        breakdowns.append(breakdown_table(caption, breakdown, parts, unit="", note=SHARE_NOTE, named=display_name))
    return [*breakdowns, *source_tables(result.provenance)]


def _summary(result: MonteCarloResult) -> Table:
    """Mean error and 3σ of each component with standard errors."""
    cases = [(pair, rows_of(result[pair].total)) for pair in result.pairs()]
    return case_table("All sources together, g·m²", PAIR, cases, unit="")


def _intervals(result: MonteCarloResult) -> Table:
    """The 95 % coverage intervals of the errors with standard errors."""
    cases = []
    for pair in result.pairs():
        for kind in ("symmetric", "shortest"):
            interval = result.interval(*pair, kind=kind)
            low = grams(interval.low, interval.low_standard_error)
            high = grams(interval.high, interval.high_standard_error)
            cases.append((pair if kind == "symmetric" else ("", ""), [[f"{kind}, from", *low], ["to", *high]]))
    return case_table("95 % coverage intervals of the error, g·m²", PAIR, cases, unit="", note=INTERVAL_NOTE)


def _tolerances(result: MonteCarloResult) -> list[Table]:
    """Each component's tolerance in an adaptive campaign and what is reached."""
    if result.stability is None:
        return []
    cases = [
        ((trajectory, estimator), [[name, *(significant(GRAM_METRE * x, 2) for x in getattr(reached, name))]
                                   for name in ("tolerance", "reached")])
        for trajectory, estimators in result.stability.items() for estimator, reached in estimators.items()
    ]  # fmt: skip
    return [case_table("Adaptive Monte Carlo, g·m²", PAIR, cases, unit="", note=TOLERANCE_NOTE)]


def shares(result: MonteCarloResult) -> Table:
    """Return the breakdown in short: each group's and source's 3σ alone over the total's, per cent."""
    breakdowns = [result[pair] for pair in result.pairs()]
    rows, small = [], 0
    for label, names in (("group ", breakdowns[0].groups), ("", breakdowns[0].sources)):
        parts = {name: [b.share(name) for b in breakdowns] for name in names if name != "total"}
        for name in sorted(parts, key=lambda name: -np.nanmax([*parts[name], 0.0])):
            if not label and np.nanmax(np.abs([*parts[name], 0.0])) < SMALL:
                small += 1
                continue
            rows.append([label + name.replace("_", " "), *map(percent, parts[name])])
    if small:
        rows.append([f"{small} more, below {100 * SMALL:g} each", *("" for _ in breakdowns)])
    return Table("", ["3σ alone, % of total", *map(", ".join, result.pairs())], rows)


def _pair(result: MonteCarloResult, trajectory: str, estimator: str) -> Table:
    """Mean error, 95 % interval and 3σ of one trajectory and estimator, a component a row."""
    total, interval = result[trajectory, estimator].total, result.interval(trajectory, estimator)
    errors = GRAM_METRE * np.maximum(interval.low_standard_error, interval.high_standard_error)
    ends = [map(rounded, GRAM_METRE * values, errors) for values in (interval.low, interval.high)]
    mean = grams(total.mean_error, total.mean_error_standard_error)
    sigma = grams(total.three_sigma, total.three_sigma_standard_error)
    rows = [
        [name, error, f"{low} … {high}", three_sigma]
        for name, error, low, high, three_sigma in zip(COMPONENTS, mean, *ends, sigma, strict=True)
    ]
    head = ["", "mean error", "95 % interval", "3σ"]
    return Table(f"{trajectory}, {estimator}: error of the estimate, g·m²", head, rows)


SHARE_NOTE = "share: 3σ alone over the total's, averaged over the components."
INTERVAL_NOTE = "symmetric: as much on either side; shortest: JCGM 101, 7.7."
TOLERANCE_NOTE = "tolerance: half a unit of the last significant digit of u, or as asked; JCGM 101, 7.9."
INDEX = (
    "3σ is three standard deviations of the estimates over the trials, the paper's index of uncertainty. It does not "
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
