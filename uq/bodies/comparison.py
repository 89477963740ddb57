"""An identified tensor beside an expected one: deviation, E_n, chi-squared, and conventions that would explain it."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from identify.reporting import Result, Section
from identify.results.identification_result import Identification
from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE
from identify.rigid_body.inertial_parameters import PARAMETERS, Tensor, by_component
from identify.rounding import exact, fixed, rounded, significant, with_uncertainty
from identify.text_tables import Table
from uq.bodies.normalised_error import USUAL, joint_chi_squared, normalised_error
from uq.bodies.other_conventions import Suspicion, suspicions
from uq.bodies.reference import Reference

MOST = 6
"""Uncertain quantities of a reference that its table lists; result.json holds all."""
LEAST_CHANCE = 0.0001
"""Least probability that is printed as a figure."""


@dataclass(frozen=True, repr=False)
class Comparison(Result):
    """A measured tensor and an expected one, about the centre of gravity, in the body frame.

    Example: ``compare(identification, load_reference("body.toml")).to_frame()["normalised_error"]``.
    """

    reference: Reference
    measured: Tensor
    repeats: np.ndarray
    """Packed tensor of each run that identifies the whole tensor by itself, (k, 6) [kg·m²]."""
    suspicions: tuple[Suspicion, ...]
    mass: tuple[float, float] | None = None
    """Measured mass and its standard uncertainty [kg]; None: not known."""
    centre: tuple[np.ndarray, np.ndarray] | None = None
    """Measured centre of gravity from Q in B and its standard uncertainty [m]."""
    factor: np.ndarray = field(default_factory=lambda: np.full(10, USUAL))
    """Coverage factors of mass, centre of gravity and tensor: 2, or those of the result's intervals where larger."""
    provenance: Mapping[str, Any] = field(default_factory=dict)
    name: str = "expected"

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
    def joint(self) -> tuple[float, int, float]:
        """Chi-squared of the deviation of all components, its degrees of freedom and probability."""
        return joint_chi_squared(self.measured, self.expected)

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
            for k, name, value, u, expected, u_expected in self._beside()
            if u > 0
        }

    def _beside(self) -> Iterator[tuple[int, str, float, float, float, float]]:
        """Index and name of mass and coordinates that both sides know; value and standard uncertainty of both."""
        ten = self.reference.parameters
        centre = [None] * 3 if self.centre is None else list(zip(*self.centre, strict=True))
        for k, (name, pair) in enumerate(zip(PARAMETERS[:4], [self.mass, *centre], strict=True)):
            if pair is not None and np.isfinite(ten.values[k]):
                yield k, name, *pair, float(ten.values[k]), float(ten.standard_uncertainty[k])

    def _declared_otherwise(self) -> list[str]:
        """Return the quantities that the experiment declares as exact with other values than the reference's."""
        lines = []
        for k, name, value, u, expected, u_expected in self._beside():
            unit, scale = ("kg", 1.0) if k == 0 else ("mm", 1e3)
            if u == 0 and abs(value - expected) > USUAL * u_expected:
                said = f"{exact([scale * value])[0]} {unit}, declared without an uncertainty"
                theirs = with_uncertainty(scale * expected, scale * u_expected)
                lines.append(f"{name} is {said} (no E_n); {self.reference.name} has {theirs} {unit}")
        return lines

    def findings(self) -> list[str]:
        """Return what a reader must not miss."""
        explanations = [
            f"the deviation from {self.reference.name} vanishes if {suspicion.text}" for suspicion in self.suspicions
        ]
        beyond = [name for name, e in zip(COMPONENTS, self.normalised_error, strict=True) if abs(e) > 1]
        beyond += [name for name, e in self.other_errors.items() if abs(e) > 1]
        disagree = f"{', '.join(beyond)} differ{'s' * (len(beyond) == 1)} from {self.reference.name} beyond the "
        return [
            *self.reference.warnings,
            *([f"{disagree}expanded uncertainties (|E_n| > 1)"] if beyond else []),
            *self._declared_otherwise(),
            *explanations,
        ]

    def title(self) -> str:
        """Return what the table is of."""
        return f"Expected: {self.reference.name} ({self.reference.kind})"

    def tables(self) -> list[Table]:
        """Return the comparison, in g·m²."""
        head = [
            "g·m²", "expected", "U (k = 2)", "mean of runs", "standard deviation", "measured", "U", "deviation",
            "relative %", "E_n",
        ]  # fmt: skip
        columns = (
            self.expected.inertia, 2 * self.expected.standard_uncertainty, self.mean, self.standard_deviation,
            self.measured.inertia, self.factor[4:] * self.measured.standard_uncertainty, self.deviation,
        )  # fmt: skip
        rows = []
        for k, name in enumerate(COMPONENTS):
            value, half, mean, spread, measured, wide, deviation = (GRAM_METRE * float(column[k]) for column in columns)
            both = float(np.hypot(half, wide)) / USUAL
            figures = [
                rounded(value, half), rounded(half, half), rounded(mean, spread), rounded(spread, spread),
                rounded(measured, wide), rounded(wide, wide), rounded(deviation, both),
            ]  # fmt: skip
            relative, error = fixed(100 * self.relative_error[k], 2), fixed(self.normalised_error[k], 2)
            rows.append([name, *figures, relative, error])
        return [Table(f"Expected: {self.reference.name}, g·m²", head, rows, f"{self.summary()}.")]

    def overview(self) -> list[Table]:
        """Return the same, below the title."""
        return [replace(table, caption="") for table in self.tables()]

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
        }  # fmt: skip

    def notes(self) -> list[str]:
        """Return the joint verdict and the findings, a line each."""
        return [self.summary(), *(f"warning: {text}" for text in self.findings())]

    def contribution_tables(self) -> list[Table]:
        """Return what makes the expected moments uncertain, largest first, in g·m²; none where nothing does."""
        variances = self.reference.contributions
        largest = sorted(variances, key=lambda name: -float(variances[name][4:].sum()))[:MOST]
        u = {name: GRAM_METRE * np.sqrt(np.maximum(variances[name][4:], 0.0)) for name in largest}
        rows = [[name, *(significant(x, 2) for x in values)] for name, values in u.items()]
        title = "What makes the expected tensor uncertain: standard uncertainty, g·m²"
        return [Table(title, ["quantity", *COMPONENTS], rows)] if variances else []

    def section(self) -> Section:
        """Return its part of a report."""
        reference = self.reference
        return Section(
            "Expected values",
            [f"Beside what is expected of {reference.name}, from its {reference.kind}. {EXPECTED}"],
            self.findings(),
            self.tables(),
            details=self.contribution_tables(),
            assumptions=["The errors of the result and of the expected value are independent."],
            provenance={**self.provenance, "expected": {"file": reference.file, "sha256": reference.sha256}},
        )

    def summary(self) -> str:
        """Return the joint verdict in one line."""
        statistic, freedom, probability = self.joint
        others = "".join(f"; E_n of {name} {fixed(e, 2)}" for name, e in self.other_errors.items())
        if not freedom:
            return f"no uncertainty on either side: no E_n{others}"
        chance = significant(probability, 2) if probability >= LEAST_CHANCE else f"below {LEAST_CHANCE}"
        together = f"chi-squared {significant(statistic)}, {freedom} degrees of freedom, P {chance}"
        return f"all components together: {together}{others}"

    def to_dict(self) -> dict[str, Any]:
        """Return what result.json says, in kg·m²; what does not exist is null."""
        statistic, freedom, probability = self.joint
        return {
            "name": self.reference.name,
            "kind": self.reference.kind,
            "file": self.reference.file,
            "sha256": self.reference.sha256,
            **{key: _nulled(by_component(values)) for key, values in self._figures().items()},
            "chi_squared": {"value": statistic, "degrees_of_freedom": freedom, "probability": probability},
            "normalised_error_of_mass_and_cg": self.other_errors,
            "contributions": {
                key: _nulled(dict(zip(PARAMETERS, np.sqrt(np.maximum(variance, 0)).tolist(), strict=True)))
                for key, variance in self.reference.contributions.items()
            },
            "suspicions": [
                {"cause": suspicion.cause, "text": suspicion.text, "remaining": suspicion.remaining}
                for suspicion in self.suspicions
            ],
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
    ten = result.parameters
    u = ten.standard_uncertainty
    mass = (float(ten.mass), float(u[0])) if np.isfinite(ten.mass) and np.isfinite(u[0]) else None
    alone = [run.inertia - result.taken_off for run in result.runs if run.alone]
    return Comparison(
        reference=reference, measured=ten.tensor, repeats=np.array(alone).reshape(-1, 6),
        suspicions=suspicions(ten.tensor, reference), mass=mass, centre=(np.asarray(ten.r_cg), u[1:4]),
        factor=np.fmax(result.coverage_factors, USUAL), provenance=result.provenance,
    )  # fmt: skip


def _nulled(values: Mapping[str, float]) -> dict[str, float | None]:
    return {name: value if np.isfinite(value) else None for name, value in values.items()}


EXPECTED = (
    "Mean and standard deviation are those of the single runs; the deviation is the result's, and E_n is the deviation "
    "over the root of the sum of squares of both expanded uncertainties (k = 2; of the result half its interval of "
    "95 %, where that is wider): satisfactory up to 1 (ISO 13528)."
)
