"""Results of the law of propagation for an experiment: typed, as result.json."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
import scipy

from identify.display.reporting import Result, Shown
from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE
from uq.monte_carlo.campaign.statistics import Breakdown, ByTrajectory, in_gram_metre


@dataclass(frozen=True, repr=False)
class LawStatistics(Shown):
    """The law's results for one case, in kg·m², in the order of ``COMPONENTS``."""

    mean_error: np.ndarray
    """Expected estimate minus truth: the bias."""
    covariance: np.ndarray
    """Covariance of the six components [(kg·m²)²]."""
    textbook_value: np.ndarray
    """The error of the estimate from the noise-free run: what the textbook's first order takes for the mean error."""
    textbook_mean_error: np.ndarray
    """The textbook's second-order mean, ``½ tr(H Σ)`` about the noise-free run."""
    textbook_covariance: np.ndarray
    """The textbook's ``J Σ Jᵀ`` about the noise-free run."""

    standard_uncertainty: np.ndarray
    """Standard uncertainty of the GUM: less than the standard deviation where a source is Student's t, which enters
    with its scale."""
    degrees_of_freedom: np.ndarray
    """Effective degrees of freedom of ``standard_uncertainty`` (GUM G.4)."""

    mean_error_standard_error = three_sigma_standard_error = np.full(len(COMPONENTS), np.nan)
    """The law has no standard errors."""

    def shifted(self, error: np.ndarray) -> "LawStatistics":
        """Return the same with another error of the estimate, that is no random one [kg·m²]."""
        means = {name: getattr(self, name) + error for name in ("mean_error", "textbook_value", "textbook_mean_error")}
        return replace(self, **means)

    def coverage_interval(self, probability: float = 0.95) -> tuple[np.ndarray, np.ndarray]:
        """Return the ends of the estimate's error, ``mean error ± k u``, k from Student's t (GUM G.3)."""
        half = scipy.special.stdtrit(self.degrees_of_freedom, (1 + probability) / 2) * self.standard_uncertainty
        return self.mean_error - half, self.mean_error + half

    def textbook_interval(self, probability: float = 0.95) -> tuple[np.ndarray, np.ndarray]:
        """Return those of the textbook's first-order law, about the error of the noise-free run's estimate."""
        half = scipy.special.ndtri((1 + probability) / 2) * np.sqrt(np.diag(self.textbook_covariance))
        return self.textbook_value - half, self.textbook_value + half

    @property
    def three_sigma(self) -> np.ndarray:
        """Three standard deviations."""
        return 3 * np.sqrt(np.diag(self.covariance))

    @property
    def three_rms(self) -> np.ndarray:
        """Three times the root mean square error, ``3 √(σ² + b²)``, b the mean error."""
        return 3 * np.sqrt(np.diag(self.covariance) + self.mean_error**2)

    @property
    def textbook_three_sigma(self) -> np.ndarray:
        """Three standard deviations of the textbook's first-order law."""
        return 3 * np.sqrt(np.diag(self.textbook_covariance))

    def to_dict(self) -> dict[str, Any]:
        """Return the figures by component, in g·m²; the covariance in (g·m²)², rows in the order of the components."""
        figures = {
            name: in_gram_metre(getattr(self, name))
            for name in ("mean_error", "three_sigma", "textbook_mean_error", "textbook_three_sigma")
        }
        covariance = GRAM_METRE**2 * self.covariance
        return figures | {"covariance": covariance.tolist() if np.isfinite(covariance).all() else None}


@dataclass(frozen=True, repr=False)
class LawResult(ByTrajectory[Breakdown[LawStatistics]], Result):
    """The law of propagation for an experiment. ``result["T1", "central"]`` is one :class:`Breakdown`.

    Example: ``law(Experiment.load("barreto2016")).to_frame().loc[("T1", "central", "total")]``.
    """

    unit_of_columns = "kg·m²"

    name = "law"
    kind = "inertia law"
    nominal: np.ndarray
    """The true tensor, packed [kg·m²]."""
    breakdowns: Mapping[str, Mapping[str, Breakdown[LawStatistics]]]
    """Breakdown of each case, by trajectory, then by estimator."""
    warnings: tuple[str, ...]
    """Warnings, among them every trajectory and estimator of which a mean error exceeds its 3σ."""
    inputs: Callable[[], Mapping[str, Any]] = field(repr=False, compare=False)
    """Makes the provenance when it is asked for: it takes as long as the law of a changed figure."""
    adjustable: Callable[[], Mapping[str, Any]] | None = field(default=None, repr=False, compare=False)
    """Makes the numbers from which a page redraws the law for other figures; None: it cannot."""

    @cached_property
    def provenance(self) -> Mapping[str, Any]:
        """Provenance of the result: inputs, versions, machine, time."""
        return self.inputs()

    def to_dict(self) -> dict[str, Any]:
        """Return the content of result.json, in g·m²: shaped as the Monte Carlo's, without standard errors."""
        return {
            **self.form(),
            "unit": "g*m^2",
            "trajectories": {
                trajectory: {estimator: breakdown.to_dict() for estimator, breakdown in breakdowns.items()}
                for trajectory, breakdowns in self.breakdowns.items()
            },
            "warnings": list(self.warnings),
            "provenance": dict(self.provenance),
        }
