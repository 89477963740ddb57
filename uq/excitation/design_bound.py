"""What no motion of a platform can beat: a lower bound of the predicted uncertainty under its limits.

With the legs' Jacobian of home and without products of omega, the load cell's white noise alone gives every unbiased
linear estimate at least the covariance ``(n mean(Ωᵀ S⁻¹ Ω))⁻¹`` (Gauss and Markov), linear in the second moment of
alpha inside. :mod:`identify.motion.information_bound` bounds it over all second moments that the legs can have.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from identify.motion.information_bound import Uncertainty, least
from identify.motion.leg_limits import Limits
from identify.motion.mean_square_of_band import largest_amplitude, largest_mean_square
from identify.motion.mean_square_of_period import ramp_mean_square, repeating_mean_square
from identify.motion.stages import rising
from identify.motion.stewart_platform import jacobian, lengths
from identify.motion.trajectory import Multisine
from identify.rigid_body.inertia import MOMENTS, PRODUCTS
from identify.rigid_body.regressor import cross_matrix, omega_r
from uq.experiment.experiment import Experiment, TrajectorySpec
from uq.propagation.prediction import Prediction

RELAXED = (
    "the legs' Jacobian is that of home, and products of omega tell nothing",
    "of all sources only the white noise of load cell force and moment counts, weighted as best it can be",
    "of all limits only stroke, speed, acceleration and bandwidth count, each leg's for itself",
    "ramps take no time",
)
"""What the bound does not ask of a motion."""
HARMONICS = 4
"""Most that a motion has which repeats: it does so within less than one more period of the bandwidth."""


@dataclass(frozen=True)
class DesignBound:
    """Least average 3σ that the limits allow, and what the bound leaves out."""

    moments: float
    """Of the three moments [kg·m²]."""
    products: float
    """Of the three products [kg·m²]."""
    relaxes: tuple[str, ...]
    """What the bound does not ask of a motion."""
    period: float = np.inf
    """It holds for motions, or stages of them, that repeat within less than this [s]; infinite: for all."""


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
        amplitudes, ratio = amplitudes_of(experiment, limits)
        squares = amplitudes**2 * _any(ratio, limits.bandwidth)
    return _of_squares(experiment, spec, squares, RELAXED, np.inf)


def repeating_bound(experiment: Experiment, spec: TrajectorySpec, limits: Limits) -> DesignBound | None:
    """Return what no motion can beat that repeats soon, or whose stages do, if this one does.

    Soon is within less than ``(HARMONICS + 1) / bandwidth``. Motions start and stop as this one does, and repeat for as
    long: its whole periods at full size. What is left counts as if the legs could be at their limits all the time.

    Args:
        experiment: body, platform and sources.
        spec: how long and how often is sampled; how stages start and stop.
        limits: in figures.

    Returns:
        The bound; None if this motion is of another kind, or where a leg's speed is free, or :func:`design_bound` None.
    """
    trajectory, period = spec.trajectory, (HARMONICS + 1) / limits.bandwidth
    amplitudes, ratio = amplitudes_of(experiment, limits)
    if not (isinstance(trajectory, Multisine) and trajectory.period < period and np.isfinite(ratio)):
        return None
    ramp, ends = float(trajectory.ramp), np.unique(np.asarray(trajectory.end))
    full = np.diff(ends, prepend=0.0) - 2 * ramp
    repeats = (np.floor(full / trajectory.period + 1e-6) * trajectory.period).sum()
    ramps = 2 * ramp * len(ends)
    window = np.asarray(rising(np.arange(1, 4001) / 4000 * ramp, ramp)) if ramp > 0 else np.zeros((4, 1))
    strokes = (_strokes(experiment, limits) / amplitudes).max()
    in_ramps = ramp_mean_square(window[:3], ratio / (2 * np.pi * limits.bandwidth), strokes)
    whole = repeats * repeating_mean_square(ratio, HARMONICS) + ramps * in_ramps + (spec.duration - repeats - ramps)
    relaxed = (*RELAXED[:-1], f"for {spec.duration - repeats:g} s, mostly ramps, the motion need not repeat")
    return _of_squares(experiment, spec, amplitudes**2 * whole / spec.duration, relaxed, period)


def amplitudes_of(experiment: Experiment, limits: Limits) -> tuple[Float[np.ndarray, "6"], float]:
    """Return the legs' largest accelerations [m/s²], and the largest ratio of a speed to what the band's edge needs."""
    each = zip(limits.acceleration, limits.speed, _strokes(experiment, limits), strict=True)
    amplitudes = np.array([largest_amplitude(*one, limits.bandwidth) for one in each])
    return amplitudes, float((2 * np.pi * limits.bandwidth * limits.speed / amplitudes).max())


def _strokes(experiment: Experiment, limits: Limits) -> Float[np.ndarray, "6"]:
    """How far each leg may go from its length at home, at most [m]."""
    home = np.asarray(lengths(experiment.platform, experiment.platform.home_pose))
    return np.abs(limits.length - home[:, None]).max(axis=1)


def _any(ratio: float, bandwidth: float) -> float:
    return largest_mean_square(1.0, ratio / (2 * np.pi * bandwidth), bandwidth)


def _of_squares(
    experiment: Experiment,
    spec: TrajectorySpec,
    squares: Float[np.ndarray, "6"],
    relaxed: tuple[str, ...],
    period: float,
) -> DesignBound | None:
    noise = moment_noise(experiment, spec)
    if np.linalg.eigvalsh(noise)[0] <= 0 or not np.isfinite(squares).all():
        return None
    platform = experiment.platform
    to_alpha = np.linalg.inv(np.asarray(jacobian(platform, platform.home_pose)))[3:]
    samples = spec.rate * spec.duration
    moments, products = (
        least(average(samples, noise, part), np.eye(6), squares, to_alpha).value / 1e3 for part in (MOMENTS, PRODUCTS)
    )
    return DesignBound(moments, products, relaxed, period)


def moment_noise(experiment: Experiment, spec: TrajectorySpec) -> Float[np.ndarray, "3 3"]:
    """Return the covariance of the white noise of ``M - r × F`` at one sample [N²·m²]."""
    about = jnp.hstack([-cross_matrix(jnp.asarray(experiment.stated_r_cg)), jnp.eye(3)])
    return np.asarray(about @ Prediction.of(experiment, spec).wrench @ about.T)


def average(samples: float, noise: Float[np.ndarray, "3 3"], components: Sequence[int]) -> Uncertainty:
    """Return the average 3σ [g·m²] of components as a function of the second moment of alpha [rad²/s⁴].

    Args:
        samples: of the run.
        noise: covariance of the moment about the centre of gravity at one sample [N²·m²].
        components: which of the packed tensor's.
    """
    of_moment = covariance_of(samples, noise)
    return lambda moment: 3e3 * jnp.sqrt(jnp.diagonal(of_moment(moment))[jnp.array(components)]).mean()


def covariance_of(samples: float, noise: Float[np.ndarray, "3 3"]) -> Callable[[Array], Array]:
    """Return the tensor's covariance [(kg·m²)²] as a function of the second moment of alpha [rad²/s⁴].

    Args:
        samples: of the run.
        noise: covariance of the moment about the centre of gravity at one sample [N²·m²].
    """
    rows = np.stack([np.asarray(omega_r(jnp.zeros(3), jnp.eye(3)[axis])) for axis in range(3)])
    each = jnp.asarray(samples * np.einsum("aij,ik,bkl->abjl", rows, np.linalg.inv(noise), rows))
    return lambda moment: jnp.linalg.inv(jnp.einsum("ab,abjl->jl", moment, each))
