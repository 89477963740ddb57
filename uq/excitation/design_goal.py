"""What a design is to make small: a smooth function of the tensor's predicted covariance."""

from collections.abc import Callable

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from identify.rigid_body.inertia import MOMENTS, PRODUCTS
from identify.rigid_body.principal_axes import principal
from uq.files.document import ExperimentError

GOALS = ("all", "moments", "products", "worst", "axis 1", "axis 2", "axis 3")
"""Average 3σ of moments and products, each against the reference's; either; the worst component; a principal moment."""
SHARP = 8
"""Power of the mean that stands for the larger of two or six."""

Measure = Callable[[Float[Array, "6 6"]], Float[Array, ""]]


def expanded(covariance: Float[Array, "6 6"]) -> Float[Array, "6"]:
    """Return 3σ of each component [kg·m²]."""
    return 3 * jnp.sqrt(jnp.diagonal(covariance))


def goal_of(name: str, inertia: Float[np.ndarray, "6"], reference: Float[np.ndarray, "6 6"]) -> Measure:
    """Return the function of the covariance [(kg·m²)²] that is to be small: 1 at the reference's, or below (worst).

    Args:
        name: one of ``GOALS``.
        inertia: the stated tensor, packed, whose principal axes count [kg·m²].
        reference: covariance that is to be beaten.

    Raises:
        ExperimentError: an unknown goal.
    """
    if name not in GOALS:
        raise ExperimentError(f"unknown goal '{name}': choose one of {', '.join(GOALS)}")
    widths = _parts(name, inertia)
    base = widths(jnp.asarray(reference))
    base = base.max() if name == "worst" else base
    return lambda covariance: ((widths(covariance) / base) ** SHARP).mean() ** (1 / SHARP)


def _parts(name: str, inertia: np.ndarray) -> Callable[[Array], Array]:
    if name == "worst":
        return expanded
    if name.startswith("axis"):
        slope = jnp.asarray(principal_slope(inertia, int(name[-1]) - 1))
        return lambda covariance: jnp.sqrt(slope @ covariance @ slope)[None]
    which = {"all": (MOMENTS, PRODUCTS), "moments": (MOMENTS,), "products": (PRODUCTS,)}[name]
    return lambda covariance: jnp.stack([expanded(covariance)[jnp.array(components)].mean() for components in which])


def principal_slope(inertia: Float[np.ndarray, "6"], axis: int) -> Float[np.ndarray, "6"]:
    """Return the derivative of a principal moment, the least first, by the packed tensor's components."""
    x, y, z = np.asarray(principal(jnp.asarray(inertia))[1])[axis]
    return np.array([x * x, 2 * x * y, 2 * x * z, y * y, 2 * y * z, z * z])
