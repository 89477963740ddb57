"""Lower bound of the predicted uncertainty that no motion of a platform can beat under its limits.

With the legs' Jacobian of home and without products of omega, the load cell's white noise alone gives every unbiased
linear estimate at least the covariance ``(n mean(Ωᵀ S⁻¹ Ω))⁻¹`` (Gauss and Markov), linear in the second moment of
alpha inside. :mod:`identify.motion.information_bound` bounds it over all second moments that the legs can have.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from identify.motion.information_bound import Uncertainty, least, tensor_covariance
from identify.motion.largest_mean_square import largest_amplitude, largest_mean_square
from identify.motion.leg_limits import Limits
from identify.motion.stewart_platform import jacobian, lengths
from identify.rigid_body.inertia import MOMENTS, PRODUCTS
from uq.analysis.propagation.prediction import Prediction
from uq.experiment.experiment import Experiment, TrajectorySpec

RELAXED = (
    "the legs' Jacobian is that of home, and products of omega are ignored",
    "of all sources only the white noise of load cell force and moment counts, weighted as best it can be",
    "of all limits only stroke, speed, acceleration and bandwidth count, each leg's for itself",
    "ramps take no time",
)
"""Requirements on a motion that the bound leaves out."""


@dataclass(frozen=True)
class DesignBound:
    """Least average 3σ that the limits allow, and what the bound leaves out."""

    moments: float
    """Least average 3σ of the three moments [kg·m²]."""
    products: float
    """Least average 3σ of the three products [kg·m²]."""
    relaxes: tuple[str, ...] = RELAXED
    """Requirements on a motion that the bound leaves out."""


def design_bound(
    experiment: Experiment, spec: TrajectorySpec, limits: Limits, squares: Float[np.ndarray, "6"] | None = None
) -> DesignBound | None:
    """Return what no motion of any frequencies up to the bandwidth can beat under these limits.

    Args:
        experiment: body, platform and sources.
        spec: how long and how often is sampled.
        limits: in figures.
        squares: mean square of each leg's acceleration [m²/s⁴]; None: the largest that the limits allow. A motion's own
            tell how much better the same fluctuation could be shared among the legs.

    Returns:
        The bound; None where stroke and speed of a leg are free, or the load cell has no white noise.
    """
    if squares is None:
        leg_limits = zip(largest_accelerations(experiment, limits), limits.speed, strict=True)
        squares = np.array([largest_mean_square(*leg, limits.bandwidth) for leg in leg_limits])
    noise = np.asarray(Prediction.of(experiment, spec).moment_noise)
    if np.linalg.eigvalsh(noise)[0] <= 0 or not np.isfinite(squares).all():
        return None
    platform = experiment.platform
    to_alpha = np.linalg.inv(np.asarray(jacobian(platform, platform.home_pose)))[3:]
    samples = spec.rate * spec.duration
    moments, products = (
        least(average_uncertainty(samples, noise, components), squares, to_alpha) / 1e3
        for components in (MOMENTS, PRODUCTS)
    )
    return DesignBound(moments, products)


def largest_accelerations(experiment: Experiment, limits: Limits) -> Float[np.ndarray, "6"]:
    """Return the largest acceleration of each leg [m/s²] that its limits and the command's bandwidth allow."""
    leg_limits = zip(limits.acceleration, limits.speed, largest_strokes(experiment, limits), strict=True)
    return np.array([largest_amplitude(*leg, limits.bandwidth) for leg in leg_limits])


def largest_strokes(experiment: Experiment, limits: Limits) -> Float[np.ndarray, "6"]:
    """Return how far each leg may go from its length at home, at most [m]."""
    home = np.asarray(lengths(experiment.platform, experiment.platform.home_pose))
    return np.abs(limits.length - home[:, None]).max(axis=1)


def average_uncertainty(samples: float, noise: Float[np.ndarray, "3 3"], components: Sequence[int]) -> Uncertainty:
    """Return the average 3σ [g·m²] of components as a function of the second moment of alpha [rad²/s⁴]."""
    covariance = tensor_covariance(samples, noise)
    return lambda moment: 3e3 * jnp.sqrt(jnp.diagonal(covariance(moment))[jnp.array(components)]).mean()
