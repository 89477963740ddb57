"""The view of the law's validation: the law beside a Monte Carlo, and the verdicts of JCGM 101, clause 8."""

from collections.abc import Sequence

import numpy as np

from identify.reporting import Section, section_of
from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE
from identify.rounding import fixed, rounded
from identify.text_tables import Table
from uq.campaign.campaign_result import MonteCarloResult
from uq.coverage.coverage_intervals import Verdict
from uq.propagation.law_result import LawResult
from uq.propagation.law_validation import PROBABILITY, LawValidation, rejected, words_of
from uq.report.tables.cases import PAIR, grams


def title(_: LawValidation) -> str:
    """Return what is compared."""
    return "Law of propagation beside the Monte Carlo, all sources together"


def tables(result: LawValidation) -> list[Table]:
    """Return the comparison, then how many of the laws' intervals hold: of all cases and components."""
    rows = []
    for pair in dict.fromkeys((v.trajectory, v.estimator) for v in result.verdicts):
        verdicts = [v for v in result.verdicts if (v.trajectory, v.estimator) == pair]
        rows.append([*pair, _counts([v.law for v in verdicts]), _counts([v.textbook for v in verdicts])])
    question = f"Do the laws' {100 * PROBABILITY:g} % intervals hold? (JCGM 101, clause 8)"
    return [*beside(result.law, result.monte_carlo), Table(question, [*PAIR, "law", "textbook's law"], rows, NOTE)]


def notes(result: LawValidation) -> list[str]:
    """Return the findings, and why the textbook's law is rejected for all sources together, a line each."""
    why = [
        f"{v.trajectory}, {v.estimator}: the textbook's law is rejected, since {v.why}"
        for v in result.verdicts
        if v.case == "total" and v.why
    ]
    return [f"attention: {text}" for text in findings(result)] + why


def findings(result: LawValidation) -> list[str]:
    """Return in which cases the law itself is rejected."""
    return [
        f"{v.trajectory}, {v.estimator}: the law's interval is rejected for {v.case.replace('_', ' ')} "
        f"({', '.join(c for c, word in zip(COMPONENTS, words_of(v.law), strict=True) if word == 'rejected')})"
        for v in result.verdicts
        if rejected(v.law).any()
    ]


def section(result: LawValidation) -> Section:
    """Return its part of a report: every case among the details."""
    return section_of(result, findings=findings(result), details=[_by_case(result)])


def _by_case(result: LawValidation) -> Table:
    """The six components' verdicts on each law, and why the textbook's is rejected, by case."""
    rows = [
        [v.trajectory, v.estimator, v.case.replace("_", " "), _counts([v.law]), _counts([v.textbook]), v.why]
        for v in result.verdicts
    ]
    head = [*PAIR, "alone", "law", "textbook's", "why rejected"]
    return Table("The laws' intervals, case by case", head, rows, wrap=True)


def _counts(verdicts: Sequence[Verdict]) -> str:
    words = [word for verdict in verdicts for word in words_of(verdict)]
    counts = {word: words.count(key) for key, word in (("holds", "hold"), ("rejected", "rejected"), ("open", "open"))}
    return ", ".join(f"{count} {word}" for word, count in counts.items() if count)


def beside(law: LawResult, result: MonteCarloResult) -> list[Table]:
    """Return the law beside a Monte Carlo of the same experiment, all sources together, a table a pair.

    ``apart`` is their difference, law minus Monte Carlo, in the Monte Carlo's standard errors.
    """
    tables = []
    for trajectory, estimator in law.pairs():
        ours, theirs = law[trajectory, estimator].total, result[trajectory, estimator].total
        columns: list[list[str]] = []
        for name in ("mean_error", "three_sigma"):
            by_law, by_trials = getattr(ours, name), getattr(theirs, name)
            error = getattr(theirs, f"{name}_standard_error")
            apart = np.divide(by_law - by_trials, error, out=np.zeros(6), where=error > 0)
            columns.append(list(map(rounded, GRAM_METRE * by_law, GRAM_METRE * error)))
            columns += [grams(by_trials, error), [fixed(value, 2) for value in apart]]
        rows = [list(row) for row in zip(COMPONENTS, *columns, strict=True)]
        tables.append(Table(f"{trajectory}, {estimator}", HEAD_BESIDE, rows, BESIDE_NOTE))
    return tables


HEAD_BESIDE = ("g·m²", "mean error, law", "Monte Carlo", "apart", "3σ, law", "Monte Carlo", "apart")
BESIDE_NOTE = "All sources together. apart: law minus Monte Carlo, in standard errors of the Monte Carlo."
NOTE = (
    "Counted over all sources together, each group and each source alone, and six components; to one digit of the "
    "standard uncertainty. open: too few trials to say."
)
