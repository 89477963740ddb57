"""Statistics of trials: mean error and dispersion of each case, by trajectory and estimator, with standard errors."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeVar, runtime_checkable

import numpy as np

from identify.display.reporting import Result, Shown, plain
from identify.display.rounding import significant
from identify.exceptions import UnknownNameError
from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE
from identify.rigid_body.inertial_parameters import by_component
from uq.monte_carlo.gram_sums.cases import Case
from uq.monte_carlo.trials.trial_loop import finite_trials
from uq.sources.quasi_random import Points, of_replicates, standard_error

NO_SPREAD = 1e-12
"""kg·m² that rounding may leave where nothing acts or scatters."""


@dataclass(frozen=True, repr=False)
class Statistics(Shown):
    """Statistics of the trials of one case: six components in kg·m², in the order of ``COMPONENTS``."""

    mean_error: np.ndarray
    """Mean of estimate minus truth: the bias."""
    mean_error_standard_error: np.ndarray
    three_sigma: np.ndarray
    """Three standard deviations of the estimates: the paper's index of uncertainty."""
    three_sigma_standard_error: np.ndarray
    """Standard error of ``three_sigma`` from the fourth moment of the estimates, which holds for any distribution."""

    @classmethod
    def of(cls, errors: np.ndarray, points: Points = "random") -> "Statistics":
        """Return the statistics of errors, shape (trials, 6), leaving out trials that failed (NaN).

        The standard errors of quasi-random trials come from the spread of their replicates.
        """
        good, _ = finite_trials(errors)
        n = len(good)
        if n < 2:
            nothing = np.full(errors.shape[1], np.nan)
            return cls(good.mean(0) if n else nothing, nothing, nothing, nothing)
        if points != "random":
            mean, sigma = _mean_and_sigma(good)
            mean_standard_error, sigma_standard_error = standard_error(of_replicates(_mean_and_sigma, errors))
            return cls(mean, mean_standard_error, 3 * sigma, 3 * sigma_standard_error)
        mean = good.mean(0)
        squares = np.square(good - mean)
        variance = squares.sum(0) / (n - 1)
        fourth = np.square(squares).mean(0)
        variance_of_variance = np.maximum(fourth - variance**2 * (n - 3) / (n - 1), 0) / n
        with np.errstate(invalid="ignore", divide="ignore"):
            sigma_standard_error = np.where(variance > 0, np.sqrt(variance_of_variance) / (2 * np.sqrt(variance)), 0.0)
        return cls(mean, np.sqrt(variance / n), 3 * np.sqrt(variance), 3 * sigma_standard_error)

    def to_dict(self) -> dict[str, dict[str, float | None]]:
        """Return the four figures by component, in g·m²; a figure that does not exist is None."""
        names = ("mean_error", "mean_error_standard_error", "three_sigma", "three_sigma_standard_error")
        return {name: in_gram_metre(getattr(self, name)) for name in names}


def in_gram_metre(values: np.ndarray) -> dict[str, float | None]:
    """Return figures [kg·m²] by component, in g·m²; what is not finite is None."""
    return plain(by_component(GRAM_METRE * values))


def _mean_and_sigma(errors: np.ndarray) -> np.ndarray:
    """Mean and standard deviation of the trials that did not fail, (2, 6)."""
    errors, _ = finite_trials(errors)
    if len(errors) < 2:
        return np.full((2, errors.shape[1]), np.nan)
    return np.stack([errors.mean(0), errors.std(0, ddof=1)])


@runtime_checkable
class OfCase(Protocol):
    """Common interface of a case's figures: :class:`Statistics` of trials, or the law's figures."""

    @property
    def mean_error(self) -> np.ndarray:
        """Mean of estimate minus truth of the six components [kg·m²]."""

    @property
    def mean_error_standard_error(self) -> np.ndarray:
        """Standard error of the mean errors [kg·m²]; NaN where they are exact."""

    @property
    def three_sigma(self) -> np.ndarray:
        """Three standard deviations of the six components [kg·m²]."""

    def to_dict(self) -> dict[str, Any]:
        """Return the figures by component, in g·m²."""


CaseFigures = TypeVar("CaseFigures", bound=OfCase)


@dataclass(frozen=True, repr=False)
class Breakdown(Result, Generic[CaseFigures]):
    """One estimator on one trajectory: what each group and each source does to the answer, by trials or by the law.

    Example: ``law(Experiment.load("barreto2016"))["T1", "central"].to_frame().loc[("total", "I33")]``.
    """

    unit_of_columns = "kg·m²"

    groups: Mapping[str, CaseFigures]
    """Figures of each case: ``total`` (all sources) and each group alone."""
    sources: Mapping[str, CaseFigures]
    """Figures of each source alone, by its name."""
    failed: int = 0
    """Trials in which some case could not be solved; they are left out of that case."""

    @classmethod
    def of(cls, cases: Sequence[Case], figures: Iterable[CaseFigures], failed: int = 0) -> "Breakdown[CaseFigures]":
        """Sort the figures of all cases into groups and sources."""
        groups: dict[str, CaseFigures] = {}
        sources: dict[str, CaseFigures] = {}
        for case, case_figures in zip(cases, figures, strict=True):
            kind, _, name = case.name.partition(":")
            (sources if kind == "source" else groups)[name or kind] = case_figures
        return cls(groups, sources, failed)

    @property
    def total(self) -> CaseFigures:
        """All sources together."""
        return self.groups["total"]

    @property
    def cases(self) -> Mapping[str, CaseFigures]:
        """``total``, each group alone and each source alone."""
        return {**self.groups, **self.sources}

    def share(self, group: str) -> float:
        """Return a group's (or source's) share: its 3σ alone over the total's, averaged over the components.

        Raises:
            KeyError: there is none of this name; the message names those that there are.
        """
        if group not in self.cases:
            raise UnknownNameError(group, self.cases)
        alone = self.cases[group]
        with np.errstate(invalid="ignore", divide="ignore"):
            return float(np.mean(alone.three_sigma / self.total.three_sigma))

    def records(self) -> list[dict[str, Any]]:
        """Return the figures of each case and component, in kg·m²."""
        return [
            {"case": name, "component": component}
            | {key: plain(float(getattr(figures, key)[k])) for key in figures.to_dict() if key != "covariance"}
            for name, figures in self.cases.items()
            for k, component in enumerate(COMPONENTS)
        ]

    def to_dict(self) -> dict[str, Any]:
        """Return the figures of every group and source by component, in g·m²."""
        return {
            "groups": {name: figures.to_dict() for name, figures in self.groups.items()},
            "sources": {name: figures.to_dict() for name, figures in self.sources.items()},
        }


def breakdown(cases: Sequence[Case], errors: np.ndarray, points: Points = "random") -> Breakdown[Statistics]:
    """Return the statistics of every case of one estimator.

    Args:
        cases: what acts in each.
        errors: estimate minus truth, (trials, cases, 6) [kg·m²]; NaN where a case could not be solved.
        points: what the trials were drawn from.
    """
    by_case = np.ascontiguousarray(np.moveaxis(errors, 0, -1))  # trials side by side, for fast sums
    statistics = (Statistics.of(case_errors.T, points) for case_errors in by_case)
    return Breakdown.of(cases, statistics, failed=finite_trials(errors)[1])


def large_mean_error(where: str, total: OfCase) -> list[str]:
    """Return a warning where mean errors exceed their 3σ, which does not contain them; nothing where none does.

    Where nothing is drawn, there is no 3σ to compare with.

    Args:
        where: trajectory, estimator.
        total: all sources together.
    """
    ratio = np.abs(total.mean_error) / np.where(total.three_sigma > NO_SPREAD, total.three_sigma, np.nan)
    excess = [
        f"{COMPONENTS[k]} {significant(GRAM_METRE * total.mean_error[k])} g·m² ({significant(ratio[k])} × 3σ)"
        for k in np.flatnonzero(ratio > 1)
    ]
    return [f"{where}: the mean error exceeds 3σ: {', '.join(excess)}."] if excess else []


Content = TypeVar("Content", bound=Shown)


class ByTrajectory(Generic[Content]):
    """Base of the results of campaigns, laws and budgets, which hold one entry for each trajectory and estimator."""

    breakdowns: Mapping[str, Mapping[str, Content]]
    """Entries by trajectory, then by estimator."""

    def __getitem__(self, key: tuple[str, str] | str) -> Content:
        trajectory, estimator = self.checked(key)
        return self.breakdowns[trajectory][estimator]

    def checked(self, key: tuple[str, str] | str) -> tuple[str, str]:
        """Return a key under which there is something.

        Raises:
            KeyError: there is nothing; the message names what there is.
        """
        if not isinstance(key, tuple) or key not in self.pairs():
            raise UnknownNameError(key, self.pairs())
        return key

    def pairs(self) -> list[tuple[str, str]]:
        """Return every trajectory with every estimator."""
        return [(trajectory, estimator) for trajectory, names in self.breakdowns.items() for estimator in names]

    def records(self) -> list[dict[str, Any]]:
        """Return the records of every trajectory and estimator, which these two name."""
        return [
            {"trajectory": trajectory, "estimator": estimator, **record}
            for trajectory, estimator in self.pairs()
            for record in self[trajectory, estimator].records()
        ]

    def _ipython_key_completions_(self) -> list[tuple[str, str]]:
        return self.pairs()
