"""The result of identification: the tensor with its uncertainty, and the content of result.json."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from jaxtyping import Float

from identify.choices import OffsetChoice
from identify.display.reporting import Result, interval_records, plain
from identify.least_squares.admissible_tensor import Admissible
from identify.least_squares.pooling import NORMAL, Pooling
from identify.results import mass_and_centre
from identify.results.alignment import Aligned
from identify.results.declaration import Declaration, ResidualCause, contradiction, status
from identify.results.discordance import Discordance
from identify.results.held_out_result import HeldOut
from identify.results.ledger import USUAL, Ledger, Row
from identify.results.run_estimate import RunEstimate, offsets_content
from identify.rigid_body.fixture import Tare
from identify.rigid_body.inertia import COMPONENTS, MOMENTS
from identify.rigid_body.inertial_parameters import Datum, InertialParameters, by_component
from identify.rigid_body.principal_axes import principal_axes
from identify.rigid_body.rotation import exponential
from identify.signals.estimator_spec import EstimatorSpec

RESIDUALS, CG, MISFIT = "residuals", "r_cg", "model misfit"
"""Names of errors in a budget, beside those of declared sources."""


@dataclass(frozen=True, repr=False)
class Identification(Result):
    """The inertia tensor about the centre of gravity, in the body frame, from one or more runs. SI units.

    Example: ``identify(runs, ...).to_frame()`` has a row per component; ``.figures()["residuals"]``.
    """

    kind = "inertia identify"
    unit_of_columns = "kg·m²"
    value: Float[np.ndarray, "10"]
    """Mass, centre of gravity from Q and tensor about it, in B [kg, m, kg·m²], as ``method`` estimates them.

    The mass is NaN where it is not stated."""
    ledger: Ledger
    """All that is known of the errors of ``value``: covariance, intervals and budget are functions of it."""
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
    consistency: tuple[ResidualCause, ...] = ()
    """Causes that each run's residuals follow."""
    declarations: tuple[Declaration, ...] = ()
    """Declared quantities that the runs place far from what was declared of them."""
    centre_from: str = mass_and_centre.DECLARED
    """Origin of mass and centre of gravity: declared, static poses, or estimated with the tensor."""
    datum: Datum | None = None
    """A frame in which the result is also wanted."""
    tare: Tare | None = None
    """Fixture that was subtracted from the identified body; None: nothing was."""
    method: str = "source"
    """Name of the estimator, in :mod:`identify.estimation.methods`."""
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
    looked_at_undeclared: bool = False
    """Whether the ledger holds errors that are neither declared nor estimated, of typical size."""
    validation: HeldOut | None = None
    """Prediction of each run, or half of one, from the others; None: it was not asked for."""

    def joined(self, rows: Iterable[Row] = (), **fields: Any) -> "Identification":
        """Return the result with further errors in its ledger, and other fields."""
        return replace(self, ledger=self.ledger.joined(rows), **fields)

    @cached_property
    def parameters(self) -> InertialParameters:
        """The ten parameters with the covariance of measured, declared and contradicted errors.

        The mass counts as exact where its standard uncertainty is zero.
        """
        return self._with_errors(self.ledger.in_intervals)

    @property
    def with_undeclared(self) -> InertialParameters:
        """The ten parameters, whose covariance holds undeclared errors at typical size, too, where they are known."""
        return self._with_errors(self.ledger)

    def _with_errors(self, ledger: Ledger) -> InertialParameters:
        covariance = ledger.covariance
        if np.isnan(self.value[0]):
            covariance = covariance.copy()
            covariance[0] = covariance[:, 0] = 0.0
            covariance[0, 0] = np.nan
        return InertialParameters(float(self.value[0]), self.value[1:4], self.value[4:], covariance)

    @property
    def inertia(self) -> np.ndarray:
        """Packed tensor of the body [kg·m²]."""
        return self.value[4:]

    @property
    def covariance(self) -> np.ndarray:
        """Covariance of ``inertia``, (6, 6), by measured, declared and contradicted errors [(kg·m²)²]."""
        return self.parameters.covariance[4:, 4:]

    @property
    def bias(self) -> np.ndarray:
        """Expected error of the tensor, as by white gyro noise or the differentiator; not subtracted [kg·m²]."""
        return self.ledger.bias[4:]

    def intervals(self, probability: float = USUAL) -> Float[np.ndarray, "10 2"]:
        """Return coverage intervals of the ten parameters, by measured, declared and contradicted errors."""
        bounded = None if self.tare else self.admissible  # whose ends are those of body and fixture
        physical = None if bounded is None else np.abs(bounded.interval95 - self.inertia[:, None])
        return self._of_bodies(self.value[:, None] + self.ledger.arms(probability, physical=physical) * [-1, 1])

    @cached_property
    def intervals95(self) -> Float[np.ndarray, "10 2"]:
        """Coverage intervals of 95 % of the ten parameters [kg, m, kg·m²]."""
        return self.intervals()

    def _of_bodies(self, intervals: Float[np.ndarray, "10 2"]) -> Float[np.ndarray, "10 2"]:
        """Intervals that end where no body is, where the estimate is held to bodies."""
        if self.admissible is not None and self.tare is None:
            moments = np.add(4, MOMENTS)
            intervals[moments, 0] = np.maximum(intervals[moments, 0], 0.0)
        return intervals

    @property
    def interval95(self) -> np.ndarray:
        """Coverage interval of 95 % of the tensor, (6, 2) [kg·m²]; see :meth:`intervals`."""
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
        return contradiction(self.declarations)

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
    def undeclared(self) -> Ledger | None:
        """Errors that the intervals leave out, at typical size; None: not looked at, or they cannot be known."""
        return self.ledger.of_tiers("typical") if self.looked_at_undeclared else None

    @property
    def conventional_bounds(self) -> Float[np.ndarray, "10 2"] | None:
        """Coverage intervals of the ten parameters, widened by k = 2 of undeclared errors; None: these are not known.

        Squares of arms add. The bound has no coverage probability: typical sizes are guesses.
        """
        return self.bounds_of(self.intervals95) if self.looked_at_undeclared else None

    def bounds_of(self, intervals: Float[np.ndarray, "10 2"]) -> Float[np.ndarray, "10 2"]:
        """Return intervals of the ten parameters, widened by k = 2 of undeclared errors, as far as bodies reach."""
        return self._of_bodies(self.ledger.bounds(self.value, intervals))

    @property
    def conventional_bound(self) -> np.ndarray | None:
        """The tensor's part of ``conventional_bounds``, (6, 2) [kg·m²]; None: not known."""
        bounds = self.conventional_bounds
        return None if bounds is None else bounds[4:]

    @property
    def contributions(self) -> Mapping[str, np.ndarray]:
        """Contributions to the standard uncertainty of the components [kg·m²]: of type A, then the largest."""
        types = self.ledger.types
        parts = {error: u[4:] for error, u in self.ledger.budget.items() if u[4:].any()}
        return dict(sorted(parts.items(), key=lambda part: (types[part[0]] != "A", -float(np.nansum(part[1] ** 2)))))

    def to_dict(self) -> dict[str, Any]:
        """Return the content of result.json, in kg·m² and SI."""
        bounds = self.conventional_bounds
        undeclared = None if self.undeclared is None else self.undeclared.to_dict()
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
            "budget": {error: by_component(u) for error, u in self.contributions.items()},
            "undeclared": undeclared,
            "not_included": undeclared,  # its name before; within version 1 of the file keys are only added
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
