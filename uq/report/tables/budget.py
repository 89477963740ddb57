"""The views of a budget: shares of the variance, mean errors, and how much of the mean square is bias."""

import numpy as np

from identify.display.reporting import Drawing, Section, section_of, stem
from identify.display.rounding import finest, with_uncertainty
from identify.display.text_tables import Table
from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE
from uq.analysis.sensitivity.budget_shares import FEW_PAIRS, TENSOR, BudgetResult, Effects, SourceBudget
from uq.report.assumptions import source_assumptions
from uq.report.drawing import drawing
from uq.report.input_tables import source_tables
from uq.report.tables.cases import case_table, grams, rows_of

SMALL = 5e-4
"""Share of the tensor's variance below which sources are counted together; budget.csv holds all."""


def title(result: BudgetResult) -> str:
    """Return what the tables are of."""
    return f"Budget, {result.trials:,} pairs of trials × {result.choices} choices of draws, seed {result.seed}"


def tables(result: BudgetResult) -> list[Table]:
    """Return each budget's shares of the whole tensor's variance."""
    return [of_tensor(result[pair], f"{', '.join(pair)}: shares of the tensor's variance") for pair in result.pairs()]


def overview(result: BudgetResult) -> list[Table]:
    """Return each budget's shares of the tensor and of the components, and its mean errors."""
    shown = []
    for pair in result.pairs():
        budget = result[pair]
        shown += [of_tensor(budget, ", ".join(pair)), shares_by_component(budget), mean_errors(budget)]
    return shown


def notes(result: BudgetResult) -> list[str]:
    """Return verdicts and findings, a line each."""
    return [*_verdicts(result), *(f"attention: {text}" for text in findings(result))]


def _verdicts(result: BudgetResult) -> list[str]:
    """The culprit of each budget, and how much of its error is bias, in a sentence each."""
    return [f"{', '.join(pair)}: {verdict(result[pair])}" for pair in result.pairs()]


def findings(result: BudgetResult) -> list[str]:
    """Return what a reader must not miss: warnings, failed trials, shares that do not add up."""
    findings = list(result.warnings)
    if result.trials < FEW_PAIRS:
        findings.append(
            f"{result.trials} pairs of trials are few: the standard errors of the shares come out too small; take "
            f"{FEW_PAIRS} or more."
        )
    for pair in result.pairs():
        failed, where = result[pair].failed, ", ".join(pair)
        if failed:
            findings.append(f"{where}: {failed} of {result.trials} pairs of trials failed and are left out.")
        if not result[pair].closes:
            findings.append(f"{where}: the shares do not add up to the sample variance: take more trials.")
    return findings


def drawings(result: BudgetResult) -> list[Drawing]:
    """Return the whole tensor of every pair, then each budget by component."""
    budgets = {pair: result[pair] for pair in result.pairs()}
    caption = "Shapley shares by component and of the tensor, and bias and dispersion in the mean square."
    return [
        drawing("budget", OVERVIEW, "budget.overview", budgets),
        *(
            drawing(stem("budget", *pair), f"{', '.join(pair)}: {caption}", "budget.shares", budget)
            for pair, budget in budgets.items()
        ),
    ]


def section(result: BudgetResult) -> Section:
    """Return its part of a report."""
    pairs = f"{result.trials:,} pairs of trials with seed {result.seed}."
    return section_of(
        result, title="Budget of an inertia tensor's uncertainty",
        computed=[f"{pairs} {COMPUTED}", " ".join(_verdicts(result))], findings=findings(result),
        details=_details(result), assumptions=[ASSUMPTION, *source_assumptions(result.provenance)],
    )  # fmt: skip


def _details(result: BudgetResult) -> list[Table]:
    """Each budget's shares by component and mean errors, and the sources as declared."""
    shown = []
    for pair in result.pairs():
        budget, where = result[pair], ", ".join(pair)
        caption = f"{where}: shares by component"
        shown += [shares_by_component(budget, kind, caption) for kind in ("shapley", "first", "total")]
        shown.append(mean_errors(budget, f"{where}: mean errors"))
    return [*shown, *source_tables(result.provenance)]


def pair_tables(budget: SourceBudget) -> list[Table]:
    """Return the shares of the whole tensor's variance."""
    return [of_tensor(budget)]


def pair_notes(budget: SourceBudget) -> list[str]:
    """Return the verdict."""
    return [verdict(budget)]


def verdict(budget: SourceBudget) -> str:
    """Return the culprit, and how much of the error is bias, in a sentence."""
    shapley, p = budget.sources.shapley, budget.sources.players.index(budget.culprit)
    share = _percent(shapley.generalised[p], shapley.generalised_standard_error[p])
    square = budget.mean_square
    bias = _percent(square.tensor_bias_share, square.tensor_bias_share_standard_error)
    alone = {name: float(np.nansum(s.mean_error**2)) for name, s in budget.sources.alone.items()}
    worst = max(alone, key=lambda name: alone[name])
    return (
        f"{_name(budget.culprit)} causes {share} % of the tensor's variance; {bias} % of its mean squared error "
        f"is bias{f', most of it from {_name(worst)}' if square.tensor_bias_share > 0.05 else ''}."
    )


def of_tensor(budget: SourceBudget, caption: str = "") -> Table:
    """Return the shares of the whole tensor's variance, in per cent, the largest first."""
    rows = []
    for label, effects in _kinds(budget):
        kinds = (effects.first, effects.total, effects.shapley)
        small = 0
        for p in _by_size(effects):
            if not label and max(abs(i.generalised[p]) for i in kinds) < SMALL:
                small += 1
                continue
            cells = [_percent(i.generalised[p], i.generalised_standard_error[p]) for i in kinds]
            rows.append([f"{label}{_name(effects.players[p])}", *cells])
        if small:
            rows.append([f"{small} more, below {100 * SMALL:g} each", "", "", ""])
        if not label:
            rows.append(["sum of sources", *(_percent(i.sum[1], np.nan) for i in kinds)])
    return Table(caption, ["% of the tensor's variance", *KINDS.values()], rows)


def shares_by_component(budget: SourceBudget, quantity: str = "shapley", caption: str = "") -> Table:
    """Return the shares of each component's variance: ``first``, ``total`` or ``shapley``."""
    cases = []
    for label, effects in _kinds(budget):
        indices = getattr(effects, quantity)
        for p in _by_size(effects):
            cells = map(_percent, indices.value[p], indices.standard_error[p])
            cases.append(((), [[f"{label}{_name(effects.players[p])}", *cells]]))
        if not label:
            cases.append(((), [["sum of sources", *(_percent(value, np.nan) for value in indices.sum[0])]]))
    cases.append(((), [["closure", *map(_percent, budget.closure, budget.closure_standard_error)]]))
    return case_table(caption, (), cases, unit=f"{KINDS[quantity]}, % of the variance")


def mean_errors(budget: SourceBudget, caption: str = "") -> Table:
    """Return the mean errors, g·m²: each source and group alone, and all together."""
    square = budget.mean_square
    places = finest(GRAM_METRE * square.mean_error_standard_error)
    total, width = rows_of(square)
    shares = [*square.bias_share, square.tensor_bias_share]
    errors = [*square.bias_share_standard_error, square.tensor_bias_share_standard_error]
    rows = [
        ["no source: the estimator", *grams(budget.without, np.zeros(len(COMPONENTS)), places), ""],
        *(
            [f"{label}{_name(name)}", *rows_of(s, square)[0][1:], ""]
            for label, effects in _kinds(budget)
            for name, s in effects.alone.items()
        ),
        ["all sources", *total[1:], ""],
        ["3σ of all sources", *width[1:], ""],
        ["bias, % of the mean square", *map(_percent, shares, errors)],
    ]
    return case_table(caption, (), [((), rows)], unit="mean error alone, g·m²", last=(TENSOR,))


def _kinds(budget: SourceBudget) -> tuple[tuple[str, Effects], tuple[str, Effects]]:
    return ("", budget.sources), ("group ", budget.groups)


def _by_size(effects: Effects) -> list[int]:
    """Numbers of the players, the one with the largest share of the tensor's variance first."""
    return sorted(range(len(effects.players)), key=lambda p: -effects.shapley.generalised[p])


def _name(name: str) -> str:
    return name.replace("_", " ").replace("omega", "ω").replace("r cg", "r CG")


def _percent(value: float, standard_error: float) -> str:
    """A share in per cent, to a thousandth at most."""
    return with_uncertainty(100 * value, 100 * standard_error, places=3)


KINDS = {"first": "first order", "total": "total", "shapley": "Shapley"}
"""Quantities that are shared out, in words."""
OVERVIEW = "The whole tensor: Shapley shares of its variance, and how much of its mean squared error is bias."
COMPUTED = (
    "In each pair every source is drawn twice, and the tensor is estimated for every choice of one draw or the other. "
    "First order: the share of the variance that a source causes by itself; total: with its interactions; Shapley: "
    "interactions shared in equal parts, so that the shares add up to one. The tensor's variance is the sum over its "
    "nine entries. Closure: what the shares add up to over the ordinary sample variance. The figure after ± is a "
    "standard error. Every figure is in budget.csv."
)
ASSUMPTION = (
    "Shares are of the variance, the dispersion about the mean; the mean error (bias) of a source alone stands in a "
    "table of its own, since biases of several sources need not add up."
)
