"""Ratio of two dispersions from the same draws: of two motions, two estimators, or two values of a sweep.

What the draws have in common cancels in the ratio, whose standard error is taken from the pairs of trials: the first
order influence of each pair on the logarithm, ``½ (d²/s² - d'²/s'²)``. Of normal errors with correlation ρ that is
``√((1 - ρ²)/n)``, of independent campaigns ``√(1/n)``.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import NormalDist
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from identify.display.reporting import Result
from identify.rigid_body.inertia import COMPONENTS
from uq.monte_carlo.trials.trial_loop import finite_trials
from uq.sources.quasi_random import Points, of_replicates, standard_error

LEVEL = 0.05
"""Chance that six equal dispersions are called different, in one component or more."""
FACTOR = NormalDist().inv_cdf(1 - LEVEL / 2 / len(COMPONENTS))
"""Standard errors from which a component's ratio differs from 1 (Bonferroni): 2.64."""


class SpreadRatio(NamedTuple):
    """Ratio of two standard deviations, component by component."""

    value: Float[np.ndarray, "6"]
    standard_error: Float[np.ndarray, "6"]

    @property
    def differs(self) -> Bool[np.ndarray, "6"]:
        """Whether each ratio differs from 1, at 5 % for the six together."""
        return np.asarray(np.abs(np.log(self.value)) * self.value > FACTOR * self.standard_error)


def spread_ratio(
    errors: Float[np.ndarray, "n 6"], reference: Float[np.ndarray, "n 6"], points: Points = "random"
) -> SpreadRatio:
    """Return the standard deviation of errors over that of a reference, trial by trial from the same draws.

    Args:
        errors: estimate minus truth of each trial [kg·m²]; a trial that failed is left out of both.
        reference: of the same trials [kg·m²].
        points: kind of points that the trials were drawn from.
    """
    good, _ = finite_trials(np.hstack([errors, reference]))
    if len(good) < 4:
        return SpreadRatio(np.full(len(COMPONENTS), np.nan), np.full(len(COMPONENTS), np.nan))
    variance = good.var(axis=0, ddof=1)
    with np.errstate(invalid="ignore", divide="ignore"):
        halves = ((good - good.mean(axis=0)) ** 2 / variance - 1) / 2
        influence = halves[:, : len(COMPONENTS)] - halves[:, len(COMPONENTS) :]
        value = np.sqrt(variance[: len(COMPONENTS)] / variance[len(COMPONENTS) :])
    if points != "random":
        influence = of_replicates(lambda trials: np.asarray(trials.mean(axis=0)), influence)
    return SpreadRatio(value, value * standard_error(influence))


@dataclass(frozen=True, repr=False)
class SpreadComparison(Result):
    """3σ of each case over that of a reference, from the same draws.

    Example: ``montecarlo(Experiment.load("barreto2016"), trials=500).against("T1").to_frame()``.
    """

    name = "against"
    pure = frozenset({"ratio", "standard_error", "differs"})

    reference: str
    """Name of the case that all others are compared with."""
    heads: tuple[str, ...]
    """Heads of the names of a case, such as trajectory and estimator."""
    ratios: Mapping[tuple[str, ...], SpreadRatio]
    """Ratios of each other case, by its names."""
    trials: int

    def records(self) -> list[dict[str, Any]]:
        """Return ratio, standard error and whether it differs from 1, of each case and component."""
        return [
            dict(zip(self.heads, names, strict=True))
            | {"component": component, "ratio": float(value), "standard_error": float(error), "differs": bool(differs)}
            for names, ratio in self.ratios.items()
            for component, value, error, differs in zip(
                COMPONENTS, ratio.value, ratio.standard_error, ratio.differs, strict=True
            )
        ]

    def to_dict(self) -> dict[str, Any]:
        """Return its part of result.json."""
        rows = [
            {name: None if isinstance(x, float) and not np.isfinite(x) else x for name, x in record.items()}
            for record in self.records()
        ]
        return {"reference": self.reference, "trials": self.trials, "level": LEVEL, "rows": rows}


def compared(
    cases: Mapping[tuple[str, ...], np.ndarray],
    references: Mapping[tuple[str, ...], tuple[str, ...]],
    heads: Sequence[str],
    reference: str,
    points: Points,
) -> SpreadComparison:
    """Return the ratios of cases to others of the same draws.

    Args:
        cases: errors of each, (trials, 6) [kg·m²].
        references: of each case that is compared, the names of the one that it is compared with.
        heads: what the names are of.
        reference: what a reader calls the references.
        points: kind of points that the trials were drawn from.
    """
    ratios = {names: spread_ratio(cases[names], cases[other], points) for names, other in references.items()}
    trials = len(next(iter(cases.values())))
    return SpreadComparison(reference=reference, heads=tuple(heads), ratios=ratios, trials=trials)
