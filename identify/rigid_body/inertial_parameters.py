"""Mass, centre of gravity and tensor of a body as one measured quantity: about another point, in another frame.

What is derived from the ten parameters takes their whole covariance along (JCGM 102, 6.2), by autodiff.
"""

from dataclasses import dataclass, field
from typing import Any, NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array
from numpy.typing import ArrayLike

from identify.display.reporting import Shown
from identify.exceptions import RunError
from identify.rigid_body.inertia import COMPONENTS, parallel_axis, rotate
from identify.rigid_body.principal_axes import Principal, principal_axes, propagated
from identify.rigid_body.rotation import exponential

PARAMETERS = ("mass", "cg_x", "cg_y", "cg_z", *COMPONENTS)
"""The order of the covariance: kg, m, kg·m²."""


class Tensor(NamedTuple):
    """A packed tensor with its uncertainty."""

    inertia: np.ndarray
    """Packed tensor of the body [kg·m²]."""
    covariance: np.ndarray
    """Covariance of ``inertia``, (6, 6) [(kg·m²)²]."""

    @property
    def standard_uncertainty(self) -> np.ndarray:
        """Standard uncertainty of each component [kg·m²]."""
        return np.sqrt(np.diag(self.covariance))

    def to_dict(self) -> dict[str, Any]:
        """Return what result.json says of it, in kg·m²."""
        return {
            "inertia": by_component(self.inertia),
            "standard_uncertainty": by_component(self.standard_uncertainty),
            "covariance": self.covariance.tolist(),
        }


@dataclass(frozen=True)
class Datum:
    """A frame fixed to the body, D, in which results are wanted."""

    rotation: np.ndarray
    """R with components in D = R · components in B."""
    position: np.ndarray
    """Origin of D from Q, in B [m]."""
    covariance: np.ndarray = field(default_factory=lambda: np.zeros((6, 6)))
    """Covariance of a small turn about the axes of D [rad] and of ``position`` [m], (6, 6)."""


@dataclass(frozen=True, repr=False)
class InertialParameters(Shown):
    """The ten parameters of a rigid body with their covariance. SI units."""

    mass: float
    """Mass of the body [kg]; NaN: not stated."""
    r_cg: np.ndarray
    """Centre of gravity from the frame's origin, in the frame [m]; of a result: from Q, in B."""
    inertia: np.ndarray
    """Packed tensor about the centre of gravity [kg·m²]."""
    covariance: np.ndarray
    """Covariance of the ten parameters in the order of ``PARAMETERS``, (10, 10); NaN on the diagonal of an unknown
    mass."""

    @property
    def values(self) -> np.ndarray:
        """The ten parameters in the order of ``PARAMETERS``."""
        return np.concatenate([[self.mass], self.r_cg, self.inertia])

    @property
    def standard_uncertainty(self) -> np.ndarray:
        """Standard uncertainty of the ten parameters."""
        return np.sqrt(np.diag(self.covariance))

    def records(self) -> list[dict[str, Any]]:
        """Return value and standard uncertainty of the ten parameters, in SI."""
        rows = zip(PARAMETERS, self.values, self.standard_uncertainty, strict=True)
        return [dict(zip(("parameter", "value", "standard_uncertainty"), row, strict=True)) for row in rows]

    @property
    def tensor(self) -> Tensor:
        """The tensor about the centre of gravity."""
        return Tensor(self.inertia, self.covariance[4:, 4:])

    @property
    def principal(self) -> Principal:
        """Principal moments and axes about the centre of gravity."""
        return principal_axes(self.inertia, self.covariance[4:, 4:])

    def about(self, point: ArrayLike = (0.0, 0.0, 0.0), covariance: ArrayLike | None = None) -> Tensor:
        """Return the tensor about a point (Huygens–Steiner).

        Args:
            point: from the frame's origin, in the frame [m]; the default is the origin: Q of a result.
            covariance: of the point, (3, 3) [m²]; None: it is exact.

        Raises:
            RunError: the mass is not known.
        """
        self._need_mass("tensor about another point")
        start = np.concatenate([self.values, np.asarray(point, float)])
        spread = _block(self.covariance, np.zeros((3, 3)) if covariance is None else np.asarray(covariance, float))
        return Tensor(*propagated(_about, start, spread))

    def in_frame(
        self, rotation: ArrayLike, origin: ArrayLike = (0.0, 0.0, 0.0), covariance: ArrayLike | None = None
    ) -> "InertialParameters":
        """Return the parameters in another frame of the body, the tensor still about the centre of gravity.

        Args:
            rotation: R with new components = R · components now, (3, 3).
            origin: of the new frame, from that of this one, in this one [m].
            covariance: of a small turn about the new axes [rad] and of ``origin`` [m], (6, 6); None: they are exact.
        """
        start = np.concatenate([self.values[1:], np.zeros(3), np.asarray(origin, float)])
        finite = np.nan_to_num(self.covariance) if np.isnan(self.mass) else self.covariance
        spread = _block(finite, np.zeros((6, 6)) if covariance is None else np.asarray(covariance, float))
        mass = 0.0 if np.isnan(self.mass) else self.mass
        values, covariance = propagated(_in_frame, np.concatenate([[mass], start]), spread, np.asarray(rotation, float))
        covariance[0, 0] = self.covariance[0, 0]
        return InertialParameters(self.mass, values[1:4], values[4:], covariance)

    def in_datum(self, datum: Datum) -> "InertialParameters":
        """Return the parameters in a declared frame, with the uncertainty of its pose."""
        return self.in_frame(datum.rotation, datum.position, datum.covariance)

    def to_dict(self) -> dict[str, Any]:
        """Return what result.json says of them; the tensor about the origin is null where the mass is not known."""
        has_mass, u = bool(np.isfinite(self.mass)), self.standard_uncertainty
        return {
            "mass": {"value": self.mass, "standard_uncertainty": float(u[0])} if has_mass else None,
            "cg": {"value": self.r_cg.tolist(), "standard_uncertainty": u[1:4].tolist()},
            "about_cg": self.tensor.to_dict(),
            "about_origin": self.about().to_dict() if has_mass else None,
        }

    def _need_mass(self, what: str) -> None:
        if not np.isfinite(self.mass):
            raise RunError(f"the {what} needs the mass: state it, or find it from static poses")


def by_component(values: ArrayLike) -> dict[str, Any]:
    """Return the six values of a packed tensor by their names."""
    return dict(zip(COMPONENTS, np.asarray(values, float).tolist(), strict=True))


def _about(start: Array) -> Array:
    """The tensor about a point, from the ten parameters and the point's position."""
    return parallel_axis(start[4:10], start[0], start[10:] - start[1:4])


def _in_frame(start: Array, rotation: Array) -> Array:
    """The ten parameters in another frame, from those of this one, a turn about the new axes and the new origin."""
    turned = exponential(start[10:13]) @ rotation
    return jnp.concatenate([start[:1], turned @ (start[1:4] - start[13:]), rotate(start[4:10], turned)])


def _block(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """The covariance of two quantities that have nothing in common."""
    n, m = len(first), len(second)
    covariance = np.zeros((n + m, n + m))
    covariance[:n, :n], covariance[n:, n:] = first, second
    return covariance
