"""What no motion of a platform can beat: a lower bound of the predicted uncertainty under its limits.

With the legs' Jacobian of home and without products of omega, the load cell's white noise alone gives every unbiased
linear estimate at least the covariance ``(n mean(Ωᵀ S⁻¹ Ω))⁻¹`` (Gauss and Markov), linear in the second moment of
alpha inside. :mod:`identify.information_bound` bounds it over all second moments that the legs can have.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float
from scipy.optimize import linprog

from identify.band_limited import largest_amplitude, largest_mean_square
from identify.inertia import MOMENTS, PRODUCTS, Body
from identify.information_bound import least
from identify.platform import Pose, Twist, forces, jacobian, lengths
from identify.platform_motion import Limits
from identify.regressor import cross_matrix, omega_r
from identify.trajectory import exponential
from uq.experiment import Experiment, TrajectorySpec
from uq.prediction import Prediction

RELAXED = (
    "the legs' Jacobian is that of home, and products of omega tell nothing",
    "of all sources only the white noise of load cell force and moment counts, weighted as best it can be",
    "each leg's acceleration fluctuates as much as its band, bound and speed allow, in any relation to the others'",
    "ramps take no time",
)
"""What the bound does not ask of a motion."""
DIRECTIONS = 120
"""Combinations of legs whose mean square is bounded beside each leg's own."""


@dataclass(frozen=True)
class DesignBound:
    """Least average 3σ that the limits allow, and what the bound leaves out."""

    moments: float
    """Of the three moments [kg·m²]."""
    products: float
    """Of the three products [kg·m²]."""
    relaxes: tuple[str, ...]
    """What the bound does not ask of a motion."""


class AtHome(NamedTuple):
    """The legs in first order about home."""

    to_pose: Float[np.ndarray, "6 6"]
    """From the legs' accelerations to those of displacement and rotation vector."""
    force: Float[np.ndarray, "6 6"]
    """From the legs' accelerations [m/s²] to their forces [N]."""
    rest: Float[np.ndarray, "6"]
    """Forces at rest [N]."""
    tilt: Float[np.ndarray, "6 6"]
    """From the legs' lengths to their forces at rest [N/m]."""


def design_bound(experiment: Experiment, spec: TrajectorySpec, limits: Limits) -> DesignBound | None:
    """Return what no periodic motion of any frequencies up to the bandwidth can beat under these limits.

    Args:
        experiment: body, platform and sources.
        spec: how long and how often is sampled.
        limits: in figures.

    Returns:
        The bound; None where stroke and speed of a leg are free, or the load cell has no white noise.
    """
    prediction = Prediction.of(experiment, spec)
    about = jnp.hstack([-cross_matrix(experiment.body.r_cg_from_q), jnp.eye(3)])
    noise = np.asarray(about @ prediction.wrench @ about.T)
    if np.linalg.eigvalsh(noise)[0] <= 0:
        return None
    home = at_home(experiment)
    legs = leg_amplitudes(experiment, limits)
    if not np.isfinite(legs).all():
        return None
    rows, most = constraints(home, limits, legs, *ranges(experiment, home, limits, legs))
    samples = spec.rate * spec.duration
    values = [
        least(average(samples, noise, part), rows, most, home.to_pose[3:]).value / 1e3 for part in (MOMENTS, PRODUCTS)
    ]
    return DesignBound(*values, RELAXED)


def at_home(experiment: Experiment) -> AtHome:
    """Return the platform with its body in first order about home."""
    platform, own = experiment.platform, experiment.body
    body = Body(own.mass, jnp.asarray(experiment.r_cg_from_omb), own.inertia)
    home, zero, gravity = platform.home_pose, jnp.zeros(3), jnp.asarray(experiment.gravity)

    def force(step: Array, acceleration: Array) -> Array:
        pose = Pose(home.position + step[:3], home.rotation @ exponential(step[3:]))
        return forces(platform, body, pose, Twist(zero, zero, acceleration[:3], acceleration[3:]), gravity)

    six = jnp.zeros(6)
    by_pose, by_acceleration = jax.jacobian(force, argnums=(0, 1))(six, six)
    to_pose = np.linalg.inv(np.asarray(jacobian(platform, home)))
    return AtHome(
        to_pose, np.asarray(by_acceleration) @ to_pose, np.asarray(force(six, six)), np.asarray(by_pose) @ to_pose
    )


def strokes(experiment: Experiment, limits: Limits) -> Float[np.ndarray, "6"]:
    """Return how far each leg may depart from its length at home [m]."""
    home = np.asarray(lengths(experiment.platform, experiment.platform.home_pose))
    return np.abs(limits.length - home[:, None]).max(axis=1)


def leg_amplitudes(experiment: Experiment, limits: Limits) -> Float[np.ndarray, "6"]:
    """Return the largest acceleration of each leg [m/s²] that its limits leave within the band."""
    each = zip(limits.acceleration, limits.speed, strokes(experiment, limits), strict=True)
    return np.array([largest_amplitude(a, v, s, limits.bandwidth) for a, v, s in each])


def ranges(
    experiment: Experiment, home: AtHome, limits: Limits, legs: Float[np.ndarray, "6"]
) -> tuple[Float[np.ndarray, "c 6"], Float[np.ndarray, " c"]]:
    """Return the legs' accelerations that are allowed, ``A l ≤ b``: by their own limits, and by those of force.

    A force at rest that the tilt within the stroke changes is allowed for.
    """
    rows, ends = [np.eye(6), -np.eye(6)], [legs, legs]
    limited = np.isfinite(limits.force)
    if limited.any():
        spare = np.abs(home.tilt) @ strokes(experiment, limits)
        spare = np.where(np.isfinite(spare), spare, np.inf)
        for sign in (1, -1):
            rows.append(sign * home.force[limited])
            ends.append((limits.force - sign * home.rest + spare)[limited])
    kept = np.isfinite(np.concatenate(ends))
    return np.vstack(rows)[kept], np.concatenate(ends)[kept]


def constraints(
    home: AtHome, limits: Limits, legs: Float[np.ndarray, "6"], within: np.ndarray, ends: np.ndarray
) -> tuple[Float[np.ndarray, "m 6"], Float[np.ndarray, " m"]]:
    """Return combinations of the legs' accelerations and the largest mean square of each.

    What keeps between ``-lo`` and ``hi`` and has no mean has a mean square of at most ``lo hi``; what keeps within
    ``m``, with an integral within ``v``, of at most that of :func:`identify.band_limited.largest_mean_square`.
    """
    generator = np.random.default_rng(0)
    turned = generator.normal(size=(DIRECTIONS, 3)) @ home.to_pose[3:]
    rows = np.vstack([np.eye(6), home.force, home.to_pose, turned, generator.normal(size=(DIRECTIONS, 6))])
    most = []
    for row in rows:
        high, low = (_furthest(sign * row, within, ends) for sign in (1, -1))
        amplitude = max(high, low)
        integral = float(np.abs(row) @ limits.speed)
        most.append(min(high * low, largest_mean_square(amplitude, integral, limits.bandwidth)))
    return rows, np.array(most)


def _furthest(row: np.ndarray, within: np.ndarray, ends: np.ndarray) -> float:
    """Largest value of a combination of the legs' accelerations that are allowed."""
    return -float(linprog(-row, A_ub=within, b_ub=ends, bounds=[(None, None)] * 6).fun)


def average(samples: float, noise: Float[np.ndarray, "3 3"], components: Sequence[int]):
    """Return the average 3σ [g·m²] of components as a function of the second moment of alpha [rad²/s⁴].

    Args:
        samples: of the run.
        noise: covariance of the moment about the centre of gravity at one sample [N²·m²].
        components: which of the packed tensor's.
    """
    rows = np.stack([np.asarray(omega_r(jnp.zeros(3), jnp.eye(3)[axis])) for axis in range(3)])
    each = jnp.asarray(samples * np.einsum("aij,ik,bkl->abjl", rows, np.linalg.inv(noise), rows))

    def function(moment: Array) -> Array:
        variance = jnp.diagonal(jnp.linalg.inv(jnp.einsum("ab,abjl->jl", moment, each)))
        return 3e3 * jnp.sqrt(variance[jnp.array(components)]).mean()

    return function
