"""The view of the paper's simulated experiment: Table 2, effects of the groups and figures beside the printed ones."""

from dataclasses import replace

import numpy as np

from identify.display.reporting import Drawing, Section, section_of, stem
from identify.display.rounding import exact, significant
from identify.display.text_tables import Table
from identify.rigid_body.inertia import MOMENTS, PRODUCTS
from uq.monte_carlo.barreto2016 import (
    PRINTED,
    PRINTED_EFFECTS,
    PRINTED_SHARES,
    SOURCE_ESTIMATOR,
    TRAJECTORIES,
    PaperResult,
    average_three_sigma,
)
from uq.monte_carlo.campaign.statistics import Statistics
from uq.report.assumptions import source_assumptions
from uq.report.drawing import drawing
from uq.report.figures.style import display_name
from uq.report.tables import campaign
from uq.report.tables.cases import verdict_on_mean_errors


def title(result: PaperResult) -> str:
    """Return what the tables are of."""
    trials, seed = result.campaign.trials, result.campaign.seed
    return f"Table 2, g·m²: ours ({trials:,} trials, seed {seed}) beside the paper's (10,000 trials)"


def tables(result: PaperResult) -> list[Table]:
    """Return Table 2 and the groups' effects beside the printed ones, then totals and the true tensor."""
    summary, *_, nominal = result.campaign.tables()
    return [*_comparisons(result), summary, nominal]


def overview(result: PaperResult) -> list[Table]:
    """Return the comparisons, then what the campaign shows."""
    first, *others = result.campaign.overview()
    comparisons = [replace(table, caption="") for table in _comparisons(result)]
    return [*comparisons, replace(first, caption=result.campaign.title()), *others]


def notes(result: PaperResult) -> list[str]:
    """Return the campaign's findings."""
    return result.campaign.notes()


def drawings(result: PaperResult) -> list[Drawing]:
    """Return the paper's figures 2 to 5, the last two kinds for each estimator."""
    return [
        drawing("figure2-spheres", FIGURE_2, "paper.figure2", result),
        *(
            drawing(
                stem("figure3", "groups", "T1", name), FIGURE_3.format(name), "campaign.contributions",
                result.campaign["T1", name].groups,
            )
            for name in result.estimators
        ),
        drawing("figure4-simple-motions", FIGURE_4, "paper.figure4", result),
        *(
            drawing(
                stem("figure5", "trajectories", name), FIGURE_5.format(name), "paper.averages",
                result.campaign, name, PRINTED,
            )
            for name in result.estimators
        ),
    ]  # fmt: skip


def section(result: PaperResult) -> Section:
    """Return its part of a report."""
    ours = result.campaign
    study = [SAMPLED_STUDY] if ours.provenance.get("engine") == "sums" else []
    return section_of(
        result, title="Low uncertainty method for inertia tensor identification: the simulated experiment, reproduced",
        computed=[SOURCE, campaign.computed(ours), campaign.INDEX], findings=ours.findings(),
        tables=_comparisons(result), details=[*ours.tables(), *campaign.details(ours)],
        assumptions=[*campaign.METHOD, *source_assumptions(ours.provenance), *PAPER_ASSUMPTIONS, *study],
        provenance=ours.provenance, verdict=f"{verdict_on_mean_errors(ours)} {_agreement(result)}".strip(),
        headline=len(result.estimators),
    )  # fmt: skip


def _agreement(result: PaperResult) -> str:
    """A sentence on the difference of our 3σ from the printed ones, by the paper's estimator."""
    ours = result.table2(SOURCE_ESTIMATOR)
    apart = [abs(ours[name][t] / PRINTED[name][t] - 1) for name in ("3σ moments", "3σ products") for t in TRAJECTORIES]
    text = f"By central differences every 3σ is within {100 * max(apart):.1f} % of the paper's Table 2."
    return text if np.isfinite(apart).all() else ""


def _comparisons(result: PaperResult) -> list[Table]:
    """Table 2 of each estimator beside the paper's, then the groups' shares and effects."""
    tables_of = (table2, effects)
    return [table(result, estimator) for table in tables_of for estimator in result.estimators]


def table2(result: PaperResult, estimator: str) -> Table:
    """Return each figure of Table 2 beside the printed one."""
    head = [estimator, *(cell for name in TRAJECTORIES for cell in (name, "paper"))]
    rows = [
        [name, *(cell for t in TRAJECTORIES for cell in (_figure(ours.get(t)), _printed(PRINTED[name].get(t))))]
        for name, ours in result.table2(estimator).items()
    ]
    if estimator == SOURCE_ESTIMATOR:
        caption, note = "Table 2 of the paper, g·m² and per cent", PAPER_NOTE
    else:
        caption, note = f"The same figures by the estimator {estimator}, g·m² and per cent", NOT_IN_THE_PAPER
    return Table(caption, head, rows, note)


def effects(result: PaperResult, estimator: str) -> Table:
    """Return shares and effects beside the printed ones."""
    rows = [
        [f"{display_name(group)}, share of total, T1 %", _figure(value), _printed(PRINTED_SHARES[group])]
        for group, value in result.shares(estimator).items()
    ]
    rows += [
        [name, _figure(value), _printed(PRINTED_EFFECTS[name][3])] for name, value in result.effects(estimator).items()
    ]
    printed, note = "paper", ""
    if estimator != SOURCE_ESTIMATOR:
        printed, note = f"paper, {SOURCE_ESTIMATOR}", f"{NOT_IN_THE_PAPER} {IMU_NOTE}"
    return Table(f"Effects of the groups, estimator {estimator}, per cent", [estimator, "ours", printed], rows, note)


def row(trajectory: str, trials: int, estimator: str, total: Statistics) -> str:
    """Return a column of Table 2 as one line, for a table that is printed as it comes."""
    figures = {"3σ moments": average_three_sigma(total, MOMENTS), "3σ products": average_three_sigma(total, PRODUCTS)}
    parts = [f"{name} {significant(value)} ({_printed(PRINTED[name][trajectory])})" for name, value in figures.items()]
    return f"{trajectory} {estimator:<9} {trials:>7,} trials, g·m² (paper): {', '.join(parts)}"


def _figure(value: float | None) -> str:
    return "–" if value is None else significant(value)


def _printed(value: float | None) -> str:
    return "–" if value is None else exact([value])[0]


FIGURE_2 = "Figure 2. Angular velocity and acceleration of T1 in the body frame."
FIGURE_3 = "Figure 3, estimator {}. T1: 3σ and mean error, all sources and each group alone."
FIGURE_4 = "Figure 4. Angular velocity of the simple harmonic motions (T3)."
FIGURE_5 = (
    "Figure 5, estimator {}. Average 3σ of moments and products beside the paper's, and average magnitude of the mean "
    "errors, which the paper does not print."
)
SOURCE = (
    "J.P. Barreto, L.E. Muñoz, “Low uncertainty method for inertia tensor identification”, Mechanical Systems and "
    "Signal Processing 68–69 (2016) 207–216: its simulated experiment, its Table 2 and its figures 2 to 5, beside the "
    "values that it prints."
)
PAPER_NOTE = (
    "“paper”: the printed value, from 10,000 repetitions. The paper prints no mean error; ours stand in the summary."
)
NOT_IN_THE_PAPER = "The paper has no such estimator: “paper” are its figures by central differences, for comparison."
IMU_NOTE = (
    "A differentiator matched to the motion passes little of the gyro's noise, from which the IMU's share with central "
    "differences comes."
)
PAPER_ASSUMPTIONS = (
    "The paper does not state six values: the sample rate, the duration, the ramp, the number of precessions, the "
    "pole of the path over the sphere, and the height of the centre of gravity over the platform's centre; nor any "
    "filtering. They are inferred from its own figures: Table 2, the CG effect and the IMU's share. So the agreement "
    "with these figures shows that a consistent reconstruction exists; it is fitted, not predicted.",
    "Not fitted are the shares of load cell and CG in the total, and the load cell's effect.",
    "The mean errors of the central difference follow from the inferred sample rate and from the absence of a filter. "
    "The paper's own experiment, with I33 within 0.33 g·m² of its expected value, shows no such bias.",
)
SAMPLED_STUDY = (
    "The trials are on sums over the samples. A stored study of 10,000 trials by samples, of all four trajectories, "
    "gives the same: of 690 differences of 3σ and mean error the largest is 3.7 standard errors "
    "(docs/reference/studies.md, Campaigns; `inertia paper --samples` draws every sample again)."
)
