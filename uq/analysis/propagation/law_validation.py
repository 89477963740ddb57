"""Does the law hold here? The clause 8 verdict on the law and on the textbook's, source by source, and why."""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from identify.display.reporting import Result
from identify.display.rounding import significant
from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE
from uq.analysis.propagation.law_result import LawResult, LawStatistics
from uq.monte_carlo.campaign.campaign_result import MonteCarloResult
from uq.monte_carlo.campaign.statistics import NO_SPREAD
from uq.monte_carlo.coverage.adaptive_procedure import numerical_tolerance
from uq.monte_carlo.coverage.coverage_intervals import Verdict, symmetric_interval, validate

PROBABILITY = 0.95
"""Coverage probability of the intervals that are compared."""
DIGITS = 1
"""Significant digits of the standard uncertainty that count (JCGM 101, 7.9.2)."""
WRONG_FACTOR = 2.0
"""Ratio of two standard deviations from which their difference is named as the reason."""
MANY_ERRORS = 5.0
"""Standard errors of the Monte Carlo from which it and the law differ by more than chance: 6e-7 of normal figures."""


class LawVerdict(NamedTuple):
    """The verdicts of JCGM 101, clause 8, on one case of one estimator."""

    trajectory: str
    estimator: str
    case: str
    """Name of the case: ``total``, a group or a source."""
    law: Verdict
    textbook: Verdict
    why: str
    """Reason why the textbook's law is rejected; empty where it is not."""


def validate_law(law: LawResult, result: MonteCarloResult) -> "LawValidation":
    """Compare the intervals of the law and of the textbook's first-order law with a Monte Carlo's.

    Args:
        law: of the experiment.
        result: a Monte Carlo of the same experiment, trajectories and estimators.
    """
    verdicts = []
    for trajectory, estimator in law.pairs():
        breakdown = law[trajectory, estimator]
        number = list(result.breakdowns[trajectory]).index(estimator)
        for k, (case, statistics) in enumerate([*breakdown.groups.items(), *breakdown.sources.items()]):
            errors = np.ascontiguousarray(result.errors[trajectory][:, number, k].T).T  # a component's side by side
            interval = symmetric_interval(errors, PROBABILITY, result.points)
            sigma = errors.std(axis=0, ddof=1)
            tolerance = np.maximum(numerical_tolerance(sigma, DIGITS), NO_SPREAD)
            ours, textbook = (
                validate(*ends, interval, tolerance)
                for ends in (statistics.coverage_interval(PROBABILITY), statistics.textbook_interval(PROBABILITY))
            )
            why = reason(statistics) if rejected(textbook).any() else ""
            verdicts.append(
                LawVerdict(trajectory=trajectory, estimator=estimator, case=case, law=ours, textbook=textbook, why=why)
            )
    return LawValidation(law, result, tuple(verdicts))


def rejected(verdict: Verdict) -> np.ndarray:
    """Return for which outputs the law is off by more than the tolerance and four standard errors of the interval."""
    return verdict.distance > verdict.tolerance + 2 * verdict.resolution


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
    return significant(GRAM_METRE * value)


def undecided(verdict: Verdict) -> np.ndarray:
    """Return for which outputs the Monte Carlo's own error exceeds the tolerance, so that it can but reject."""
    return ~rejected(verdict) & ((verdict.resolution > verdict.tolerance) | ~verdict.holds)


def words_of(verdict: Verdict) -> list[str]:
    """Return each component's verdict: holds, rejected, or open where there are too few trials to say."""
    off, unsure = rejected(verdict), undecided(verdict)
    return ["rejected" if no else "open" if few else "holds" for no, few in zip(off, unsure, strict=True)]


def standard_errors_apart(law: Any, result: Any, figure: str) -> np.ndarray:
    """Return the law's figure less the Monte Carlo's of one case, in standard errors of the Monte Carlo.

    Zero where they agree, and infinite where they do not though nothing scatters.
    """
    difference = getattr(law, figure) - getattr(result, figure)
    error = getattr(result, f"{figure}_standard_error")
    none = np.where(np.abs(difference) > NO_SPREAD, np.copysign(np.inf, difference), 0.0)
    return np.divide(difference, error, out=none, where=error > NO_SPREAD * 1e-3)


@dataclass(frozen=True, repr=False)
class LawValidation(Result):
    """The law beside a Monte Carlo of the same experiment, and the verdict of JCGM 101, clause 8, on both laws.

    Example: ``validate_law(law(experiment), montecarlo(experiment, trials=2000)).to_frame()``.
    """

    law: LawResult
    monte_carlo: MonteCarloResult
    verdicts: tuple[LawVerdict, ...]
    name: str = "law_validation"

    def records(self) -> list[dict[str, Any]]:
        """Return the verdict on each law's interval by case and component."""
        return [
            {"trajectory": v.trajectory, "estimator": v.estimator, "case": v.case, "component": component}
            | {"law": law, "textbook": textbook}
            for v in self.verdicts
            for component, law, textbook in zip(COMPONENTS, words_of(v.law), words_of(v.textbook), strict=True)
        ]

    def to_dict(self) -> dict[str, Any]:
        """Return its part of result.json: the verdict on each law by case and component."""
        return {
            "probability": PROBABILITY,
            "digits": DIGITS,
            "verdicts": [
                {
                    "trajectory": v.trajectory, "estimator": v.estimator, "case": v.case, "why": v.why,
                    **{name: dict(zip(COMPONENTS, words_of(verdict), strict=True))
                       for name, verdict in (("law", v.law), ("textbook", v.textbook))},
                }
                for v in self.verdicts
            ],
        }  # fmt: skip
