"""The result of identification: the tensor with its uncertainty, and the content of result.json."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from jaxtyping import Float

from identify.choices import OffsetChoice
from identify.estimators.admissible_tensor import Admissible
from identify.estimators.pooling import NORMAL, Pooling
from identify.reporting import Result, interval_records, plain
from identify.results import mass_and_centre
from identify.results.alignment import Aligned
from identify.results.declaration import Declaration, ResidualCause, contradicted, status
from identify.results.discordance import Discordance
from identify.results.held_out_result import HeldOut
from identify.results.run_estimate import RunEstimate, offsets_content
from identify.results.undeclared import Undeclared
from identify.rigid_body.fixture import Tare
from identify.rigid_body.inertia import COMPONENTS, MOMENTS
from identify.rigid_body.inertial_parameters import Datum, InertialParameters, by_component
from identify.rigid_body.principal_axes import principal_axes
from identify.rigid_body.rotation import exponential
from identify.signals.estimator_spec import EstimatorSpec

RESIDUALS, SCATTER, CG, FIXTURE = "residuals", "scatter between runs", "r_cg", "fixture taken off"
MISFIT = "model misfit"
ESTIMATE = "estimate"
"""All that an estimator states by itself, where it does not tell its parts apart."""


def contributions(
    budget: Mapping[str, np.ndarray] | None, diagnostics: Mapping[str, Any], fixture: np.ndarray | None
) -> Mapping[str, np.ndarray]:
    """Return each part's contribution to the standard uncertainty of the components [kg·m²]; empty if unknown.

    The budget of the declared sources where there is one; else residuals, scatter and centre of gravity.

    Args:
        budget: contributions by source [kg·m²]; None: no sources are declared.
        diagnostics: of the fit.
        fixture: what taking a fixture off adds to the variances [(kg·m²)²]; None: nothing was taken off.
    """
    if budget is not None:
        taken_off = {} if fixture is None else {FIXTURE: np.sqrt(np.maximum(fixture, 0))}
        return {**budget, **taken_off}
    if "standard_uncertainty_from_residuals" not in diagnostics or "standard_uncertainty_from_cg" not in diagnostics:
        return {}
    residual = np.array(diagnostics["standard_uncertainty_from_residuals"])
    ratio = np.array(diagnostics["scatter_between_runs"])
    beyond = residual * np.sqrt(np.maximum(ratio**2 - 1, 0))
    parts = {RESIDUALS: residual, SCATTER: beyond, CG: np.array(diagnostics["standard_uncertainty_from_cg"])}
    return {name: values for name, values in parts.items() if values.any()}


def evaluation_type(name: str) -> str:
    """Return the type of evaluation of a part (GUM 4.2, 4.3): A by statistics of the runs, B by other means."""
    if name == FIXTURE:
        return "A, B"
    return "A" if name in (RESIDUALS, ESTIMATE) or name.startswith("scatter between") else "B"


@dataclass(frozen=True, repr=False)
class Identification(Result):
    """The inertia tensor about the centre of gravity, in the body frame, from one or more runs. SI units.

    Example: ``identify(runs, ...).to_frame()`` has a row per component; ``.figures()["residuals"]``.
    """

    kind = "inertia identify"
    unit_of_columns = "kg·m²"
    parameters: InertialParameters
    """Mass, centre of gravity from Q and tensor about it, in B, with their covariance: the runs' least squares, each
    run weighted by the inverse of its residual variance. The mass is NaN where it is not stated, and counts as exact
    where its standard uncertainty is zero."""
    intervals95: Float[np.ndarray, "10 2"]
    """Coverage intervals of 95 % of the ten parameters, by measured and declared errors [kg, m, kg·m²]."""
    bias: np.ndarray
    """Expected mean error from white gyro noise and the differentiator's gain; not subtracted [kg·m²]."""
    estimator: EstimatorSpec
    runs: tuple[RunEstimate, ...]
    warnings: tuple[str, ...]
    assumptions: tuple[str, ...]
    diagnostics: Mapping[str, Any]
    provenance: Mapping[str, Any] = field(default_factory=dict)
    offsets: OffsetChoice = "estimate"
    """Treatment of the load cell's constant offsets: ``estimate``, ``still`` or ``none``."""
    pooling: Pooling | None = None
    """Type A evaluation: residuals, and the scatter between runs and mountings."""
    budget: Mapping[str, np.ndarray] | None = None
    """Contributions to each component's standard uncertainty [kg·m²], by name; None: none are declared."""
    consistency: tuple[ResidualCause, ...] = ()
    """Causes that each run's residuals follow."""
    declarations: tuple[Declaration, ...] = ()
    """Declared quantities that the runs place far from what was declared of them."""
    misfit: np.ndarray | None = None
    """Changes of the tensor by what the runs contradict, (6, k), which count as standard uncertainties [kg·m²]; None:
    none."""
    centre_from: str = mass_and_centre.DECLARED
    """Origin of mass and centre of gravity: declared, static poses, or estimated with the tensor."""
    lasting: Mapping[str, np.ndarray] = field(default_factory=dict)
    """Changes of the ten parameters, (10,), by one standard uncertainty of each error, by its name, that is part of
    ``covariance`` and the same in another body's result."""
    datum: Datum | None = None
    """A frame in which the result is also wanted."""
    tare: Tare | None = None
    """Fixture that was subtracted from the identified body; None: nothing was."""
    method: str = "source"
    """Name of the estimator, in :mod:`identify.methods`."""
    delay: Aligned | None = None
    """Delay of the IMU against the load cell [s], where it was estimated."""
    rotation: Aligned | None = None
    """Rotation from the IMU's axes, as declared, to B, where that was estimated [rad]."""

    seen: np.ndarray | None = None
    """Directions in the space of packed tensors that the motion determines, one a row; None: all."""
    admissible: Admissible | None = None
    """The estimate within physical bodies beside the plain one, where the data are weak; None: they are not."""
    discordance: Discordance | None = None
    """Runs that disagree with the others; None: none does, or it was not looked at."""
    by_held_errors: Mapping[str, np.ndarray] | None = None
    """Derivatives of the ten parameters by errors of the rig that count as zero; None: not computed. See
    :func:`identify.judge.held_errors.by_held_errors`."""
    undeclared: Undeclared | None = None
    """Errors that ``interval95`` leaves out, at typical size; None: it was not looked at, or cannot be known."""
    validation: HeldOut | None = None
    """Prediction of each run, or half of one, from the others; None: it was not asked for."""

    @property
    def inertia(self) -> np.ndarray:
        """Packed tensor of the body [kg·m²]."""
        return self.parameters.inertia

    @property
    def covariance(self) -> np.ndarray:
        """Covariance of ``inertia``, (6, 6): residuals, scatter between runs, declared errors [(kg·m²)²]."""
        return self.parameters.covariance[4:, 4:]

    @property
    def interval95(self) -> np.ndarray:
        """Coverage interval of 95 % about ``inertia`` by measured and declared errors, (6, 2) [kg·m²]."""
        return self.intervals95[4:]

    @property
    def r_cg(self) -> np.ndarray:
        """Centre of gravity from Q that was used, in B [m]."""
        return self.parameters.r_cg

    @property
    def sigma_r_cg(self) -> np.ndarray:
        """Standard uncertainty of ``r_cg`` [m]."""
        return self.parameters.standard_uncertainty[1:4]

    @property
    def mass(self) -> float | None:
        """Mass [kg], when stated."""
        return None if np.isnan(self.parameters.mass) else self.parameters.mass

    @property
    def mass_uncertainty(self) -> float | None:
        """Standard uncertainty of the mass [kg]; None: not stated, and then it counts as exact."""
        u = float(self.parameters.standard_uncertainty[0])
        return u if u > 0 else None

    @property
    def contradicted(self) -> str:
        """Clause that names the declared quantities that the runs contradict; '': none."""
        return contradicted(self.declarations)

    @property
    def measured(self) -> InertialParameters:
        """Parameters of all that stood on the load cell: with the fixture, where one was taken off."""
        return self.parameters if self.tare is None else self.tare.whole

    @property
    def taken_off(self) -> np.ndarray:
        """Measured tensor less the identified one: the part of the fixture in each run's own tensor [kg·m²]."""
        return self.measured.inertia - self.inertia

    @property
    def determined(self) -> np.ndarray:
        """Mask of the components that the motion determines, (6,)."""
        return np.ones(6, bool) if self.admissible is None else self.admissible.determined

    @property
    def standard_uncertainty(self) -> np.ndarray:
        """Standard uncertainty of each component [kg·m²]."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def coverage_factors(self) -> np.ndarray:
        """Half of the intervals of 95 % of the ten parameters over their standard uncertainties."""
        half, u = np.ptp(self.intervals95, axis=1) / 2, self.parameters.standard_uncertainty
        return np.divide(half, u, out=np.full(10, NORMAL), where=u > 0)

    @property
    def with_undeclared(self) -> InertialParameters:
        """The ten parameters, whose covariance holds undeclared errors at typical size, too, where they are known."""
        ten = self.parameters
        return ten if self.undeclared is None else replace(ten, covariance=ten.covariance + self.undeclared.covariance)

    @property
    def conventional_bounds(self) -> Float[np.ndarray, "10 2"] | None:
        """Coverage intervals of the ten parameters, widened by k = 2 of undeclared errors; None: these are not known.

        Squares of arms add. The bound has no coverage probability: typical sizes are guesses.
        """
        if self.undeclared is None:
            return None
        bounds = self.undeclared.bounds(self.parameters.values, self.intervals95)
        if self.admissible is not None:  # as the intervals, they end where no body is
            moments = np.add(4, MOMENTS)
            bounds[moments, 0] = np.maximum(bounds[moments, 0], 0.0)
        return bounds

    def widened(self, changes: Float[np.ndarray, "10 k"]) -> "Identification":
        """Return the result whose uncertainties and intervals hold further normal errors.

        Args:
            changes: of the ten parameters by one standard uncertainty of each independent error [kg, m, kg·m²].
        """
        half = np.ptp(self.intervals95, axis=1) / 2
        out = np.hypot(half, NORMAL * np.linalg.norm(changes, axis=1)) - half
        return replace(
            self,
            parameters=replace(self.parameters, covariance=self.parameters.covariance + changes @ changes.T),
            intervals95=self.intervals95 + np.where(np.isfinite(out), out, 0.0)[:, None] * [-1, 1],
        )

    def with_tensor_uncertainty(
        self, covariance: Float[np.ndarray, "6 6"], interval95: Float[np.ndarray, "6 2"]
    ) -> "Identification":
        """Return the result whose tensor has this covariance and these intervals; what is known of the rest stays."""
        covariance_of_ten = self.parameters.covariance.copy()
        covariance_of_ten[4:, 4:] = covariance
        parameters = replace(self.parameters, covariance=covariance_of_ten)
        return replace(self, parameters=parameters, intervals95=np.vstack([self.intervals95[:4], interval95]))

    def with_mass_uncertainty(self, u: float) -> "Identification":
        """Return the result whose mass has this standard uncertainty [kg], and a normal error."""
        covariance, intervals = self.parameters.covariance.copy(), self.intervals95.copy()
        covariance[0] = covariance[:, 0] = 0.0  # it is known from elsewhere
        covariance[0, 0], intervals[0] = u**2, self.parameters.mass + NORMAL * u * np.array([-1, 1])
        return replace(self, parameters=replace(self.parameters, covariance=covariance), intervals95=intervals)

    @property
    def conventional_bound(self) -> np.ndarray | None:
        """The tensor's part of ``conventional_bounds``, (6, 2) [kg·m²]; None: not known."""
        bounds = self.conventional_bounds
        return None if bounds is None else bounds[4:]

    @property
    def contributions(self) -> Mapping[str, np.ndarray]:
        """Each part's contribution to the standard uncertainty of the components [kg·m²]; empty if not known."""
        with_fixture = None if self.tare is None else self.tare.whole.standard_uncertainty[4:]
        fixture = None if with_fixture is None else self.standard_uncertainty**2 - with_fixture**2
        parts = contributions(self.budget, self.diagnostics, fixture)
        return parts if self.misfit is None or not parts else {**parts, MISFIT: np.linalg.norm(self.misfit, axis=1)}

    def to_dict(self) -> dict[str, Any]:
        """Return the content of result.json, in kg·m² and SI."""
        bounds = self.conventional_bounds
        content = {
            **self.form(),
            "status": status(self.contradicted),
            "unit": "kg*m^2",
            "about": "CG",
            "frame": "body",
            "inertia": by_component(self.inertia),
            "bias": by_component(self.bias),
            "standard_uncertainty": by_component(self.standard_uncertainty),
            "interval95": by_component(self.interval95),
            "conventional_bound": None if bounds is None else by_component(bounds[4:]),
            "covariance": self.covariance.tolist(),
            "principal": principal_axes(self.inertia, self.covariance).to_dict(),
            "about_q": None if self.mass is None else self.parameters.about().to_dict(),
            "about_datum": None if self.datum is None else self.parameters.in_datum(self.datum).to_dict(),
            "tare": None if self.tare is None else self.tare.to_dict(),
            **mass_and_centre.content(self.parameters, self.intervals95, self.centre_from, bounds),
            "method": self.method,
            "delay": {"value": 0.0, "estimated": False} if self.delay is None else self.delay.to_dict(),
            "rotation": _rotation_content(self.rotation),
            "offsets": {
                "method": self.offsets,
                "about": "CG",
                **offsets_content(self.runs, self.measured.standard_uncertainty[1:4], self.measured.r_cg),
            },
            "runs": [run.to_dict() for run in self.runs],
            "pooling": None if self.pooling is None else self.pooling.to_dict(),
            "discordance": None if self.discordance is None else self.discordance.to_dict(),
            "budget": None if self.budget is None else {n: by_component(u) for n, u in self.budget.items()},
            "not_included": None if self.undeclared is None else self.undeclared.to_dict(),
            "declarations": [declaration.to_dict() for declaration in self.declarations],
            "consistency": [verdict._asdict() for verdict in self.consistency],
            "warnings": list(self.warnings),
            "assumptions": list(self.assumptions),
            "admissible": None if self.admissible is None else self.admissible.to_dict(),
            "diagnostics": dict(self.diagnostics),
            "provenance": dict(self.provenance),
            **({} if self.validation is None else {"validation": self.validation.to_dict()}),
        }
        return dict(plain(content))

    def records(self) -> list[dict[str, Any]]:
        """Return value, bias, standard uncertainty and interval of each component [kg·m²]; the bound where known."""
        return interval_records(self, component=COMPONENTS, value=self.inertia, bias=self.bias)


def _rotation_content(rotation: Aligned | None) -> dict[str, Any]:
    """The rotation matrix, and how its rotation vector was estimated."""
    if rotation is None:
        return {"value": np.eye(3).tolist(), "estimated": False}
    matrix, vector = exponential(rotation.value).tolist(), rotation.value.tolist()
    return rotation.to_dict() | {"value": matrix, "rotation_vector": vector}


def covering_bias(result: Identification, bias: Float[np.ndarray, "6"]) -> Identification:
    """Return a result whose interval reaches as much further, on the side where the truth then is, as is expected.

    So it covers an expected error which is not corrected (GUM F.2.4.5).

    Args:
        result: its ``interval95`` does not hold this error yet.
        bias: expected error of each component [kg·m²]; NaN counts as none.
    """
    expected = np.nan_to_num(bias)
    ends = np.stack([np.maximum(expected, 0.0), np.minimum(expected, 0.0)], axis=1)
    return replace(result, intervals95=result.intervals95 - np.vstack([np.zeros((4, 2)), ends]))


def intervals_of(
    parameters: InertialParameters, tensor: Float[np.ndarray, "6 2"], factor: np.ndarray | float = NORMAL
) -> Float[np.ndarray, "10 2"]:
    """Return the coverage intervals of 95 % of ten parameters: of mass and centre of gravity by a coverage factor.

    Args:
        parameters: the ten.
        tensor: intervals of the components [kg·m²].
        factor: coverage factor of mass and centre of gravity: one, or (4,).
    """
    half = factor * parameters.standard_uncertainty[:4]
    four = parameters.values[:4]
    return np.vstack([np.stack([four - half, four + half], axis=1), tensor])
