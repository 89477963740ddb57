"""An identified tensor beside an expected one: deviation, E_n, chi-squared, and conventions that would explain it."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from identify.display.reporting import Result, plain
from identify.results.identification_result import Identification
from identify.rigid_body.inertia import COMPONENTS
from identify.rigid_body.inertial_parameters import PARAMETERS, Tensor, by_component
from uq.bodies.normalised_error import USUAL, joint_chi_squared, normalised_error
from uq.bodies.other_conventions import Suspicion, suspicions
from uq.bodies.reference import Reference


@dataclass(frozen=True, repr=False)
class Comparison(Result):
    """A measured tensor and an expected one, about the centre of gravity, in the body frame.

    Example: ``compare(identification, load_reference("body.toml")).to_frame()["normalised_error"]``.
    """

    unit_of_columns = "kg·m²"
    pure = frozenset({"relative_error", "normalised_error", "normalised_error_with_undeclared"})

    result: Identification
    reference: Reference
    name: str = "expected"

    @property
    def provenance(self) -> Mapping[str, Any]:
        """The identification's provenance."""
        return self.result.provenance

    @property
    def measured(self) -> Tensor:
        """The identified tensor."""
        return self.result.parameters.tensor

    @cached_property
    def suspicions(self) -> tuple[Suspicion, ...]:
        """Conventions of the reference's figures that would explain the deviation."""
        return suspicions(self.measured, self.reference)

    @property
    def factor(self) -> np.ndarray:
        """Coverage factors of mass, centre of gravity and tensor: 2, or those of the result's intervals if larger."""
        return np.fmax(self.result.coverage_factors, USUAL)

    @property
    def expected(self) -> Tensor:
        """The expected tensor."""
        return self.reference.parameters.tensor

    @property
    def deviation(self) -> np.ndarray:
        """Measured minus expected [kg·m²]."""
        return self.measured.inertia - self.expected.inertia

    @property
    def relative_error(self) -> np.ndarray:
        """Deviation over the expected value; NaN where that is zero within its expanded uncertainty."""
        value, expanded = self.expected.inertia, 2 * self.expected.standard_uncertainty
        apart = np.abs(value) > np.maximum(expanded, 1e-12 * np.abs(value).max())
        return np.where(apart, self.deviation / np.where(apart, value, 1.0), np.nan)

    @property
    def normalised_error(self) -> np.ndarray:
        """E_n of each component: satisfactory up to 1 (ISO 13528:2022, 9.7; ISO/IEC 17043)."""
        return normalised_error(self.measured, self.expected, self.factor[4:])

    @property
    def normalised_error_with_undeclared(self) -> np.ndarray:
        """E_n of each component by half the conventional bound in place of U; NaN: not known."""
        bound = self.result.conventional_bound
        if bound is None:
            return np.full(6, np.nan)
        half = np.fmax(np.ptp(bound, axis=1) / 2, self.factor[4:] * self.measured.standard_uncertainty)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = self.deviation / np.hypot(half, USUAL * self.expected.standard_uncertainty)
        return np.where(self.deviation == 0, 0.0, ratio)

    @property
    def joint(self) -> tuple[float, int, float]:
        """Chi-squared of the deviation of all components, its degrees of freedom and probability."""
        return joint_chi_squared(self.measured, self.expected)

    @property
    def repeats(self) -> np.ndarray:
        """Packed tensor of each run that identifies the whole tensor by itself, (k, 6) [kg·m²]."""
        alone = [run.inertia - self.result.taken_off for run in self.result.runs if run.alone]
        return np.array(alone).reshape(-1, 6)

    @property
    def mean(self) -> np.ndarray:
        """Mean of the repeats [kg·m²]; NaN without any."""
        return self.repeats.mean(axis=0) if len(self.repeats) else np.full(6, np.nan)

    @property
    def standard_deviation(self) -> np.ndarray:
        """Standard deviation of the repeats, (6,) [kg·m²]; NaN for fewer than two."""
        return self.repeats.std(axis=0, ddof=1) if len(self.repeats) > 1 else np.full(6, np.nan)

    @property
    def other_errors(self) -> dict[str, float]:
        """E_n of mass and centre of gravity, where both sides know them and the result their uncertainty.

        A mass that is declared without one is no measurement, and has no E_n.
        """
        return {
            name: float((value - expected) / np.hypot(self.factor[k] * u, USUAL * u_expected))
            for k, name, value, u, expected, u_expected in self.known_to_both()
            if u > 0
        }

    def known_to_both(self) -> Iterator[tuple[int, str, float, float, float, float]]:
        """Yield index and name of mass and coordinates that both sides know; value and standard uncertainty of both."""
        result, reference = self.result.parameters, self.reference.parameters
        measured, expected = (zip(ten.values, ten.standard_uncertainty, strict=True) for ten in (result, reference))
        for k, (name, ours, theirs) in enumerate(zip(PARAMETERS[:4], measured, expected, strict=False)):
            if np.isfinite([*ours, theirs[0]]).all():
                yield k, name, float(ours[0]), float(ours[1]), float(theirs[0]), float(theirs[1])

    def records(self) -> list[dict[str, Any]]:
        """Return the figures of each component [kg·m²]."""
        columns = self._figures()
        return [
            {"component": name} | {key: values[k] for key, values in columns.items()}
            for k, name in enumerate(COMPONENTS)
        ]

    def _figures(self) -> dict[str, np.ndarray]:
        return {
            "value": self.expected.inertia, "standard_uncertainty": self.expected.standard_uncertainty,
            "mean_of_runs": self.mean, "standard_deviation_of_runs": self.standard_deviation,
            "deviation": self.deviation, "relative_error": self.relative_error,
            "normalised_error": self.normalised_error,
            "normalised_error_with_undeclared": self.normalised_error_with_undeclared,
        }  # fmt: skip

    def to_dict(self) -> dict[str, Any]:
        """Return what result.json says, in kg·m²; what does not exist is null."""
        statistic, freedom, probability = self.joint
        return {
            "name": self.reference.name,
            "kind": self.reference.kind,
            "file": self.reference.file,
            "sha256": self.reference.sha256,
            **{key: plain(by_component(values)) for key, values in self._figures().items()},
            "chi_squared": {"value": statistic, "degrees_of_freedom": freedom, "probability": probability},
            "normalised_error_of_mass_and_cg": self.other_errors,
            "contributions": {
                key: plain(dict(zip(PARAMETERS, np.sqrt(np.maximum(variance, 0)), strict=True)))
                for key, variance in self.reference.contributions.items()
            },
            "suspicions": [plain(suspicion) for suspicion in self.suspicions],
            "warnings": list(self.reference.warnings),
            "document": dict(self.reference.document),
        }


def compare(result: Identification, reference: Reference) -> Comparison:
    """Compare an identified tensor with an expected one.

    The deviation is that of the result, with its uncertainty; mean and standard deviation of the single runs stand
    beside it. Errors of result and reference are taken as independent.

    Args:
        result: the identification.
        reference: the reference body.
    """
    return Comparison(result, reference)
