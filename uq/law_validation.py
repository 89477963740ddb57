"""Does the law hold here? The clause 8 verdict on the law and on the textbook's, source by source, and why."""

from typing import NamedTuple

import numpy as np

from identify.inertia import COMPONENTS
from uq.campaign import GRAM_METRE, MonteCarloResult
from uq.coverage import Verdict, symmetric_interval, validate
from uq.law_result import LawResult, LawStatistics

WRONG_FACTOR = 2.0
"""By how much two standard deviations must differ to be named as the reason."""


class LawVerdict(NamedTuple):
    """The verdicts of JCGM 101, clause 8, on one case of one estimator."""

    trajectory: str
    estimator: str
    case: str
    """``total``, a group or a source."""
    law: Verdict
    textbook: Verdict
    why: str
    """Why the textbook's law is off; empty where it holds."""


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
    found = []
    for trajectory, estimator in law.pairs():
        breakdown = law[trajectory, estimator]
        number = list(result.breakdowns[trajectory]).index(estimator)
        for k, (case, statistics) in enumerate([*breakdown.groups.items(), *breakdown.sources.items()]):
            errors = result.errors[trajectory][:, number, k]
            interval = symmetric_interval(errors, probability)
            sigma = errors.std(axis=0, ddof=1)
            ours, textbook = (
                validate(*ends, interval, uncertainty=sigma, digits=digits)
                for ends in (statistics.coverage_interval(probability), statistics.textbook_interval(probability))
            )
            why = "" if np.all(textbook.holds) else reason(statistics)
            found.append(LawVerdict(trajectory, estimator, case, ours, textbook, why))
    return found


def reason(statistics: LawStatistics) -> str:
    """Return why the textbook's first-order law is off in one case, from what it leaves out."""
    sigma, textbook = statistics.three_sigma, statistics.textbook_three_sigma
    shift = np.abs(statistics.mean_error - statistics.textbook_value)
    parts = []
    small = np.flatnonzero(sigma > WRONG_FACTOR * textbook)
    if len(small):
        k = small[np.argmax(sigma[small])]
        parts.append(
            f"its 3σ of {COMPONENTS[k]} is {_figure(textbook[k])} against {_figure(sigma[k])} g·m²: "
            "terms quadratic in the error rule, which the first order leaves out"
        )
    moved = np.flatnonzero(shift > sigma / 3)
    if len(moved):
        k = moved[np.argmax(shift[moved])]
        parts.append(
            f"it takes the error's mean of {COMPONENTS[k]} for {_figure(statistics.textbook_value[k])}, "
            f"but it is {_figure(statistics.mean_error[k])} g·m²: squares of the error do not average out"
        )
    return "; ".join(parts) or "its expansion about the noise-free run misses part of the dispersion"


def _figure(value: float) -> str:
    return f"{GRAM_METRE * value:.3g}".replace("-", "−")
