"""The outcome of a campaign: its figures, findings and the content of result.json.

With the coverage in result.json (intervals, the ellipsoid of the six components, in g·m²), and averages over components
as the paper's Table 2 and figure 5 state them, with their standard errors.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np

from identify.display.reporting import Result
from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE
from uq.monte_carlo.campaign.spread_ratio import SpreadComparison, compared
from uq.monte_carlo.campaign.statistics import Breakdown, ByTrajectory, Statistics, in_gram_metre, large_mean_error
from uq.monte_carlo.coverage.adaptive_procedure import Stability
from uq.monte_carlo.coverage.coverage_intervals import CoverageInterval, Kind, shortest_interval, symmetric_interval
from uq.monte_carlo.coverage.coverage_regions import EllipsoidalRegion, ellipsoidal_region
from uq.monte_carlo.trials.trial_loop import finite_trials
from uq.sources.quasi_random import Points, of_replicates, standard_error

if TYPE_CHECKING:
    from xarray import DataArray


@dataclass(frozen=True, repr=False)
class MonteCarloResult(ByTrajectory[Breakdown[Statistics]], Result):
    """The outcome of a campaign. ``result["T1", "central"]`` is one :class:`Breakdown`.

    Example: ``montecarlo(Experiment.load("barreto2016"), trials=200).to_frame().loc[("T1", "central", "total")]``.
    """

    unit_of_columns = "kg·m²"

    kind = "inertia montecarlo"
    trials: int
    seed: int
    nominal: np.ndarray
    """The true tensor, packed [kg·m²]."""
    breakdowns: Mapping[str, Mapping[str, Breakdown[Statistics]]]
    """Breakdown of each case, by trajectory, then by estimator."""
    warnings: tuple[str, ...]
    provenance: Mapping[str, Any]
    errors: Mapping[str, np.ndarray] = field(compare=False)
    """Estimate minus truth of every trial, by trajectory: (trials, estimators, cases, 6) [kg·m²]."""
    stability: Mapping[str, Mapping[str, Stability]] | None = field(default=None, compare=False)
    """Stability that an adaptive campaign reached [kg·m²], by trajectory and estimator; None: the number of trials was
    given."""
    points: Points = "random"
    """Kind of points that the trials were drawn from: random or quasi-random."""

    def total_errors(self, trajectory: str, estimator: str) -> np.ndarray:
        """Return estimate minus truth of every trial with all sources together, (trials, 6) [kg·m²]."""
        self.checked((trajectory, estimator))
        index = list(self.breakdowns[trajectory]).index(estimator)
        return self.errors[trajectory][:, index, 0]

    def interval(
        self, trajectory: str, estimator: str, probability: float = 0.95, kind: Kind = "symmetric"
    ) -> CoverageInterval:
        """Return the coverage intervals of the six components' errors, all sources together [kg·m²]."""
        coverage_interval = symmetric_interval if kind == "symmetric" else shortest_interval
        return coverage_interval(self.total_errors(trajectory, estimator), probability, self.points)

    def against(self, trajectory: str, estimator: str | None = None) -> SpreadComparison:
        """Return 3σ of every other trajectory and estimator over that of one, from the same draws.

        Args:
            trajectory: of which each other one with the same estimator is compared.
            estimator: of the reference; None: each pair has its own.

        Raises:
            KeyError: there is none of this name; the message names those that there are.
        """
        pairs = self.pairs()
        others = {pair: (trajectory, estimator or pair[1]) for pair in pairs}
        for pair in set(others.values()):
            self.checked(pair)
        return compared(
            {pair: self.total_errors(*pair) for pair in pairs},
            {pair: other for pair, other in others.items() if pair != other},
            ("trajectory", "estimator"), ", ".join(filter(None, (trajectory, estimator))), self.points,
        )  # fmt: skip

    def to_dict(self) -> dict[str, Any]:
        """Return the content of result.json, in g·m²."""
        return {
            **self.form(),
            "trials": self.trials,
            "seed": self.seed,
            "unit": "g*m^2",
            "adaptive": stability_record(self.stability),
            "trajectories": {
                trajectory: {
                    estimator: {
                        **breakdown.to_dict(),
                        "failed_trials": breakdown.failed,
                        "coverage": coverage_record(self.total_errors(trajectory, estimator), self.points),
                    }
                    for estimator, breakdown in breakdowns.items()
                }
                for trajectory, breakdowns in self.breakdowns.items()
            },
            "warnings": self.findings(),
            "provenance": dict(self.provenance),
        }

    def findings(self) -> list[str]:
        """Return what a reader must not miss: warnings, failed trials, mean errors larger than their 3σ."""
        findings = list(self.warnings)
        for trajectory, estimator in self.pairs():
            breakdown = self[trajectory, estimator]
            if breakdown.failed:
                findings.append(
                    f"{trajectory}, {estimator}: {breakdown.failed} of {self.trials} trials failed and are left out."
                )
            findings += large_mean_error(f"{trajectory}, {estimator}", breakdown.total)
        return findings

    def to_xarray(self) -> "DataArray":
        """Return estimate minus truth of every trial [kg·m²], (trajectory, trial, estimator, case, component).

        A case is ``total``, a group alone or a source alone; the coordinate ``true_tensor`` is the truth by component.
        A trial that could not be solved is NaN.

        Raises:
            ModuleNotFoundError: xarray is not installed.
        """
        try:
            from xarray import DataArray
        except ImportError:
            raise ModuleNotFoundError("xarray is missing for to_xarray(): pip install xarray") from None
        first = next(iter(self.breakdowns.values()))
        names: dict[str, Any] = {
            "trajectory": list(self.breakdowns), "trial": np.arange(self.trials), "estimator": list(first),
            "case": list(next(iter(first.values())).cases), "component": list(COMPONENTS),
        }  # fmt: skip
        samples = np.stack([self.errors[name] for name in self.breakdowns])
        about = {"units": "kg m2", "long_name": "estimate minus truth", "seed": self.seed, "points": self.points}
        truth = {"true_tensor": ("component", self.nominal)}
        return DataArray(samples, names | truth, tuple(names), "error", about)


PROBABILITY = 0.95


def coverage_record(errors: np.ndarray, points: Points = "random") -> dict[str, Any]:
    """Return intervals and ellipsoid of a total's errors (trials, 6) [kg·m²]; None for what the trials do not give.

    The ellipsoid's standard errors are those of random trials; of quasi-random ones they are too large.
    """
    return {
        "probability": PROBABILITY,
        "symmetric": _interval(symmetric_interval(errors, PROBABILITY, points)),
        "shortest": _interval(shortest_interval(errors, PROBABILITY, points)),
        "ellipsoid": _ellipsoid(errors),
    }


def stability_record(stability: Mapping[str, Mapping[str, Stability]] | None) -> dict[str, Any] | None:
    """Return what an adaptive campaign was asked and what it reached; None for one that is not adaptive."""
    if stability is None:
        return None
    verdicts = [verdict for trajectory in stability.values() for verdict in trajectory.values()]
    return {
        "digits": verdicts[0].goal.digits if verdicts[0].goal.tolerance is None else None,
        "stable": all(verdict.stable for verdict in verdicts),
        "blocks": verdicts[0].blocks,
        "trajectories": {
            trajectory: {
                name: {"tolerance": in_gram_metre(verdict.tolerance), "reached": in_gram_metre(verdict.reached)}
                for name, verdict in estimators.items()
            }
            for trajectory, estimators in stability.items()
        },
    }


def _interval(interval: CoverageInterval) -> dict[str, dict[str, float | None]]:
    names = ("low", "low_standard_error", "high", "high_standard_error")
    return {name: in_gram_metre(getattr(interval, name)) for name in names}


def _ellipsoid(errors: np.ndarray) -> dict[str, Any] | None:
    try:
        region: EllipsoidalRegion = ellipsoidal_region(errors, PROBABILITY)
    except ValueError:  # too few trials, or components of which one follows from the others
        return None
    return {
        "centre": in_gram_metre(region.centre),
        "covariance": (GRAM_METRE**2 * region.covariance).tolist(),
        "factor": region.factor.value,
        "factor_standard_error": region.factor.standard_error,
        "factor_if_normal": region.normal_factor,
        "coverage": region.coverage.value,
        "coverage_standard_error": region.coverage.standard_error,
    }


class Average(NamedTuple):
    """Averages over some components of the total [kg·m²]."""

    three_sigma: float
    three_sigma_standard_error: float
    mean_error: float
    """Average magnitude of the mean errors."""
    mean_error_standard_error: float


def average(result: MonteCarloResult, trajectory: str, estimator: str, components: tuple[int, ...]) -> Average:
    """Return the average 3σ over components and the average magnitude of their mean errors.

    The standard errors are taken from the trials themselves (each trial's first-order influence on the average; its
    means over replicates of quasi-random trials), so that they hold for components that go together. Trials that failed
    are left out.
    """
    errors = result.total_errors(trajectory, estimator)[:, list(components)]
    good, _ = finite_trials(errors)
    if len(good) < 2:
        return Average(np.nan, np.nan, np.nan, np.nan)
    mean, sigma = good.mean(0), good.std(0, ddof=1)
    spread = 3 * ((errors - mean) ** 2 - sigma**2) / np.where(sigma > 0, 2 * sigma, 1)
    influence = np.stack([spread.mean(1), (np.sign(mean) * (errors - mean)).mean(1)], axis=1)
    if result.points == "random":
        figures, _ = finite_trials(influence)
    else:
        figures = of_replicates(lambda trials: finite_trials(trials)[0].mean(0), influence)
    sigma_standard_error, mean_standard_error = map(float, standard_error(figures))
    return Average(3 * float(sigma.mean()), sigma_standard_error, float(np.abs(mean).mean()), mean_standard_error)
