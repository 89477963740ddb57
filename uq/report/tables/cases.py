"""Cases by components: mean error and 3σ of groups and sources, by trials or by the law, in g·m²."""

from collections.abc import Callable, Iterable, Mapping, Sequence

import numpy as np

from identify.display.reporting import Drawing, stem
from identify.display.rounding import finest, fixed, significant, with_uncertainty
from identify.display.text_tables import Table
from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE
from uq.analysis.propagation.law_result import LawStatistics
from uq.analysis.sensitivity.budget_shares import MeanSquare
from uq.monte_carlo.campaign.statistics import Breakdown, ByTrajectory, OfCase, large_mean_error
from uq.report.drawing import drawing
from uq.report.figures.style import LINES

PAIR = ("trajectory", "estimator")
"""Heads of the columns that name a case of several trajectories and estimators."""
ALONE = "Alone, a part may scatter more than all do together, since errors act on one another."
"""The reason why a group's or source's 3σ may exceed the total's."""


def case_table(
    caption: str,
    names: Sequence[str],
    cases: Iterable[tuple[Sequence[str], Sequence[Sequence[str]]]],
    *,
    unit: str = "g·m²",
    last: Sequence[str] = (),
    note: str = "",
    long: bool = False,
) -> Table:
    """Return a table of cases by components: the rows of each case, which is named in the first of them.

    Args:
        caption: title of the table.
        names: heads of the columns that name a case.
        cases: names and rows of each, as :func:`rows_of` returns them.
        unit: head of the column of quantities.
        last: heads of columns behind the components.
        note: line below the table in a report.
        long: whether a terminal leaves the table out.
    """
    rows = [
        [*(key if k == 0 else [""] * len(key)), *row]
        for key, rows_of_case in cases
        for k, row in enumerate(rows_of_case)
    ]
    return Table(caption, [*names, unit, *COMPONENTS, *last], rows, note, long=long)


def rows_of(figures: OfCase | MeanSquare, total: OfCase | MeanSquare | None = None) -> list[list[str]]:
    """Return mean error and 3σ of the components as rows, with standard errors; of the law the textbook's 3σ, too.

    Args:
        figures: of a case.
        total: figures of all sources together, which say how many decimals matter; None: the case's own.
    """
    total = total or figures
    if isinstance(figures, LawStatistics):
        places = finest(GRAM_METRE * total.three_sigma)
        widths = {"3σ": figures.three_sigma, "3σ, textbook": figures.textbook_three_sigma}
        return [
            ["mean error", *(fixed(GRAM_METRE * x, places) for x in figures.mean_error)],
            *([name, *(significant(GRAM_METRE * x, 4) for x in values)] for name, values in widths.items()),
        ]
    places = finest(GRAM_METRE * total.mean_error_standard_error)
    return [
        [name, *grams(getattr(figures, key), getattr(figures, f"{key}_standard_error"), places)]
        for name, key in (("mean error", "mean_error"), ("3σ", "three_sigma"))
    ]


def grams(values: np.ndarray, errors: np.ndarray, places: int | None = None) -> list[str]:
    """Return figures [kg·m²] with their standard errors in g·m², to so many decimals at most."""
    return [with_uncertainty(GRAM_METRE * x, GRAM_METRE * u, places) for x, u in zip(values, errors, strict=True)]


def percent(share: float) -> str:
    """Return a share in per cent."""
    return significant(100 * share) if share >= 1e-4 else fixed(100 * share, 2)


def case_tables(figures: OfCase) -> list[Table]:
    """Return the two, of the law the textbook's 3σ, too."""
    return [case_table("", (), [((), rows_of(figures))])]


def breakdown_tables(breakdown: Breakdown) -> list[Table]:
    """Return mean error and 3σ of each group and source alone, and its share of the total's 3σ."""
    return [breakdown_table("", breakdown, {name: fixed(100 * breakdown.share(name), 0) for name in breakdown.cases})]


def breakdown_table(
    caption: str,
    breakdown: Breakdown,
    shares: Mapping[str, str],
    *,
    unit: str = "g·m²",
    note: str = "",
    named: Callable[[str], str] = str,
) -> Table:
    """Return a breakdown as a table, with the ``shares`` of its cases in text; ``named`` writes a case's name."""
    cases = []
    for name, figures in breakdown.cases.items():
        mean, sigma, *_ = rows_of(figures, breakdown.total)
        cases.append(((named(name),), [[*mean, ""], [*sigma, shares[name]]]))
    return case_table(caption, ("alone",), cases, unit=unit, last=("share %",), note=note)


def breakdown_drawings(result: ByTrajectory[Breakdown], how: str = "") -> list[Drawing]:
    """Return a figure of each trajectory and estimator: all errors together, each group and each source alone.

    Args:
        result: of a campaign or of the law.
        how: what their captions add, such as " by the law".
    """

    def figure(pair: tuple[str, str], parts: Breakdown) -> Drawing:
        many = len(parts.sources) > LINES
        shown = f"the {LINES} largest of {len(parts.sources)} sources" if many else "each source"
        parts_shown = f"all together, each group (orange) and {shown} (blue) alone"
        caption = f"{', '.join(pair)}: 3σ and mean error of each component{how}, {parts_shown}. {ALONE}"
        return drawing(stem("breakdown", *pair), caption, "campaign.contributions", parts.cases, (*parts.groups,)[1:])

    return [figure(pair, result[pair]) for pair in result.pairs()]


def verdict_on_mean_errors(result: ByTrajectory[Breakdown]) -> str:
    """Return with which estimators, on which trajectories, a mean error exceeds its 3σ."""
    return verdict_of_biased({pair: bool(large_mean_error("", result[pair].total)) for pair in result.pairs()})


def verdict_of_biased(biased: Mapping[tuple[str, str], bool]) -> str:
    """Return with which estimators, on which trajectories, a mean error exceeds its 3σ: whether, by these two names."""
    named: dict[bool, dict[str, list[str]]] = {True: {}, False: {}}
    for (trajectory, estimator), beyond_dispersion in biased.items():
        named[beyond_dispersion].setdefault(estimator, []).append(trajectory)
    beyond, within = (
        "; ".join(f"{estimator} ({', '.join(trajectories)})" for estimator, trajectories in named[which].items())
        for which in (True, False)
    )
    if not beyond:
        return "No mean error exceeds its 3σ."
    return f"Biased: {beyond}." + (f" Unbiased within 3σ: {within}." if within else "")
