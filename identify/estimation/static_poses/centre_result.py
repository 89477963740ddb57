"""Mass, centre of gravity and offsets from static poses: the result, and how it is read back."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import scipy

from identify.display.reporting import VERSION, Result, interval_records
from identify.estimation.static_poses.gain_check import GainCheck
from identify.exceptions import RunError
from identify.results.covariances import least_eigenvalue
from identify.results.ledger import Ledger, Row

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
    undeclared: Ledger | None = None
    """Errors that ``interval95`` leaves out, at typical size, and what they do to the ten; None: not looked at."""
    by_wrench: np.ndarray | None = None
    """Derivative of the ten by the wrench of each pose (10, n, 6); None: read from a file, which does not hold it."""
    further: np.ndarray | None = None
    """Further columns of the wrench of each pose that were estimated along, such as a drift (n, 6, c); None: none, or
    read from a file."""
    file_name = "centre.json"
    kind = "inertia centre"

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
    def conventional_bound(self) -> np.ndarray | None:
        """Intervals of the ten parameters, widened by k = 2 of undeclared errors, (10, 2); None: not known."""
        return None if self.undeclared is None else self.undeclared.bounds(self.values, self.interval95)

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

        ends = self.conventional_bound
        bounds = None if ends is None else ends.tolist()

        def block(value: Any, where: slice | int) -> dict[str, Any]:
            return {
                "value": value,
                "standard_uncertainty": u[where],
                "interval95": intervals[where],
                "conventional_bound": None if bounds is None else bounds[where],
            }

        return {
            **self.form(),
            "frame": "body",
            "about": "Q",
            "mass": block(self.mass, 0),
            "cg": block(self.r_cg.tolist(), slice(1, 4)),
            "offsets": {
                "force": block(self.force_offset.tolist(), slice(4, 7)),
                "moment": block(self.moment_offset.tolist(), slice(7, 10)),
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
            "undeclared": None if self.undeclared is None else list(map(_row_content, self.undeclared.rows)),
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

    def records(self) -> list[dict[str, Any]]:
        """Return value, standard uncertainty and interval of each of the ten parameters, in SI."""
        return interval_records(self, parameter=PARAMETERS, unit=UNITS, value=self.values)


def _row_content(row: Row) -> dict[str, Any]:
    figures = {"name": row.error, "text": row.text, "figure": row.figure, "signed": row.signed}
    return figures | {"changes": row.changes.tolist()}


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
    variances = np.diag(covariance)
    asymmetric = np.abs(covariance - covariance.T) > 1e-9 * np.sqrt(np.outer(variances, variances).clip(0))
    if asymmetric.any() or variances.min() < 0 or least_eigenvalue(covariance) < -1e-9:
        raise RunError(
            f"covariance of {content.name} is missing, not symmetric or not positive definite: run `inertia centre` "
            "again"
        )
    if mass <= 0:
        raise RunError(f"mass of {content.name} is {mass:g} kg: give one above zero")
    degrees = content.content.get("degrees_of_freedom")
    free = [np.inf if value is None else value for value in degrees] if isinstance(degrees, list) else []
    if len(free) != n or not all(isinstance(value, (int, float)) and value > 0 for value in free):
        raise RunError(f"degrees_of_freedom of {content.name} are missing: run `inertia centre` again")
    lasting = None if content.content.get("lasting") is None else content.array("lasting", shape=(n, -1))
    names = content.texts("lasting_names")
    if names and len(names) != (0 if lasting is None else lasting.shape[1]):
        raise RunError(f"lasting and lasting_names of {content.name} differ in number: run `inertia centre` again")
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
        lasting_names=names,
        undeclared=_undeclared(content),
    )


def _undeclared(content: _Content) -> Ledger | None:
    effects = content.content.get("undeclared")
    if effects is None:
        return None
    try:
        texts = [[str(effect[key]) for key in ("name", "text", "figure")] for effect in effects]
        tables = [_Content(effect, content.name) for effect in effects]
    except (TypeError, KeyError):
        raise RunError(f"undeclared of {content.name} is no list of errors: run `inertia centre` again") from None
    changes = [table.array("changes", shape=(len(PARAMETERS), -1)) for table in tables]
    return Ledger(
        tuple(
            Row(error=name, text=text, figure=figure, changes=by, tier="typical", key=f"typical {name}")
            for (name, text, figure), by in zip(texts, changes, strict=True)
        )
    )
