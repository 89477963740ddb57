"""What a report says of each kind of result: its words, tables and figures, apart from how they are laid out.

``page(result)`` dispatches on the result's type; a new kind of result registers its own builder with ``page.register``.
"""

from dataclasses import replace
from functools import singledispatch
from typing import Any

from identify.results.identification_result import Identification
from identify.static.centre import Centre
from uq.barreto2016 import PaperResult
from uq.bodies.export import Exported
from uq.bodies.normalised_error import Comparison
from uq.campaign.campaign import MonteCarloResult
from uq.excitation.design_report import DesignReport
from uq.figures import budget_figures as budget_plot
from uq.figures.pose_figures import residuals
from uq.planning.achieved_motion import Achieved
from uq.planning.motion_export import MotionExport
from uq.planning.pose_plan import PosePlan
from uq.report import design_page
from uq.report.certificate_page import certificate
from uq.report.page_parts import (
    Drawing,
    Page,
    Table,
    breakdown_figures,
    breakdown_table,
    coverage_tables,
    nominal,
    paper_figures,
    source_tables,
    stem,
    summary,
)
from uq.sensitivity.budget_result import BudgetResult


@singledispatch
def page(result: object) -> Page:
    """Return a report's content for a result.

    Raises:
        TypeError: there is no report for this kind of result.
    """
    raise TypeError(f"Argument `result` must be a result with a report, but is a {type(result).__name__}.")


@page.register
def _campaign(result: MonteCarloResult) -> Page:
    return Page(
        "Monte Carlo of an inertia tensor",
        [_computed(result), INDEX],
        result.findings(),
        [summary(result), *coverage_tables(result), nominal(result)],
        [drawing for pair in result.pairs() for drawing in breakdown_figures(result, *pair)],
        [*(breakdown_table(result, *pair) for pair in result.pairs()), *source_tables(result.provenance)],
        ASSUMPTIONS,
        result.provenance,
    )


@page.register
def _paper(result: PaperResult) -> Page:
    campaign = result.campaign
    comparisons = [
        Table(f"Table 2 of the source, estimator {name}, g·m² and per cent", *result.rows(name), note=SOURCE_NOTE)
        for name in result.estimators
    ]
    effects = [
        Table(f"Effects of the groups, estimator {name}, per cent", *result.effect_rows(name))
        for name in result.estimators
    ]
    return Page(
        "Low uncertainty method for inertia tensor identification: the simulated experiment, reproduced",
        [SOURCE, _computed(campaign), INDEX],
        campaign.findings(),
        [*comparisons, *effects, summary(campaign), nominal(campaign)],
        paper_figures(result),
        [*(breakdown_table(campaign, *pair) for pair in campaign.pairs()), *source_tables(campaign.provenance)],
        [*ASSUMPTIONS, *PAPER_ASSUMPTIONS],
        campaign.provenance,
    )


@page.register
def _identification(result: Identification) -> Page:
    return certificate(result)


@page.register
def _centre(result: Centre) -> Page:
    return Page(
        "Mass and centre of gravity of a body",
        [f"From static poses, by least squares: {result.title()}; local gravity {result.gravity:.6g} m/s². "
         "Force, moment and centre of gravity are in the body frame, about Q; ± is a standard uncertainty.",
         *(f"{text[0].upper()}{text[1:]}." for text in result.findings())],
        result.warnings,
        [Table("Centre of gravity and offsets", *result.rows())],
        [Drawing("residuals", residuals(result), "What each pose leaves unexplained.")],
        [Table("Standard uncertainties in SI, and correlations", *result.correlation_rows())],
        [f"{text[0].upper()}{text[1:]}." for text in result.assumptions],
        result.provenance,
    )  # fmt: skip


@page.register
def _budget(result: BudgetResult) -> Page:
    pairs = [(pair, ", ".join(pair), result[pair]) for pair in result.pairs()]
    overview = "The whole tensor: Shapley shares of its variance, and how much of its mean squared error is bias."
    each = "Shapley shares by component and of the tensor, and bias and dispersion in the mean square."
    return Page(
        "Budget of an inertia tensor's uncertainty",
        [f"{result.trials:,} pairs of trials with seed {result.seed}. {BUDGET}", " ".join(result.verdicts())],
        result.findings(),
        [Table(f"{of}: shares of the tensor's variance", *b.tensor_rows()) for _, of, b in pairs],
        [
            Drawing("budget", budget_plot.overview(result), overview),
            *(Drawing(stem("budget", *pair), budget_plot.shares(b), f"{of}: {each}") for pair, of, b in pairs),
        ],
        [
            Table(f"{of}: {title}", *rows)
            for _, of, b in pairs
            for title, rows in [
                *(("shares by component", b.component_rows(kind)) for kind in ("shapley", "first", "total")),
                ("mean errors", b.mean_rows()),
            ]
        ]
        + source_tables(result.provenance),
        [BUDGET_ASSUMPTION],
        result.provenance,
    )  # fmt: skip


@page.register
def _comparison(result: Comparison) -> Page:
    parts = [Table("What makes the expected tensor uncertain: standard uncertainty, g·m²", *result.reference_rows())]
    return Page(
        "Expected values",
        [f"Beside what is expected of {result.reference.name}, from its {result.reference.kind}. {EXPECTED}"],
        result.findings(),
        [Table(f"Expected: {result.reference.name}, g·m²", *result.rows(), note=f"{result.summary()}.")],
        [],
        parts if result.reference.contributions else [],
        ["The errors of the result and of the expected value are independent."],
        {**result.provenance, "expected": {"file": result.reference.file, "sha256": result.reference.sha256}},
    )


@page.register
def _exported(result: Exported) -> Page:
    files = Table("Exported files", *result.rows())
    return Page("Exported files", [], result.warnings, [], [], [files], [], result.provenance)


@page.register
def _design(result: DesignReport) -> Page:
    return design_page.design_page(result)


@page.register
def _motion(result: MotionExport) -> Page:
    return design_page.motion_page(result)


@page.register
def _poses(result: PosePlan) -> Page:
    return design_page.poses_page(result)


@page.register
def _achieved(result: Achieved) -> Page:
    return design_page.achieved_page(result)


def joined(first: Page, *others: Page) -> Page:
    """Return one page with the content of several; title, assumptions and provenance stand as the first has them."""
    pages = (first, *others)
    parts: dict[str, Any] = {}
    for name in ("computed", "findings", "tables", "figures", "details", "assumptions"):
        items = [item for one in pages for item in getattr(one, name)]
        parts[name] = [item for k, item in enumerate(items) if item not in items[:k]]
    if others:
        parts["provenance"] = {**first.provenance, "others": [one.provenance for one in others]}
    return replace(first, **parts)


BUDGET = (
    "In each pair every source is drawn twice, and the tensor is estimated for every choice of one draw or the other. "
    "First order: the share of the variance that a source causes by itself; total: with its interactions; Shapley: "
    "interactions shared in equal parts, so that the shares add up to one. The tensor's variance is the sum over its "
    "nine entries. Closure: what the shares add up to over the ordinary sample variance. The figure after ± is a "
    "standard error. Every figure is in budget.csv."
)
BUDGET_ASSUMPTION = (
    "Shares are of the variance, the dispersion about the mean; the mean error (bias) of a source alone stands in a "
    "table of its own, since biases of several sources need not add up."
)
EXPECTED = (
    "Mean and standard deviation are those of the single runs; the deviation is the result's, and E_n is the deviation "
    "over the root of the sum of squares of both expanded uncertainties (k = 2): satisfactory up to 1 (ISO 13528)."
)
SOURCE = (
    "J.P. Barreto, L.E. Muñoz, “Low uncertainty method for inertia tensor identification”, Mechanical Systems and "
    "Signal Processing 68–69 (2016) 207–216: its simulated experiment, its Table 2 and its figures 2 to 5, beside the "
    "values that it prints."
)
SOURCE_NOTE = (
    "“source”: the printed value, from 10,000 repetitions. The source prints no mean error; ours stand in the summary."
)
INDEX = (
    "3σ is three standard deviations of the estimates over the trials, the source's index of uncertainty. It does not "
    "contain the mean error (mean of estimate minus truth), which therefore stands beside it everywhere. The figure "
    "after ± is a standard error, from the finite number of trials."
)
ASSUMPTIONS = (
    "The body is rigid. Its mass, the attitude of the load cell's axes and of the gyroscope's, the common clock and "
    "the sensors' scale factors are exact.",
    "Every error source is normal, with zero mean, and independent of the others and from axis to axis. A precision "
    "error is drawn afresh at each sample, white in time; a bias is drawn once an experiment.",
    "The platform runs the trajectory exactly. The error of the centre of gravity enters through the moment of the "
    "force that the estimator removes, not through the motion.",
    "The tensor is estimated by ordinary least squares over all samples; the angular acceleration is the numerical "
    "derivative of the measured angular velocity.",
    "“Load cell”, “CG” and “IMU” alone are computed from the same draws as the total; shares need not add up to one.",
)
PAPER_ASSUMPTIONS = (
    "The source does not state the sample rate, the duration, the path over the sphere, the height of the centre of "
    "gravity over the platform's centre, or any filtering. The values marked as inferred are those that reproduce its "
    "Table 2; they are not the source's words.",
    "The mean errors of the central difference follow from the inferred sample rate and from the absence of a filter. "
    "The source's own experiment, with I33 within 0.33 g·m² of its expected value, shows no such bias.",
)


def _computed(result: MonteCarloResult) -> str:
    names = {estimator: None for of_trajectory in result.breakdowns.values() for estimator in of_trajectory}
    return (
        f"{result.trials:,} trials with seed {result.seed}. Trajectories: {', '.join(result.breakdowns)}. "
        f"Estimators: {', '.join(names)}. In each trial every error source is drawn once; the tensor is then estimated "
        "with all sources together, with each group alone and with each source alone."
    )
