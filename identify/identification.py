"""From runs to the tensor with its standard uncertainty: the function :func:`identify` and its result."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from html import escape
from typing import Any, Literal, get_args

import jax.numpy as jnp
import numpy as np

from identify.estimate import Information, information, longest
from identify.estimator import EstimatorSpec
from identify.filters import motion_band
from identify.gls import whitened
from identify.inertia import COMPONENTS, principal
from identify.inertial import Datum, InertialParameters, by_component, principal_axes
from identify.offsets import OffsetChoice
from identify.pool import pool
from identify.precision import check_precision
from identify.run import Run, RunError
from identify.run_estimate import RunEstimate, offset_notes, offsets_content, run_estimate
from identify.tables import html_table, text_table

Method = Literal["source", "gls"]
"""How the tensor is estimated."""
METHODS = {"source": information, "gls": whitened}
SHORTEST = 64
"""Samples from which the motion's band can be found."""


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
    mass_uncertainty: float | None = None
    """Standard uncertainty of the mass [kg]; None: not stated, and then it counts as exact."""
    cg_inertia_covariance: np.ndarray | None = None
    """Between ``r_cg`` and ``inertia``, (3, 6) [m·kg·m²]; None: zero."""
    cg_covariance: np.ndarray | None = None
    """Of ``r_cg``, (3, 3) [m²]; None: diagonal, from ``sigma_r_cg``."""
    datum: Datum | None = None
    """A frame in which the result is also wanted."""

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
        return InertialParameters(np.nan if self.mass is None else self.mass, self.r_cg, self.inertia, covariance)

    @property
    def standard_uncertainty(self) -> np.ndarray:
        """Standard uncertainty of each component [kg·m²]."""
        return np.sqrt(np.diag(self.covariance))

    def to_dict(self) -> dict[str, Any]:
        """Return the content of result.json, in kg·m² and SI."""
        return {
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
            "mass": {"value": self.mass, "standard_uncertainty": self.mass_uncertainty},
            "cg": {"value": self.r_cg.tolist(), "standard_uncertainty": self.sigma_r_cg.tolist()},
            "delay": {"value": 0.0, "estimated": False},
            "rotation": {"value": np.eye(3).tolist(), "estimated": False},
            "offsets": {
                "method": self.offsets,
                "about": "CG",
                **offsets_content(self.runs, self.sigma_r_cg, self.r_cg),
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
                    "parts": [list(part) for part in run.parts],
                    "parts_found": run.found,
                    "left_out": dict(run.left_out),
                }
                for run in self.runs
            ],
            "warnings": list(self.warnings),
            "assumptions": list(self.assumptions),
            "diagnostics": dict(self.diagnostics),
            "provenance": dict(self.provenance),
        }

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
            digits = _decimals(1e3 * uncertainty)
            figures = [_fixed(1e3 * x, digits) for x in (value, bias, uncertainty, low, high)]
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
        return [
            *used,
            *offset_notes(self.runs, self.sigma_r_cg),
            *warnings,
            *(f"assumed: {text}" for text in self.assumptions),
        ]

    def _repr_html_(self) -> str:
        listed = "".join(f"<li>{escape(text)}</li>" for text in self._notes())
        return f"{html_table(*self.rows(), caption=self._title())}<ul>{listed}</ul>"


def identify(
    runs: Run | Sequence[Run],
    *,
    r_cg: Sequence[float | int] | np.ndarray,
    sigma_r_cg: Sequence[float | int] | np.ndarray = (0.0, 0.0, 0.0),
    estimator: EstimatorSpec | None = None,
    offsets: OffsetChoice = "estimate",
    mass: float | None = None,
    method: Method = "source",
) -> Identification:
    """Identify the inertia tensor about the centre of gravity from one or more runs of one body (10).

    Args:
        runs: the runs.
        r_cg: centre of gravity from the load cell's centre Q, in B [m].
        sigma_r_cg: its standard uncertainty on each axis [m].
        estimator: differentiator and filter; None: Savitzky–Golay matched to the band found in the runs.
        offsets: whether constant offsets of force and moment are estimated in each run along with the tensor, taken
            from its rest, or left in. A force's offset acts only through its moment about the centre of gravity.
        mass: mass of the body [kg]; with an accelerometer it tells the force's offset.
        method: the source's ordinary least squares, or generalised least squares (:mod:`identify.gls`).

    Raises:
        RunError: no run, a run too short for the estimator, or a motion that identifies nothing.
    """
    runs = [runs] if isinstance(runs, Run) else list(runs)
    if not runs:
        raise RunError("no runs: give one or more")
    for name, given, known in (("offsets", offsets, OffsetChoice), ("method", method, Method)):
        if given not in get_args(known):
            raise ValueError(f"Argument `{name}` must be one of {', '.join(get_args(known))}, but is {given!r}.")
    warned = check_precision("float64")
    centre, sigma = np.asarray(r_cg, float), np.asarray(sigma_r_cg, float)
    if centre.shape != (3,) or not np.isfinite(centre).all():
        raise RunError(f"r_cg is {r_cg!r}: give three finite components [m]")
    if sigma.shape != (3,) or not (np.isfinite(sigma) & (sigma >= 0)).all():
        raise RunError(f"sigma_r_cg is {sigma_r_cg!r}: give three standard uncertainties [m], zero or more")
    if estimator is None:
        band = _common_band(runs)
        estimator = EstimatorSpec(f"savitzky-golay, band {band:.3g} Hz found", "savitzky-golay", band)
    parts = [METHODS[method](run, estimator, centre, offsets=offsets) for run in runs]
    pooled = pool(parts, sigma)
    inertia, bias, covariance, scatter, verdict = (
        pooled.inertia,
        pooled.bias,
        pooled.covariance,
        pooled.scatter,
        pooled.excitation,
    )
    half = pooled.coverage_factor * np.sqrt(np.diag(covariance))
    warnings = [*warned, *_warnings(parts, inertia, bias, covariance, scatter)]
    diagnostics = {
        "estimator": {"name": estimator.name, "differentiator": estimator.differentiator, "band": estimator.band,
                      "window": 2 * len(estimator.taps(runs[0].rate)) + 1, "lowpass": estimator.lowpass},
        "condition_number": float(np.sqrt(verdict.strength[-1] / verdict.strength[0])),
        "excitation_over_noise": (verdict.strength / np.maximum(verdict.noise, 1e-300)).min().item(),
        "scatter_between_runs": scatter.tolist(),
        "coverage_factor": pooled.coverage_factor.tolist(),
        "degrees_of_freedom": pooled.degrees_of_freedom.tolist(),
        "standard_uncertainty_from_residuals": np.sqrt(np.diag(pooled.residual)).tolist(),
        "standard_uncertainty_from_cg": np.sqrt(np.diag(pooled.by_centre * sigma**2 @ pooled.by_centre.T)).tolist(),
    }  # fmt: skip
    return Identification(
        inertia, bias, covariance, np.stack([inertia - half, inertia + half], axis=1), centre, sigma, mass, estimator,
        tuple(run_estimate(part, centre, mass) for part in parts), tuple(warnings), _assumptions(offsets), diagnostics,
        offsets=offsets, cg_inertia_covariance=(pooled.by_centre * sigma**2).T,
    )  # fmt: skip


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


def _warnings(
    parts: list[Information], inertia: np.ndarray, bias: np.ndarray, covariance: np.ndarray, scatter: np.ndarray
) -> list[str]:
    found = [f"{part.run.name}: {text}" for part in parts for text in part.run.warnings]
    sigma = np.sqrt(np.diag(covariance))
    for name, one, three in zip(COMPONENTS, bias, 3 * sigma, strict=True):
        if abs(one) > 0.1 * three:
            found.append(
                f"gyro noise and differentiator bias {name} by about {1e3 * one:.3g} g·m²: match a smoother to the band"
            )
    for name, ratio in zip(COMPONENTS, scatter, strict=True):
        if ratio > 2:
            found.append(f"{name} scatters {ratio:.1f} times more between the runs than within them: something changes")
    moments, _ = principal(jnp.asarray(inertia))
    margin = float(jnp.minimum(moments[0], moments[0] + moments[1] - moments[2]))
    if margin < -2 * float(np.sqrt(np.trace(covariance))):
        found.append("no mass distribution has this tensor (triangle inequality): check signs, frames and r_CG")
    return found


def _assumptions(offsets: OffsetChoice) -> tuple[str, ...]:
    zero = ("force and moment are free of constant offsets",) if offsets == "none" else ()
    return (
        *zero,
        "load cell and IMU are aligned in time and in frame",
        "the gyro's noise is white",
        "the platform is rigid",
    )


def _decimals(uncertainty: float) -> int:
    """Decimals that show two digits of an uncertainty (GUM 7.2.6)."""
    if not np.isfinite(uncertainty) or uncertainty <= 0:
        return 6
    return max(0, 1 - int(np.floor(np.log10(uncertainty))))


def _fixed(value: float, digits: int) -> str:
    """A figure with these decimals and a minus sign, but never a minus before nought."""
    return f"{round(value, digits) + 0.0:.{digits}f}".replace("-", "−")


def _named(runs: Sequence[Run]) -> str:
    return runs[0].name if len(runs) == 1 else f"{runs[0].name} and {len(runs) - 1} more"
