"""The view of the law's validation: the law beside a Monte Carlo, and the verdicts of JCGM 101, clause 8."""

from collections.abc import Sequence

import numpy as np

from identify.display.reporting import Section, section_of
from identify.display.rounding import fixed, rounded, significant, with_uncertainty
from identify.display.text_tables import Table
from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE
from uq.analysis.propagation.law_result import LawResult
from uq.analysis.propagation.law_validation import (
    MANY_ERRORS,
    PROBABILITY,
    LawValidation,
    LawVerdict,
    rejected,
    standard_errors_apart,
    undecided,
    words_of,
)
from uq.monte_carlo.campaign.campaign_result import MonteCarloResult
from uq.monte_carlo.coverage.coverage_intervals import Verdict
from uq.report.tables.cases import PAIR, grams


def title(_: LawValidation) -> str:
    """Return what is compared."""
    return "Law of propagation beside the Monte Carlo, all sources together"


def tables(result: LawValidation) -> list[Table]:
    """Return the comparison, then how many of the laws' intervals hold: of all cases and components."""
    rows = []
    for pair in result.law.pairs():
        verdicts = _of_pair(result, *pair)
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
    return [f"attention: {text}" for text in findings(result)] + open_intervals(result) + why


def findings(result: LawValidation) -> list[str]:
    """Return where law and Monte Carlo differ, and where the law's intervals are rejected: a line a pair each."""
    return [text for pair in result.law.pairs() for text in (*_apart(result, *pair), *_rejected(result, *pair))]


def open_intervals(result: LawValidation) -> list[str]:
    """Return how many intervals of the law this many trials cannot judge, and the furthest from it; a line a pair."""
    lines = []
    for pair in result.law.pairs():
        verdicts = _of_pair(result, *pair)
        few = np.array([undecided(v.law) for v in verdicts])
        if few.any():
            tolerance, resolution = (
                np.array([getattr(v.law, name) for v in verdicts]) for name in ("tolerance", "resolution")
            )
            k, c = np.unravel_index(np.argmax(np.where(few, resolution / tolerance, 0)), few.shape)
            lines.append(
                f"{', '.join(pair)}: {few.sum()} of {few.size} of the law's intervals stay open, as the number of "
                f"trials does not decide: the Monte Carlo's own ends, of {COMPONENTS[c]} of {_named(verdicts[k])}, are "
                f"known to ± {_grams(resolution[k, c])} g·m², where the tolerance is {_grams(tolerance[k, c])}"
            )
    return lines


def _apart(result: LawValidation, trajectory: str, estimator: str) -> list[str]:
    """The figures of all sources together that differ by more than chance."""
    ours, theirs = (x[trajectory, estimator].total for x in (result.law, result.monte_carlo))
    texts = []
    for figure, words in (("mean_error", "mean error"), ("three_sigma", "3σ")):
        apart = np.abs(standard_errors_apart(ours, theirs, figure))
        by_law, by_trials = getattr(ours, figure), getattr(theirs, figure)
        written = grams(by_trials, getattr(theirs, f"{figure}_standard_error"))
        texts += [
            f"{words} of {COMPONENTS[k]} {_grams(by_law[k])}, not {written[k]} g·m²"
            for k in np.flatnonzero(apart >= MANY_ERRORS)
        ]
    if not texts:
        return []
    return [
        f"{trajectory}, {estimator}: law and Monte Carlo are {MANY_ERRORS:.0f} standard errors or more apart; rely on "
        f"the Monte Carlo: {', '.join(texts)}"
    ]


def _rejected(result: LawValidation, trajectory: str, estimator: str) -> list[str]:
    """The intervals that are rejected, and which is off by most of its tolerance."""
    verdicts = _of_pair(result, trajectory, estimator)
    off = np.array([rejected(v.law) for v in verdicts])
    if not off.any():
        return []
    excess = np.array([v.law.distance / v.law.tolerance for v in verdicts])
    k, c = np.unravel_index(np.argmax(np.where(off, excess, 0)), off.shape)
    cases = ", ".join(
        f"{_named(v)} ({', '.join(c for c, no in zip(COMPONENTS, row, strict=True) if no)})"
        for v, row in zip(verdicts, off, strict=True)
        if row.any()
    )
    distance, resolution, tolerance = (
        x[c] for x in (verdicts[k].law.distance, verdicts[k].law.resolution, verdicts[k].law.tolerance)
    )
    return [
        f"{trajectory}, {estimator}: {off.sum()} of {off.size} of the law's {100 * PROBABILITY:g} % intervals are "
        f"rejected (JCGM 101, 8.1): {cases}; the furthest, {COMPONENTS[c]} of {_named(verdicts[k])}, has an end "
        f"off by {with_uncertainty(GRAM_METRE * distance, GRAM_METRE * resolution / 2)} g·m², where the tolerance is "
        f"{_grams(tolerance)}"
    ]


def _of_pair(result: LawValidation, trajectory: str, estimator: str) -> list[LawVerdict]:
    return [v for v in result.verdicts if (v.trajectory, v.estimator) == (trajectory, estimator)]


def _named(verdict: LawVerdict) -> str:
    return verdict.case.replace("_", " ")


def _grams(value: float) -> str:
    return significant(GRAM_METRE * value, 2)


def section(result: LawValidation) -> Section:
    """Return its part of a report: every case among the details."""
    return section_of(result, findings=findings(result), details=[_by_case(result)])


def _by_case(result: LawValidation) -> Table:
    """The six components' verdicts on each law, and why the textbook's is rejected, by case."""
    rows = [
        [v.trajectory, v.estimator, _named(v), _counts([v.law]), _counts([v.textbook]), v.why] for v in result.verdicts
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
            apart = standard_errors_apart(ours, theirs, name)
            columns.append(list(map(rounded, GRAM_METRE * by_law, GRAM_METRE * error)))
            columns += [grams(by_trials, error), [fixed(value, 2) for value in apart]]
        rows = [list(row) for row in zip(COMPONENTS, *columns, strict=True)]
        tables.append(Table(f"{trajectory}, {estimator}", HEAD_BESIDE, rows, BESIDE_NOTE))
    return tables


HEAD_BESIDE = ("g·m²", "mean error, law", "Monte Carlo", "apart", "3σ, law", "Monte Carlo", "apart")
BESIDE_NOTE = "All sources together. apart: law minus Monte Carlo, in standard errors of the Monte Carlo."
NOTE = (
    "Counted over all sources together, each group and each source alone, and six components; to one digit of the "
    "standard uncertainty. open: the Monte Carlo's own error exceeds that tolerance, so that its number of trials does "
    "not decide."
)
