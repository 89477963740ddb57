"""The view of the law of propagation: totals, groups and sources alone, and the law beside a Monte Carlo; in g·m²."""

from dataclasses import replace

from identify.display.reporting import Drawing, Section, section_of
from identify.display.text_tables import Table
from identify.floating_point import MESSAGE
from uq.analysis.propagation.law_result import LawResult
from uq.report.assumptions import source_assumptions
from uq.report.input_tables import source_tables
from uq.report.tables.cases import PAIR, breakdown_drawings, case_table, rows_of, verdict_on_mean_errors


def title(_: LawResult) -> str:
    """Return what the tables are of."""
    return "Law of propagation about the expected sums"


def tables(law: LawResult) -> list[Table]:
    """Return mean error, 3σ and the textbook's 3σ of all sources, and what each group and source does alone."""
    totals = [(pair, rows_of(law[pair].total)) for pair in law.pairs()]
    alone = [
        ((*pair, name.replace("_", " ")), rows_of(figures, law[pair].total)[:2])
        for pair in law.pairs()
        for name, figures in law[pair].cases.items()
    ]
    return [case_table("", PAIR, totals), case_table("", (*PAIR, "alone"), alone, long=True)]


def notes(law: LawResult) -> list[str]:
    """Return the warnings, a line each, but for that of the precision: Python gave it as the law was made."""
    return [f"attention: {text}" for text in law.warnings if text != MESSAGE]


def drawings(law: LawResult) -> list[Drawing]:
    """Return a figure of each breakdown, named as the Monte Carlo's, which shows the same."""
    return breakdown_drawings(law, " by the law")


def section(law: LawResult) -> Section:
    """Return its part of a report, with a table of sources whose figures can be changed in the page."""
    summary, alone = tables(law)
    return section_of(
        law, computed=[COMPUTED], findings=[f"By the law of propagation: {text}" for text in law.warnings],
        tables=[replace(summary, caption=title(law))],
        details=[replace(alone, caption="Each group and source alone, by the law"), *source_tables(law.provenance)],
        assumptions=[ASSUMPTION, *source_assumptions(law.provenance)],
        adjustable=[] if law.adjustable is None else [law.adjustable()],
        verdict=verdict_on_mean_errors(law),
    )  # fmt: skip


COMPUTED = (
    "The law of propagation (GUM) about the expected sums, to the second order; beside it the textbook's, of the first "
    "order about the noise-free run."
)

ASSUMPTION = (
    "The law takes errors for normal where their squares matter; it leaves out products of a constant error's and the "
    "noise's effects."
)
