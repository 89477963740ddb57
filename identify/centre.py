"""Mass, centre of gravity and constant offsets of the load cell, from static poses.

At rest (4) leaves ``F = m f + F0`` and ``M = r × m f + M0``, where f is the specific force in the body frame (what a
perfect accelerometer reads, opposite to gravity): linear in ``(m, F0)`` and in ``(m r, M0)``.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from html import escape
from typing import Any, ClassVar

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike
from scipy.stats import t as student

from identify.run import RunError
from identify.tables import html_table, text_table, with_error

PARAMETERS = (
    "mass", "cg_x", "cg_y", "cg_z",
    "force_offset_x", "force_offset_y", "force_offset_z", "moment_offset_x", "moment_offset_y", "moment_offset_z",
)  # fmt: skip
"""The order of a centre's covariance: kg, m, N, N·m."""
UNITS = ("kg", *("m",) * 3, *("N",) * 3, *("N*m",) * 3)
LEAST_TILT = 0.02
"""Spread of the poses' specific force in its second direction, as a part of gravity, below which they count as one."""
LARGE_RESIDUAL = 0.03
"""Residual force, as a part of the weight, that is worth a warning."""


@dataclass(frozen=True)
class Centre:
    """Mass and centre of gravity of a body with its fixture, and the load cell's offsets; SI units, body frame."""

    mass: float
    """Mass [kg]."""
    r_cg: np.ndarray
    """Centre of gravity from Q [m]."""
    force_offset: np.ndarray
    """Constant force beside the weight: what is to be subtracted from the force on the body [N]."""
    moment_offset: np.ndarray
    """The same of the moment about Q [N·m]."""
    covariance: np.ndarray
    """Of the ten parameters in the order of ``PARAMETERS``, (10, 10)."""
    residuals: np.ndarray = field(repr=False)
    """Measured less fitted wrench of each pose, (n, 6) [N, N·m]."""
    degrees_of_freedom: int
    """Of the moment's residuals."""
    gravity: float
    """Local gravity that was used [m/s²]."""
    zero: np.ndarray | None = None
    """What the cell reads without a load, in its own sign and axes: Fx Fy Fz [N], Mx My Mz [N·m]."""
    warnings: tuple[str, ...] = ()
    assumptions: tuple[str, ...] = ()
    provenance: Mapping[str, Any] = field(default_factory=dict, repr=False)
    file_name: ClassVar[str] = "centre.json"
    """The file that holds it."""

    @property
    def values(self) -> np.ndarray:
        """The ten parameters in the order of ``PARAMETERS``."""
        return np.concatenate([[self.mass], self.r_cg, self.force_offset, self.moment_offset])

    @property
    def standard_uncertainty(self) -> np.ndarray:
        """Standard uncertainty of the ten parameters."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def coverage_factor(self) -> float:
        """Of 95 %, from Student's t."""
        return float(student.ppf(0.975, self.degrees_of_freedom))

    @property
    def poses(self) -> int:
        """Number of poses."""
        return len(self.residuals)

    @property
    def residual(self) -> tuple[float, float]:
        """Root mean square of the residuals, all axes: force [N], moment [N·m]."""
        square = self.residuals**2
        return float(np.sqrt(square[:, :3].mean())), float(np.sqrt(square[:, 3:].mean()))

    def to_dict(self) -> dict[str, Any]:
        """Return the content of centre.json, in SI."""
        u = self.standard_uncertainty.tolist()
        force, moment = self.residual
        return {
            "frame": "body",
            "about": "Q",
            "mass": {"value": self.mass, "standard_uncertainty": u[0]},
            "cg": {"value": self.r_cg.tolist(), "standard_uncertainty": u[1:4]},
            "offsets": {
                "force": {"value": self.force_offset.tolist(), "standard_uncertainty": u[4:7]},
                "moment": {"value": self.moment_offset.tolist(), "standard_uncertainty": u[7:]},
            },
            "zero": None if self.zero is None else {"force": self.zero[:3].tolist(), "moment": self.zero[3:].tolist()},
            "parameters": list(PARAMETERS),
            "units": list(UNITS),
            "covariance": self.covariance.tolist(),
            "coverage_factor": self.coverage_factor,
            "residual": {"force": force, "moment": moment},
            "poses": self.poses,
            "degrees_of_freedom": self.degrees_of_freedom,
            "gravity": self.gravity,
            "warnings": list(self.warnings),
            "assumptions": list(self.assumptions),
            "provenance": dict(self.provenance),
        }

    def rows(self) -> tuple[list[str], list[list[str]]]:
        """Return head and rows of the summary: x, y, z with standard uncertainties."""
        u = self.standard_uncertainty
        rows = [
            ["centre of gravity, mm", *_cells(1e3 * self.r_cg, 1e3 * u[1:4])],
            ["force offset, N", *_cells(self.force_offset, u[4:7])],
            ["moment offset, N·m", *_cells(self.moment_offset, u[7:])],
        ]
        if self.zero is not None:
            rows += [
                ["zero of the cell, N", *(_fixed(value, 3) for value in self.zero[:3])],
                ["zero of the cell, N·m", *(_fixed(value, 4) for value in self.zero[3:])],
            ]
        return ["", "x", "y", "z"], rows

    def correlation_rows(self) -> tuple[list[str], list[list[str]]]:
        """Return head and rows of the ten parameters' standard uncertainties, in SI, and of their correlations."""
        u = self.standard_uncertainty
        correlation = self.covariance / np.maximum(np.outer(u, u), 1e-300)
        rows = [
            [f"{name}, {unit}", f"{sigma:.2g}", *(_fixed(x, 2) for x in row)]
            for name, unit, sigma, row in zip(PARAMETERS, UNITS, u, correlation, strict=True)
        ]
        return ["", "u", *map(str, range(1, 11))], rows

    def title(self) -> str:
        """Return what the table is of, in one line."""
        force, moment = self.residual
        mass = with_error(self.mass, float(self.standard_uncertainty[0]))
        return f"mass {mass} kg from {self.poses} poses; residuals {force:.3g} N and {moment:.3g} N·m (rms)"

    def notes(self) -> list[str]:
        """Return warnings and assumptions, a line each."""
        return [f"warning: {text}" for text in self.warnings] + [f"assumed: {text}" for text in self.assumptions]

    def __repr__(self) -> str:
        return "\n".join([self.title(), text_table(*self.rows()), *self.notes()])

    def _repr_html_(self) -> str:
        listed = "".join(f"<li>{escape(text)}</li>" for text in self.notes())
        return f"{html_table(*self.rows(), caption=self.title())}<ul>{listed}</ul>"


def _cells(values: np.ndarray, errors: np.ndarray) -> list[str]:
    return [with_error(value, error) for value, error in zip(values, errors, strict=True)]


def _fixed(value: float, decimals: int) -> str:
    return f"{round(value, decimals) + 0.0:.{decimals}f}".replace("-", "−")


def centre(force: ArrayLike, moment: ArrayLike, specific_force: ArrayLike, *, name: str = "the poses") -> Centre:
    """Estimate mass, centre of gravity and offsets from static poses by least squares.

    Each system is ordinary least squares with the variance of its own residuals; ``r = (m r) / m``, and the covariance
    follows by the law of propagation (GUM 5.1.2; JCGM 102 6.2). The attitude is taken to be free of errors.

    Args:
        force: mean force on the body, in B [N], shape (n, 3).
        moment: mean moment on the body about Q, in B [N·m], shape (n, 3).
        specific_force: opposite to gravity, in B [m/s²], shape (n, 3); its length is local gravity.
        name: what messages call the data.

    Raises:
        RunError: wrong shapes, fewer than three poses, poses too much alike, a mass that is not positive.
    """
    F, M, f = (np.asarray(x, float) for x in (force, moment, specific_force))
    _check(F, M, f, name)
    gravity = float(np.linalg.norm(f, axis=1).mean())
    eye = np.broadcast_to(np.eye(3), (len(f), 3, 3))
    of_force, cov_force, rest_force = _least_squares(np.concatenate([f[:, :, None], eye], axis=2), F)
    of_moment, cov_moment, rest_moment = _least_squares(np.concatenate([-_cross_matrix(f), eye], axis=2), M)
    mass = of_force[0]
    if mass <= 0:
        raise RunError(
            f"the force in {name} points along gravity (mass {mass:.4g} kg): the wrench is that on the other side, "
            "or the attitude is upside down; correct recording.wrench or the attitude's declaration"
        )
    covariance = _propagate(mass, of_moment[:3] / mass, cov_force, cov_moment)
    share = float(np.sqrt((rest_force**2).mean())) / (mass * gravity)
    warnings = () if share < LARGE_RESIDUAL else (
        f"the force's residuals are {100 * share:.2g} % of the weight: check the rotations of load cell and attitude",
    )  # fmt: skip
    return Centre(
        float(mass), of_moment[:3] / mass, of_force[1:], of_moment[3:], covariance,
        np.hstack([rest_force, rest_moment]), 3 * len(f) - 6, gravity, warnings=warnings,
    )  # fmt: skip


def _check(F: np.ndarray, M: np.ndarray, f: np.ndarray, name: str) -> None:
    for what, values in (("force", F), ("moment", M), ("specific force", f)):
        if values.ndim != 2 or values.shape != (len(F), 3):
            raise RunError(f"{what} of {name} has shape {values.shape}: give ({len(F)}, 3), three components a pose")
        if not np.isfinite(values).all():
            bad = int(np.argmax(~np.isfinite(values).all(axis=1)))
            raise RunError(f"{what} of {name} is not finite at pose {bad + 1}: correct or remove it")
    if len(f) < 3:
        raise RunError(f"{len(f)} poses in {name}: give three or more, tilted about two axes")
    spread = np.linalg.svd(f - f.mean(axis=0), compute_uv=False) / (np.linalg.norm(f, axis=1).mean() * np.sqrt(len(f)))
    if spread[1] < LEAST_TILT:
        raise RunError(
            f"the poses of {name} are too much alike to tell the centre of gravity from the offsets (gravity turns by "
            f"{np.degrees(spread[1]):.2g}° in its second direction): tilt the body about two axes"
        )


def _cross_matrix(v: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3 3"]:
    """The matrices of ``v ×``."""
    x, y, z = v.T
    zero = np.zeros_like(x)
    return np.stack([zero, -z, y, z, zero, -x, -y, x, zero], axis=1).reshape(-1, 3, 3)


def _least_squares(rows: np.ndarray, values: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Estimate, covariance from the residuals, residuals (n, 3)."""
    matrix = rows.reshape(-1, rows.shape[2])
    q, upper = np.linalg.qr(matrix)
    inverse = np.linalg.inv(upper)
    estimate = inverse @ (q.T @ values.ravel())
    residuals = values - rows @ estimate
    variance = (residuals**2).sum() / (values.size - len(estimate))
    return estimate, variance * inverse @ inverse.T, residuals


def _propagate(mass: float, r_cg: np.ndarray, cov_force: np.ndarray, cov_moment: np.ndarray) -> np.ndarray:
    """Covariance of ``PARAMETERS`` from those of (m, F0) and (m r, M0)."""
    by_force, by_moment = np.zeros((10, 4)), np.zeros((10, 6))
    by_force[0, 0] = 1.0
    by_force[1:4, 0] = -r_cg / mass
    by_force[4:7, 1:] = np.eye(3)
    by_moment[1:4, :3] = np.eye(3) / mass
    by_moment[7:, 3:] = np.eye(3)
    return by_force @ cov_force @ by_force.T + by_moment @ cov_moment @ by_moment.T
