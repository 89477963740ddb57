"""Does the law hold here? The clause 8 verdict on the law and on the textbook's, source by source, and why."""

from typing import NamedTuple

import numpy as np

from identify.rigid_body.inertia import COMPONENTS
from identify.text_tables import text_table
from uq.campaign.campaign import GRAM_METRE, MonteCarloResult
from uq.coverage.coverage_intervals import Verdict, numerical_tolerance, symmetric_interval, validate
from uq.propagation.law_result import LawResult, LawStatistics, beside

WRONG_FACTOR = 2.0
"""By how much two standard deviations must differ to be named as the reason."""
ROUNDING = 1e-12
"""kg·m² that rounding may leave where nothing acts."""


class LawVerdict(NamedTuple):
    """The verdicts of JCGM 101, clause 8, on one case of one estimator."""

    trajectory: str
    estimator: str
    case: str
    """``total``, a group or a source."""
    law: Verdict
    textbook: Verdict
    why: str
    """Why the textbook's law is rejected; empty where it is not."""


def verdicts(
    law: LawResult, result: MonteCarloResult, *, probability: float = 0.95, digits: int = 1
) -> list[LawVerdict]:
    """Compare the intervals of the law and of the textbook's first-order law with a Monte Carlo's.

    Args:
        law: of the experiment.
        result: a Monte Carlo of the same experiment, trajectories and estimators.
        probability: coverage probability.
        digits: significant digits of the standard uncertainty that count (JCGM 101, 7.9.2).
    """
    verdicts_of_cases = []
    for trajectory, estimator in law.pairs():
        breakdown = law[trajectory, estimator]
        number = list(result.breakdowns[trajectory]).index(estimator)
        for k, (case, statistics) in enumerate([*breakdown.groups.items(), *breakdown.sources.items()]):
            errors = result.errors[trajectory][:, number, k]
            interval = symmetric_interval(errors, probability, result.points)
            sigma = errors.std(axis=0, ddof=1)
            tolerance = np.maximum(numerical_tolerance(sigma, digits), ROUNDING)
            ours, textbook = (
                validate(*ends, interval, tolerance=tolerance)
                for ends in (statistics.coverage_interval(probability), statistics.textbook_interval(probability))
            )
            why = reason(statistics) if rejected(textbook).any() else ""
            verdicts_of_cases.append(LawVerdict(trajectory, estimator, case, ours, textbook, why))
    return verdicts_of_cases


def rejected(verdict: Verdict) -> np.ndarray:
    """Return for which outputs the law is off by more than the tolerance and four standard errors of the interval."""
    return np.maximum(np.abs(verdict.d_low), np.abs(verdict.d_high)) > verdict.tolerance + 2 * verdict.resolution


def reason(statistics: LawStatistics) -> str:
    """Return why the textbook's first-order law is off in one case, from what it leaves out."""
    sigma, textbook = statistics.three_sigma, statistics.textbook_three_sigma
    shift = np.abs(statistics.mean_error - statistics.textbook_value)
    reasons = []
    small = np.flatnonzero(sigma > WRONG_FACTOR * textbook)
    if len(small):
        k = small[np.argmax(sigma[small])]
        reasons.append(
            f"its 3σ of {COMPONENTS[k]} is {_figure(textbook[k])} against {_figure(sigma[k])} g·m²: "
            "terms quadratic in the error rule, which the first order leaves out"
        )
    shifted = np.flatnonzero(shift > sigma / 3)
    if len(shifted):
        k = shifted[np.argmax(shift[shifted])]
        reasons.append(
            f"it takes the error's mean of {COMPONENTS[k]} for {_figure(statistics.textbook_value[k])}, "
            f"but it is {_figure(statistics.mean_error[k])} g·m²: squares of the error do not average out"
        )
    return "; ".join(reasons) or "the errors are not normal, or their dispersion differs by less than a factor of two"


def _figure(value: float) -> str:
    return f"{GRAM_METRE * value:.3g}".replace("-", "−")


def verdict_rows(listed: list[LawVerdict]) -> tuple[list[str], list[list[str]]]:
    """Return head and rows: the six components' verdicts on each law, and why the textbook's is rejected."""
    rows = [
        [v.trajectory, v.estimator, v.case.replace("_", " "), _counts(v.law), _counts(v.textbook), v.why]
        for v in listed
    ]
    return ["trajectory", "estimator", "alone", "law", "textbook's", "why rejected"], rows


def _counts(verdict: Verdict) -> str:
    holds, off = np.count_nonzero(verdict.holds), np.count_nonzero(rejected(verdict))
    counts = {
        "hold": holds,
        "rejected": off,
        "too few trials": np.size(verdict.holds) - holds - off,
    }
    return ", ".join(f"{count} {name}" for name, count in counts.items() if count)


def law_report(law: LawResult, result: MonteCarloResult) -> str:
    """Return the law beside a Monte Carlo of the same experiment, and the verdict of JCGM 101, clause 8."""
    return "\n".join(
        [
            "",
            "Law of propagation about the expected sums, beside the Monte Carlo, all sources together",
            text_table(*beside(law, result)),
            "",
            "Do the laws' 95 % intervals hold? (JCGM 101, clause 8, one digit of the standard uncertainty)",
            text_table(*verdict_rows(verdicts(law, result))),
        ]
    )
