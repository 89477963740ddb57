"""Mass, centre of gravity and offsets from static poses: the result, and how it is read back."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
import scipy

from identify.exceptions import RunError
from identify.reporting import VERSION, Drawing, Result, Section
from identify.rounding import fixed, rounded, significant, with_uncertainty
from identify.static.gain_check import GainCheck
from identify.text_tables import Table, sentence

PARAMETERS = (
    "mass", "cg_x", "cg_y", "cg_z",
    "force_offset_x", "force_offset_y", "force_offset_z", "moment_offset_x", "moment_offset_y", "moment_offset_z",
)  # fmt: skip
"""The order of a centre's covariance: kg, m, N, N·m."""
UNITS = ("kg", *("m",) * 3, *("N",) * 3, *("N*m",) * 3)
"""Units of the numbers in centre.json."""


@dataclass(frozen=True, repr=False)
class Centre(Result):
    """Mass and centre of gravity of a body with its fixture, and the load cell's offsets; SI units, body frame.

    Example: ``centre_file("poses.csv", experiment).to_frame().loc["cg_x"]``.
    """

    mass: float
    """Mass of the body with its fixture [kg]."""
    r_cg: np.ndarray
    """Centre of gravity from Q [m]."""
    force_offset: np.ndarray
    """Constant force beside the weight: what is to be subtracted from the force on the body [N]."""
    moment_offset: np.ndarray
    """Constant moment about Q beside that of the weight, to be subtracted from the recorded moment [N·m]."""
    covariance: np.ndarray
    """Covariance of the ten parameters in the order of ``PARAMETERS``, (10, 10)."""
    residuals: np.ndarray
    """Measured less fitted wrench of each pose, (n, 6) [N, N·m]."""
    degrees_of_freedom: np.ndarray | float
    """Effective degrees of freedom of each standard uncertainty (GUM G.4.1): one number for all, or (10,)."""
    gravity: float
    """Local gravity that was used [m/s²]."""
    zero: np.ndarray | None = None
    """Reading of the load cell without a load, in its own sign and axes: Fx Fy Fz [N], Mx My Mz [N·m]."""
    warnings: tuple[str, ...] = ()
    assumptions: tuple[str, ...] = ()
    provenance: Mapping[str, Any] = field(default_factory=dict)
    gain: GainCheck | None = None
    """The load cell's mass against a scale's; None: no scale."""
    largest_tilt: float | None = None
    """Largest tilt of a pose from the poses' mean direction of gravity [rad]."""
    lasting: np.ndarray | None = None
    """Change of the ten by errors that stay from one series of poses to the next, in ``covariance`` too: (10, k)."""
    lasting_names: tuple[str, ...] = ()
    """Names of the errors in ``lasting``, by which the errors of two series are matched."""
    file_name = "centre.json"
    kind = "inertia centre"
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
    def coverage_factor(self) -> np.ndarray:
        """Coverage factor of 95 % of each of the ten parameters, from Student's t."""
        return scipy.special.stdtrit(np.broadcast_to(self.degrees_of_freedom, len(PARAMETERS)), 0.975)

    @property
    def interval95(self) -> np.ndarray:
        """Coverage intervals of 95 % of the ten parameters, (10, 2)."""
        half = self.coverage_factor * self.standard_uncertainty
        return np.stack([self.values - half, self.values + half], axis=1)

    @property
    def directions(self) -> tuple[np.ndarray, np.ndarray]:
        """Directions in which the centre of gravity is known, best first (rows), and the uncertainty along them [m]."""
        variances, vectors = np.linalg.eigh(self.covariance[1:4, 1:4])
        axes = vectors.T * np.sign(vectors.T[np.arange(3), np.abs(vectors.T).argmax(axis=1)])[:, None]
        return axes, np.sqrt(np.maximum(variances, 0.0))

    @property
    def poses(self) -> int:
        """Number of poses."""
        return len(self.residuals)

    @property
    def residual(self) -> tuple[float, float]:
        """Root mean square of the residuals, all axes: force [N], moment [N·m]."""
        square = self.residuals**2
        return float(np.sqrt(square[:, :3].mean())), float(np.sqrt(square[:, 3:].mean()))

    @property
    def lasting_errors(self) -> dict[str, np.ndarray]:
        """``lasting`` by name, (10,) each."""
        columns = () if self.lasting is None else self.lasting.T
        names = self.lasting_names or tuple(f"attitude axis {k}" for k in range(1, len(columns) + 1))
        return dict(zip(names, columns, strict=True))

    def to_dict(self) -> dict[str, Any]:
        """Return the content of centre.json, in SI."""
        u, intervals = self.standard_uncertainty.tolist(), self.interval95.tolist()
        (force, moment), (axes, along) = self.residual, self.directions
        degrees = np.broadcast_to(self.degrees_of_freedom, len(PARAMETERS))

        def block(value: Any, where: slice) -> dict[str, Any]:
            return {"value": value.tolist(), "standard_uncertainty": u[where], "interval95": intervals[where]}

        return {
            **self.form(),
            "frame": "body",
            "about": "Q",
            "mass": {"value": self.mass, "standard_uncertainty": u[0], "interval95": intervals[0]},
            "cg": block(self.r_cg, slice(1, 4)),
            "offsets": {
                "force": block(self.force_offset, slice(4, 7)),
                "moment": block(self.moment_offset, slice(7, 10)),
            },
            "zero": None if self.zero is None else {"force": self.zero[:3].tolist(), "moment": self.zero[3:].tolist()},
            "parameters": list(PARAMETERS),
            "units": list(UNITS),
            "covariance": self.covariance.tolist(),
            "coverage_factor": self.coverage_factor.tolist(),
            "degrees_of_freedom": [float(free) if np.isfinite(free) else None for free in degrees],
            "directions": {"axes": axes.tolist(), "standard_uncertainty": along.tolist()},
            "largest_tilt": self.largest_tilt,
            "lasting": None if self.lasting is None else self.lasting.tolist(),
            "lasting_names": list(self.lasting_names),
            "gain": None if self.gain is None else self.gain.to_dict(),
            "residual": {"force": force, "moment": moment},
            "residuals": self.residuals.tolist(),
            "poses": self.poses,
            "gravity": self.gravity,
            "warnings": list(self.warnings),
            "assumptions": list(self.assumptions),
            "provenance": dict(self.provenance),
        }

    @classmethod
    def from_dict(cls, content: object, name: str = "centre.json") -> "Centre":
        """Return the centre that a centre.json holds.

        Args:
            content: what :meth:`to_dict` wrote.
            name: what messages call it.

        Raises:
            RunError: it is not a centre of this version, or its figures cannot be used.
        """
        if not isinstance(content, Mapping) or content.get("kind") != Centre.kind:
            raise RunError(f"{name} is no result of `inertia centre`: give the centre.json that it wrote")
        if content.get("version") != VERSION:
            raise RunError(f"{name} is of another version than {VERSION}: run `inertia centre` again")
        if content.get("parameters") != list(PARAMETERS) or content.get("units") != list(UNITS):
            raise RunError(f"{name} has other parameters or units than those of a centre: run `inertia centre` again")
        return _read(cls, _Content(content, name))

    def tables(self) -> list[Table]:
        """Return centre of gravity and offsets: x, y, z with standard uncertainties, and the expanded ones of 95 %."""
        u, expanded = self.standard_uncertainty, self.coverage_factor * self.standard_uncertainty
        rows = [
            ["centre of gravity, mm", *_cells(1e3 * self.r_cg, 1e3 * u[1:4])],
            ["· 95 %", *_expanded(1e3 * expanded[1:4])],
            ["force offset, N", *_cells(self.force_offset, u[4:7])],
            ["· 95 %", *_expanded(expanded[4:7])],
            ["moment offset, N·m", *_cells(self.moment_offset, u[7:])],
            ["· 95 %", *_expanded(expanded[7:])],
        ]
        if self.zero is not None:
            rows += [
                ["zero of the cell, N", *(fixed(value, 3) for value in self.zero[:3])],
                ["zero of the cell, N·m", *(fixed(value, 4) for value in self.zero[3:])],
            ]
        return [Table("Centre of gravity and offsets", ["", "x", "y", "z"], rows)]

    def overview(self) -> list[Table]:
        """Return the same, below the title."""
        return [replace(table, caption="") for table in self.tables()]

    def _correlations(self) -> Table:
        """The ten parameters' standard uncertainties, in SI, and their correlations."""
        u = self.standard_uncertainty
        correlation = self.covariance / np.maximum(np.outer(u, u), 1e-300)
        rows = [
            [f"{name}, {unit}", significant(sigma, 2), *(fixed(x, 2) for x in row)]
            for name, unit, sigma, row in zip(PARAMETERS, UNITS, u, correlation, strict=True)
        ]
        head = ["", "u", *map(str, range(1, 11))]
        return Table("Standard uncertainties in SI, and correlations", head, rows)

    def title(self) -> str:
        """Return mass, poses and residuals in one line."""
        force, moment = self.residual
        u = float(self.standard_uncertainty[0])
        mass = with_uncertainty(self.mass, u)
        low, high = self.interval95[0]
        return (
            f"mass {mass} kg (95 %: {rounded(low, u)} … {rounded(high, u)}) from {self.poses} poses; "
            f"residuals {significant(force)} N and {significant(moment)} N·m (rms)"
        )

    def notes(self) -> list[str]:
        """Return warnings and assumptions, a line each."""
        return [
            *self.findings(),
            *(f"warning: {text}" for text in self.warnings),
            *(f"assumed: {text}" for text in self.assumptions),
        ]

    def findings(self) -> list[str]:
        """Return how well the poses determine the centre, and the check against a scale."""
        axes, along = self.directions
        worst = ", ".join(fixed(x, 2) for x in axes[2])
        best, most = (significant(1e3 * along[k], 2) for k in (0, 2))
        tilt = "" if self.largest_tilt is None else f"tilted by up to {np.degrees(self.largest_tilt):.3g}°: "
        along_axes = f"known worst along ({worst}), to {most} mm, and best to {best} mm"
        finding = f"{tilt}the centre of gravity is {along_axes}"
        return [finding, *([] if self.gain is None else [self.gain.verdict])]

    def records(self) -> list[dict[str, Any]]:
        """Return value, standard uncertainty and interval of each of the ten parameters, in SI."""
        columns = zip(PARAMETERS, UNITS, self.values, self.standard_uncertainty, *self.interval95.T, strict=True)
        names = ("parameter", "unit", "value", "standard_uncertainty", "low95", "high95")
        return [dict(zip(names, row, strict=True)) for row in columns]

    def drawings(self) -> list[Drawing]:
        """Return the figure of the residuals."""

        def draw():
            from identify.static.pose_figures import pose_residuals

            return pose_residuals(self.residuals)

        return [Drawing("residuals", "What each pose leaves unexplained.", draw)]

    def section(self) -> Section:
        """Return its part of a report."""
        return Section(
            title="Mass and centre of gravity of a body",
            computed=[f"From static poses, by least squares: {self.title()}; local gravity {self.gravity:.6g} m/s². "
             "Force, moment and centre of gravity are in the body frame, about Q; ± is a standard uncertainty.",
             *map(sentence, self.findings())],
            findings=self.warnings,
            tables=self.tables(),
            drawings=self.drawings(),
            details=[self._correlations()],
            assumptions=list(map(sentence, self.assumptions)),
            provenance=self.provenance,
        )  # fmt: skip


def _cells(values: np.ndarray, errors: np.ndarray) -> list[str]:
    return [with_uncertainty(value, error) for value, error in zip(values, errors, strict=True)]


def _expanded(values: np.ndarray) -> list[str]:
    return [f"± {significant(value, 2)}" for value in values]


class _Content:
    """The content of a centre.json, figure by figure."""

    def __init__(self, content: Mapping[str, Any], name: str) -> None:
        self.content, self.name = content, name

    def array(self, *keys: str, shape: tuple[int, ...]) -> np.ndarray:
        """Finite numbers of this shape, -1 for any length."""
        value: Any = self.content
        for key in keys:
            value = value.get(key) if isinstance(value, Mapping) else None
        try:
            values = np.asarray(value, float)
        except (TypeError, ValueError, OverflowError):
            values = np.array(np.nan)
        fits = values.ndim == len(shape) and all(n in (-1, m) for n, m in zip(shape, values.shape, strict=False))
        if not fits or not np.isfinite(values).all():
            raise RunError(f"{'.'.join(keys)} of {self.name} is missing or not finite: run `inertia centre` again")
        return values

    def texts(self, key: str) -> tuple[str, ...]:
        texts = self.content.get(key)
        return tuple(map(str, texts)) if isinstance(texts, list) else ()


def _read(cls: type[Centre], content: _Content) -> Centre:
    n = len(PARAMETERS)
    provenance = content.content.get("provenance") or {}
    if not isinstance(provenance, Mapping):
        raise RunError(f"provenance of {content.name} is no table: run `inertia centre` again")
    mass = float(content.array("mass", "value", shape=()))
    covariance = content.array("covariance", shape=(n, n))
    scale = np.sqrt(np.outer(np.diag(covariance), np.diag(covariance)).clip(0))
    if (np.abs(covariance - covariance.T) > 1e-9 * scale).any() or _least(covariance) < -1e-9:
        raise RunError(
            f"covariance of {content.name} is none, not symmetric or not positive: run `inertia centre` again"
        )
    if mass <= 0:
        raise RunError(f"mass of {content.name} is {mass:g} kg: give one above zero")
    degrees = content.content.get("degrees_of_freedom")
    free = [np.inf if value is None else value for value in degrees] if isinstance(degrees, list) else []
    if len(free) != n or not all(isinstance(value, (int, float)) and value > 0 for value in free):
        raise RunError(f"degrees_of_freedom of {content.name} are missing: run `inertia centre` again")
    lasting = None if content.content.get("lasting") is None else content.array("lasting", shape=(n, -1))
    return cls(
        mass=mass,
        r_cg=content.array("cg", "value", shape=(3,)),
        force_offset=content.array("offsets", "force", "value", shape=(3,)),
        moment_offset=content.array("offsets", "moment", "value", shape=(3,)),
        covariance=covariance,
        residuals=content.array("residuals", shape=(-1, 6)),
        degrees_of_freedom=np.array(free, float),
        gravity=float(content.array("gravity", shape=())),
        warnings=content.texts("warnings"),
        assumptions=content.texts("assumptions"),
        provenance=dict(provenance),
        lasting=lasting,
        lasting_names=content.texts("lasting_names"),
    )


def _least(covariance: np.ndarray) -> float:
    """The least eigenvalue of the correlations."""
    u = np.sqrt(np.diag(covariance).clip(1e-300))
    return float(np.linalg.eigvalsh(covariance / np.outer(u, u))[0])
