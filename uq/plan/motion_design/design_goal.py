"""The goal of a design: a smooth function of the tensor's predicted covariance and mean error.

What counts of a component is the objective: three times its root mean square error, ``3 √(σ² + b²)``, b the mean error,
which no repetition of the run shows; or its dispersion alone, 3σ. The first treats an uncorrected bias as a standard
uncertainty of its size (RSSu of Phillips, Eberhardt and Parry 1997, doi:10.6028/jres.102.039; see GUM F.2.4.5).
"""

from collections.abc import Callable

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from identify.rigid_body.inertia import MOMENTS, PRODUCTS
from identify.rigid_body.principal_axes import principal

GOALS = ("all", "moments", "products", "worst", "axis 1", "axis 2", "axis 3")
"""Average of moments and of products, each against the reference's; either; the worst component; a principal moment."""
OBJECTIVES = ("rms", "3sigma")
"""Three times the root mean square error, or 3σ."""
SHARP = 8
"""Power of the mean that stands for the larger of two or six."""

Measure = Callable[[Float[Array, "6 6"], Float[Array, "6"]], Float[Array, ""]]
"""Function of the tensor's covariance [(kg·m²)²] and mean error [kg·m²] that the search makes small."""


def expanded(covariance: Float[Array, "6 6"]) -> Float[Array, "6"]:
    """Return 3σ of each component [kg·m²]."""
    return 3 * jnp.sqrt(jnp.diagonal(covariance))


def goal_of(
    name: str,
    inertia: Float[np.ndarray, "6"],
    covariance: Float[np.ndarray, "6 6"],
    mean_error: Float[np.ndarray, "6"],
    objective: str = "rms",
) -> Measure:
    """Return the function of covariance and mean error that is to be small: 1 at the reference's, or below (worst).

    With the objective ``rms`` the mean square error ``C + b bᵀ`` stands in the covariance's place.

    Args:
        name: one of ``GOALS``.
        inertia: the stated tensor, packed, whose principal axes count [kg·m²].
        covariance: that is to be beaten [(kg·m²)²].
        mean_error: the same [kg·m²].
        objective: one of ``OBJECTIVES``.
    """
    part_widths = _parts(name, inertia)

    def widths(covariance, mean_error):
        return part_widths(covariance + jnp.outer(mean_error, mean_error) if objective == "rms" else covariance)

    base = widths(jnp.asarray(covariance), jnp.asarray(mean_error))
    base = base.max() if name == "worst" else base
    return lambda *predicted: ((widths(*predicted) / base) ** SHARP).mean() ** (1 / SHARP)


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
