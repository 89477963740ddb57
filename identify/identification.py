"""From runs to the tensor with its standard uncertainty: the function :func:`identify` and its result."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from typing import Any, Literal, get_args

import jax.numpy as jnp
import numpy as np

from identify.admissible import Admissible, finite
from identify.alignment import Aligned, alignment_notes
from identify.centre_result import Centre
from identify.consistency import Verdict
from identify.estimate import Information, information, longest
from identify.estimator import EstimatorSpec
from identify.filters import motion_band
from identify.gls import whitened
from identify.inertia import COMPONENTS
from identify.inertial import Datum, InertialParameters, by_component, principal_axes
from identify.known_centre import with_centre
from identify.offsets import OffsetChoice
from identify.pool import Pooled, pool
from identify.pooling import Pooling
from identify.precision import check_precision
from identify.priors import Alignment
from identify.run import Run, RunError
from identify.run_estimate import RunEstimate, offset_notes, offsets_content, run_estimate
from identify.tables import decimals, fixed, html_table, text_table
from identify.tare import Tare
from identify.trajectory import exponential
from identify.weak import within_bodies

SHORTEST = 64
"""Samples from which the motion's band can be found."""


CgMotion = Literal["still"]
"""How the centre of gravity moves, where that is declared."""
Method = Literal["source", "gls", "joint"]
"""Estimators: the source's, generalised least squares, and the joint estimate."""
ROWS = {"source": information, "gls": whitened}
"""What a run's rows say, by method."""


@dataclass(frozen=True)
class Identification:
    """The inertia tensor about the centre of gravity, in the body frame, from one or more runs. SI units."""

    inertia: np.ndarray
    """Packed tensor [kg·m²]: the runs' least squares, each run weighted by the inverse of its residual variance."""
    bias: np.ndarray
    """Expected mean error from white gyro noise and the differentiator's gain; not subtracted [kg·m²]."""
    covariance: np.ndarray
    """Of ``inertia``, (6, 6): residuals, scatter between runs, centre of gravity [(kg·m²)²]."""
    interval95: np.ndarray
    """Coverage interval of 95 % about ``inertia``, (6, 2) [kg·m²]."""
    r_cg: np.ndarray
    """Centre of gravity from Q that was used, in B [m]."""
    sigma_r_cg: np.ndarray
    """Its standard uncertainty [m]."""
    mass: float | None
    """Mass [kg], when stated."""
    estimator: EstimatorSpec
    runs: tuple[RunEstimate, ...]
    warnings: tuple[str, ...]
    assumptions: tuple[str, ...]
    diagnostics: Mapping[str, Any] = field(repr=False)
    provenance: Mapping[str, Any] = field(default_factory=dict, repr=False)
    offsets: OffsetChoice = "estimate"
    """Where the load cell's constant offsets come from."""
    pooling: Pooling | None = None
    """Type A: what residuals and the scatter between runs and mountings say."""
    budget: Mapping[str, np.ndarray] | None = None
    """Contributions to each component's standard uncertainty [kg·m²], by name; None: none are declared."""
    consistency: tuple[Verdict, ...] = ()
    """What the residuals follow, run by run."""
    mass_uncertainty: float | None = None
    """Standard uncertainty of the mass [kg]; None: not stated, and then it counts as exact."""
    cg_inertia_covariance: np.ndarray | None = None
    """Between ``r_cg`` and ``inertia``, (3, 6) [m·kg·m²]; None: zero."""
    cg_covariance: np.ndarray | None = None
    """Of ``r_cg``, (3, 3) [m²]; None: diagonal, from ``sigma_r_cg``."""
    mass_covariance: np.ndarray | None = None
    """Between the mass and the nine of ``r_cg`` and ``inertia``, (9,) [kg·m, kg²·m²]; None: zero."""
    datum: Datum | None = None
    """A frame in which the result is also wanted."""
    tare: Tare | None = field(default=None, repr=False)
    """What was taken off; None: nothing."""
    method: Method = "source"
    """How it was estimated; see :func:`identify`."""
    delay: Aligned | None = None
    """How much the IMU is late, where that was estimated [s]."""
    rotation: Aligned | None = None
    """Rotation from the IMU's axes, as declared, to B, where that was estimated [rad]."""

    seen: np.ndarray | None = None
    """Directions in the space of packed tensors that the motion determines, one a row; None: all."""
    admissible: Admissible | None = None
    """What bodies allow, where the data are weak, with the plain estimate beside it; None: they are strong enough."""

    @property
    def parameters(self) -> InertialParameters:
        """The ten parameters with their covariance, about the centre of gravity, from Q, in B."""
        covariance = np.zeros((10, 10))
        covariance[0, 0] = np.nan if self.mass is None else (self.mass_uncertainty or 0.0) ** 2
        covariance[1:4, 1:4] = np.diag(self.sigma_r_cg**2) if self.cg_covariance is None else self.cg_covariance
        covariance[4:, 4:] = self.covariance
        if self.cg_inertia_covariance is not None:
            covariance[1:4, 4:] = self.cg_inertia_covariance
            covariance[4:, 1:4] = self.cg_inertia_covariance.T
        if self.mass_covariance is not None:
            covariance[0, 1:] = covariance[1:, 0] = self.mass_covariance
        return InertialParameters(np.nan if self.mass is None else self.mass, self.r_cg, self.inertia, covariance)

    @property
    def _measured(self) -> InertialParameters:
        """What stood on the load cell: with the fixture, where one was taken off."""
        return self.parameters if self.tare is None else self.tare.whole

    @property
    def taken_off(self) -> np.ndarray:
        """What a fixture adds to each run's own tensor, which is that of all that stood on the load cell [kg·m²]."""
        return self._measured.inertia - self.inertia

    @property
    def standard_uncertainty(self) -> np.ndarray:
        """Standard uncertainty of each component [kg·m²]."""
        return np.sqrt(np.diag(self.covariance))

    def to_dict(self) -> dict[str, Any]:
        """Return the content of result.json, in kg·m² and SI."""
        content = {
            "unit": "kg*m^2",
            "about": "CG",
            "frame": "body",
            "inertia": by_component(self.inertia),
            "bias": by_component(self.bias),
            "standard_uncertainty": by_component(self.standard_uncertainty),
            "interval95": {
                name: list(map(float, ends)) for name, ends in zip(COMPONENTS, self.interval95, strict=True)
            },
            "covariance": self.covariance.tolist(),
            "principal": principal_axes(self.inertia, self.covariance).to_dict(),
            **self._elsewhere(),
            "tare": None if self.tare is None else self.tare.to_dict(),
            "mass": {"value": self.mass, "standard_uncertainty": self.mass_uncertainty},
            "cg": {"value": self.r_cg.tolist(), "standard_uncertainty": self.sigma_r_cg.tolist()},
            "method": self.method,
            "delay": {"value": 0.0, "estimated": False} if self.delay is None else self.delay.to_dict(),
            "rotation": _rotation_content(self.rotation),
            "offsets": {
                "method": self.offsets,
                "about": "CG",
                **offsets_content(self.runs, self._measured.standard_uncertainty[1:4], self._measured.r_cg),
            },
            "runs": [
                {
                    "file": run.file,
                    "sha256": run.sha256,
                    "inertia": by_component(run.inertia) if run.alone else None,
                    "standard_uncertainty": by_component(run.standard_uncertainty) if run.alone else None,
                    "samples": run.samples,
                    "rate": run.rate,
                    "residual": run.residual.tolist(),
                    "correlation_time": run.correlation_time,
                    "mounting": run.mounting,
                    "parts": [list(part) for part in run.parts],
                    "parts_found": run.found,
                    "left_out": dict(run.left_out),
                }
                for run in self.runs
            ],
            "pooling": None if self.pooling is None else self.pooling.to_dict(),
            "budget": None if self.budget is None else {n: by_component(u) for n, u in self.budget.items()},
            "consistency": [verdict._asdict() for verdict in self.consistency],
            "warnings": list(self.warnings),
            "assumptions": list(self.assumptions),
            "admissible": None if self.admissible is None else self.admissible.to_dict(),
            "diagnostics": dict(self.diagnostics),
            "provenance": dict(self.provenance),
        }
        return {key: finite(value) for key, value in content.items()}

    def _elsewhere(self) -> dict[str, Any]:
        """What result.json says of other points and frames; null where the mass is not known."""
        known, datum = self.mass is not None, self.datum
        return {
            "about_q": self.parameters.about().to_dict() if known else None,
            "about_datum": None if datum is None else self.parameters.in_datum(datum).to_dict(),
        }

    def rows(self) -> tuple[list[str], list[list[str]]]:
        """Return head and rows of the summary, in g·m²."""
        head = ["g·m²", "value", "bias", "standard uncertainty", "95 % interval"]
        columns = zip(COMPONENTS, self.inertia, self.bias, self.standard_uncertainty, self.interval95, strict=True)
        rows = []
        for name, value, bias, uncertainty, (low, high) in columns:
            digits = max(decimals(1e3 * (uncertainty if np.isfinite(uncertainty) else 0.1 * abs(value))), 0)
            figures = [fixed(1e3 * x, digits) for x in (value, bias, uncertainty, low, high)]
            rows.append([name, *figures[:3], f"{figures[3]} … {figures[4]}"])
        return head, rows

    def _title(self) -> str:
        runs = f"{len(self.runs)} run{'s' if len(self.runs) > 1 else ''}"
        return f"Inertia tensor about the centre of gravity, body frame; {runs}, estimator '{self.estimator.name}'"

    def __repr__(self) -> str:
        return "\n".join([self._title(), text_table(*self.rows()), *self._notes()])

    def _notes(self) -> list[str]:
        used = [run.used for run in self.runs if run.used]
        warnings = [f"warning: {text}" for text in self.warnings]
        axes = principal_axes(self.inertia, self.covariance).note
        return [
            *used,
            *alignment_notes(self.delay, self.rotation),
            *([] if self.tare is None else [self.tare.without(self.parameters)]),
            *offset_notes(self.runs, self._measured.standard_uncertainty[1:4]),
            *warnings,
            *([] if axes is None else [f"principal axes: {axes}"]),
            *(f"assumed: {text}" for text in self.assumptions),
        ]

    def _repr_html_(self) -> str:
        listed = "".join(f"<li>{escape(text)}</li>" for text in self._notes())
        return f"{html_table(*self.rows(), caption=self._title())}<ul>{listed}</ul>"


def identify(
    runs: Run | Sequence[Run],
    *,
    r_cg: Sequence[float | int] | np.ndarray | None = None,
    sigma_r_cg: Sequence[float | int] | np.ndarray = (0.0, 0.0, 0.0),
    estimator: EstimatorSpec | None = None,
    offsets: OffsetChoice = "estimate",
    mass: float | None = None,
    centre: Centre | None = None,
    method: Method = "source",
    alignment: Alignment | None = None,
    cg_motion: CgMotion | None = None,
    gravity: float = 9.80665,
    mass_uncertainty: float | None = None,
) -> Identification:
    """Identify the inertia tensor about the centre of gravity from one or more runs of one body (10).

    Args:
        runs: the runs.
        r_cg: centre of gravity from the load cell's centre Q, in B [m]; None: that of ``centre``.
        sigma_r_cg: its standard uncertainty on each axis [m].
        estimator: differentiator and filter; None: Savitzky–Golay matched to the band found in the runs.
        offsets: whether constant offsets of force and moment are estimated in each run along with the tensor, taken
            from its rest, or left in. A force's offset acts only through its moment about the centre of gravity.
        mass: mass of the body [kg]; with an accelerometer it tells the force's offset.
        centre: mass and centre of gravity from static poses, with their covariance, instead of the three above; the
            joint estimate takes its offsets along.
        method: ``source``: r_CG as given, ordinary least squares; ``gls``: r_CG as given, generalised least squares by
            the residuals' covariance across axes and in time; ``joint``: tensor, mass, r_CG, offsets, delay and
            rotation together, most probable given all that is known before.
        alignment: what is known beforehand of delay, rotation and slow errors (``joint``); None: little.
        cg_motion: ``still`` where the motion keeps the centre of gravity still (``joint``); None: not declared, then an
            accelerometer tells the specific force, or nothing does.
        gravity: local gravity [m/s²] (``joint``).
        mass_uncertainty: standard uncertainty of ``mass`` [kg] (``joint``); None: it counts as exact.

    Raises:
        RunError: no run, a run too short for the estimator, or a motion that identifies nothing.
    """
    for name, given, known in (("method", method, Method), ("offsets", offsets, OffsetChoice)):
        if given not in get_args(known):
            raise ValueError(f"Argument `{name}` must be one of {', '.join(get_args(known))}, but is {given!r}.")
    if method == "joint":
        return _joint(
            runs, r_cg=r_cg, sigma_r_cg=sigma_r_cg, band=None if estimator is None else estimator.band, offsets=offsets,
            mass=mass, mass_uncertainty=mass_uncertainty, centre=centre, alignment=alignment, cg_motion=cg_motion,
            gravity=gravity,
        )  # fmt: skip
    if centre is not None:
        sigma = centre.standard_uncertainty[1:4]
        found = _plug_in(
            runs, r_cg=centre.r_cg, sigma_r_cg=sigma, estimator=estimator, offsets=offsets, mass=centre.mass,
            method=method,
        )  # fmt: skip
        return within_bodies(with_centre(found, centre), runs)
    found = _plug_in(
        runs, r_cg=r_cg, sigma_r_cg=sigma_r_cg, estimator=estimator, offsets=offsets, mass=mass, method=method
    )
    return within_bodies(found, runs)


def _plug_in(
    runs: Run | Sequence[Run],
    *,
    r_cg: Sequence[float | int] | np.ndarray | None,
    sigma_r_cg: Sequence[float | int] | np.ndarray,
    estimator: EstimatorSpec | None,
    offsets: OffsetChoice,
    mass: float | None,
    method: Method,
) -> Identification:
    """Estimators by rows: r_CG as it is given, ordinary or generalised least squares."""
    runs, centre, sigma = _checked(runs, r_cg, sigma_r_cg)
    warned = check_precision("float64")
    if estimator is None:
        band = _common_band(runs)
        estimator = EstimatorSpec(f"savitzky-golay, band {band:.3g} Hz found", "savitzky-golay", band)
    parts = [ROWS[method](run, estimator, centre, offsets=offsets) for run in runs]
    pooled = pool(parts, sigma)
    inertia, covariance, verdict = pooled.inertia, pooled.covariance, pooled.excitation
    half = pooled.half_width
    warnings = [*warned, *_warnings(parts, pooled)]
    diagnostics = {
        "estimator": {"name": estimator.name, "differentiator": estimator.differentiator, "band": estimator.band,
                      "window": 2 * len(estimator.taps(runs[0].rate)) + 1, "lowpass": estimator.lowpass},
        "condition_number": float(np.sqrt(verdict.strength[-1] / max(verdict.strength[0], 1e-300))),
        "excitation_over_noise": (verdict.strength / np.maximum(verdict.noise, 1e-300)).min().item(),
        "scatter_between_runs": pooled.together.excess.tolist(),
        "coverage_factor": pooled.coverage_factor.tolist(),
        "degrees_of_freedom": pooled.degrees_of_freedom.tolist(),
        "standard_uncertainty_from_residuals": np.sqrt(np.diag(pooled.residual)).tolist(),
        "standard_uncertainty_from_cg": np.sqrt(np.diag(pooled.by_centre * sigma**2 @ pooled.by_centre.T)).tolist(),
    }  # fmt: skip
    return Identification(
        inertia, pooled.bias, covariance, np.stack([inertia - half, inertia + half], axis=1), centre, sigma, mass,
        estimator,
        tuple(run_estimate(part, centre, mass) for part in parts), tuple(warnings), _assumptions(offsets), diagnostics,
        offsets=offsets, cg_inertia_covariance=(pooled.by_centre * sigma**2).T, method=method,
        pooling=pooled.together, seen=None if verdict.identifiable.all() else pooled.seen,
    )  # fmt: skip


def _joint(
    runs: Run | Sequence[Run],
    *,
    r_cg: Sequence[float | int] | np.ndarray | None,
    sigma_r_cg: Sequence[float | int] | np.ndarray,
    band: float | None,
    offsets: OffsetChoice,
    mass: float | None,
    mass_uncertainty: float | None,
    centre: Centre | None,
    alignment: Alignment | None,
    cg_motion: CgMotion | None,
    gravity: float,
) -> Identification:
    """Everything together; see :mod:`identify.joint_estimate`."""
    from identify.joint_estimate import joint, specific_force_of, static_knowledge

    runs, r_cg, sigma_r_cg = _checked(runs, r_cg if centre is None else centre.r_cg, sigma_r_cg)
    warned = check_precision("float64")
    if warned:
        raise RunError("the joint estimate needs float64: run jax.config.update('jax_enable_x64', True) first")
    if offsets == "still":
        raise RunError('the joint estimate finds offsets itself: write offsets = "estimate", or use the method source')
    blocks = static_knowledge(
        runs, r_cg=r_cg, sigma_r_cg=sigma_r_cg, mass=mass, mass_uncertainty=mass_uncertainty, gravity=gravity,
        offsets=offsets, centre=centre,
    )  # fmt: skip
    return joint(
        runs, band=_common_band(runs) if band is None else band, blocks=blocks, alignment=alignment or Alignment(),
        specific_force=specific_force_of(runs, cg_motion), gravity=gravity, offsets=offsets,
    )  # fmt: skip


def _checked(
    runs: Run | Sequence[Run],
    r_cg: Sequence[float | int] | np.ndarray | None,
    sigma_r_cg: Sequence[float | int] | np.ndarray,
) -> tuple[list[Run], np.ndarray, np.ndarray]:
    """The runs as a list, r_CG and its standard uncertainty as arrays."""
    runs = [runs] if isinstance(runs, Run) else list(runs)
    if not runs:
        raise RunError("no runs: give one or more")
    centre, sigma = np.asarray(r_cg, float), np.asarray(sigma_r_cg, float)
    if centre.shape != (3,) or not np.isfinite(centre).all():
        raise RunError(f"r_cg is {r_cg!r}: give three finite components [m]")
    if sigma.shape != (3,) or not (np.isfinite(sigma) & (sigma >= 0)).all():
        raise RunError(f"sigma_r_cg is {sigma_r_cg!r}: give three standard uncertainties [m], zero or more")
    return runs, centre, sigma


def _rotation_content(rotation: Aligned | None) -> dict[str, Any]:
    """The rotation matrix, and how its rotation vector was estimated."""
    if rotation is None:
        return {"value": np.eye(3).tolist(), "estimated": False}
    matrix = np.asarray(exponential(jnp.asarray(rotation.value)))
    return rotation.to_dict() | {"value": matrix.tolist(), "rotation_vector": rotation.value.tolist()}


def _common_band(runs: Sequence[Run]) -> float:
    """The band of the fastest motion [Hz]."""
    for run in runs:
        samples = len(longest(run))
        if samples < SHORTEST:
            raise RunError(
                f"{run.name} has {samples} samples, fewer than the {SHORTEST} from which a motion's band is found: "
                "record for longer, or name an estimator"
            )
    return max(motion_band(longest(run), run.rate) for run in runs)


def _warnings(parts: list[Information], pooled: Pooled) -> list[str]:
    found = [f"{part.run.name}: {text}" for part in parts for text in part.run.warnings]
    sigma = np.sqrt(np.diag(pooled.covariance))
    for name, one, three in zip(COMPONENTS, pooled.bias, 3 * sigma, strict=True):
        if abs(one) > 0.1 * three:
            found.append(
                f"gyro noise and differentiator bias {name} by about {1e3 * one:.3g} g·m²: match a smoother to the band"
            )
    for name, ratio in zip(COMPONENTS, pooled.together.excess, strict=True):
        if ratio > 2:
            found.append(f"{name} scatters {ratio:.1f} times more between the runs than within them: something changes")
    return found


def _assumptions(offsets: OffsetChoice) -> tuple[str, ...]:
    zero = ("force and moment are free of constant offsets",) if offsets == "none" else ()
    return (
        *zero,
        "load cell and IMU are aligned in time and in frame",
        "the gyro's noise is white",
        "the platform is rigid",
    )


def _named(runs: Sequence[Run]) -> str:
    return runs[0].name if len(runs) == 1 else f"{runs[0].name} and {len(runs) - 1} more"
