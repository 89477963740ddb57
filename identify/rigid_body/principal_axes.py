"""Principal moments and axes of a tensor, with their uncertainty; whether a body can have them."""

from collections.abc import Callable
from functools import cache
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float

from identify.rigid_body.inertia import rotate, unpack
from identify.rigid_body.regressor import Array, ArrayT

LARGEST_ANGLE = 0.2
"""Standard uncertainty of a principal axis [rad] beyond which it counts as not determined: 95 % are ±23°."""


class Principal(NamedTuple):
    """Principal moments and axes with their uncertainty, to first order in the tensor's."""

    moments: np.ndarray
    """Principal moments, ascending [kg·m²]."""
    axes: np.ndarray
    """Principal axes in B, the rows of a right-handed rotation."""
    standard_uncertainty: np.ndarray
    """Standard uncertainty of ``moments`` [kg·m²]."""
    angles: np.ndarray
    """Standard uncertainty of the rotation about each principal axis [rad]; infinite where moments are equal."""

    @property
    def determined(self) -> np.ndarray:
        """Mask of the determined axes: no turn that moves such an axis is uncertain by more than ``LARGEST_ANGLE``."""
        determined = self.angles <= LARGEST_ANGLE
        return np.array([determined[1] & determined[2], determined[2] & determined[0], determined[0] & determined[1]])

    @property
    def note(self) -> str | None:
        """Text that names the axes that are not determined; None: all are."""
        lost = [f"{k + 1}" for k in range(3) if not self.determined[k]]
        if not lost:
            return None
        equal = "all three moments are" if len(lost) == 3 else f"the moments {' and '.join(lost)} are"
        return f"{equal} alike within their uncertainty: the axes {', '.join(lost)} are not determined"

    def to_dict(self) -> dict[str, Any]:
        """Return what result.json says of them; the angle of a turn that is not determined is null."""
        angles = [float(angle) if angle <= LARGEST_ANGLE else None for angle in self.angles]
        return {
            "moments": self.moments.tolist(),
            "axes": self.axes.tolist(),
            "standard_uncertainty": self.standard_uncertainty.tolist(),
            "axes_standard_uncertainty": angles,
            "axes_determined": self.determined.tolist(),
            "note": self.note,
        }


def principal_axes(inertia: Float[np.ndarray, "6"], covariance: Float[np.ndarray, "6 6"]) -> Principal:
    """Return principal moments and axes with their uncertainty.

    In the principal axes a small change of the tensor moves moment i by its entry ii, and turns the axes i and j by its
    entry ij over the difference of their moments. Of moments that are equal within their uncertainty neither the axes
    nor which of the two is larger is determined; the larger then comes out too large on average.

    Args:
        inertia: packed tensor [kg·m²].
        covariance: its covariance [(kg·m²)²].
    """
    moments, axes = principal(np.asarray(inertia))
    turn = np.array([rotate(unit, axes) for unit in np.eye(6)]).T
    spread = np.sqrt(np.diag(turn @ covariance @ turn.T))
    gaps = np.abs(np.array([moments[1] - moments[2], moments[2] - moments[0], moments[0] - moments[1]]))
    with np.errstate(divide="ignore", invalid="ignore"):
        angles = np.where(gaps > 0, spread[[4, 2, 1]] / gaps, np.inf)
    return Principal(moments, axes, spread[[0, 3, 5]], angles)


def principal(inertia: Float[ArrayT, "6"]) -> tuple[Float[ArrayT, "3"], Float[ArrayT, "3 3"]]:
    """Return the principal moments [kg·m²], ascending, and their axes in B as the rows of a rotation matrix.

    Of an array of JAX or of NumPy, arrays of the same kind.
    """
    xp = inertia.__array_namespace__()
    moments, vectors = xp.linalg.eigh(unpack(inertia))
    axes = vectors.T
    return moments, axes * xp.array([1.0, 1.0, xp.sign(xp.linalg.det(axes))])[:, None]


def propagated(
    function: Callable[..., Any], at: np.ndarray, covariance: np.ndarray, *exact: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return a function's value and covariance: ``J V Jᵀ`` (JCGM 102, 6.2.1.3), J by autodiff.

    Args:
        function: pure JAX, of ``at`` and of what is ``exact``; compiled once if it is a module's.
        at: the uncertain numbers.
        covariance: theirs.
        exact: what else it needs.
    """
    value, jacobian = value_and_jacobian(function, at, *exact)
    return value, jacobian @ covariance @ jacobian.T


def value_and_jacobian(
    function: Callable[..., Any], at: np.ndarray, *exact: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return a function's value and its derivatives by its first argument; arguments as of :func:`propagated`."""
    value, jacobian = _compiled()(function, at, *exact)
    return np.array(value), np.array(jacobian)


@cache
def _compiled() -> Callable[..., Any]:
    import jax  # the rest of this module starts without it

    return jax.jit(lambda f, *at: (f(*at), jax.jacobian(f)(*at)), static_argnums=0)


def is_admissible(inertia: Float[Array, "6"]) -> Bool[Array, ""]:
    """Whether a mass distribution with this tensor exists: positive moments that obey the triangle inequality."""
    moments, _ = principal(inertia)
    return (moments[0] > 0) & (moments[0] + moments[1] >= moments[2])
