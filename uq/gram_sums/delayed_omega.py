"""The angular velocity of an earlier instant as a polynomial of the delay: exact up to a remainder that is measured.

``ω(t - θ) - ω(t)`` is smooth in the delay θ. Its polynomial of sixth degree goes through the values at Chebyshev's
seven points between plus and minus the longest delay that matters, zero among them: at every sample its coefficients
are what derivatives of the motion would be in a Taylor series, with a smaller remainder.
"""

from collections.abc import Sequence
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from identify.motion.trajectory import Trajectory
from identify.signals.differentiate import derivative
from uq.sources.constant_errors import effect
from uq.sources.source import Source

DEGREE = 6
NEGLIGIBLE = 1e-6
"""Powers whose effect, in parts of the delay's largest, is no larger are left out."""
SIGMAS = 6.0
"""Standard deviations about the mean that the polynomial reaches: one draw in 5e8 is beyond."""


class DelayedOmega(NamedTuple):
    """What a delay adds to the angular velocity: ``Σ c_k (θ / reach)^k``, k = 1 … 6 at most."""

    coefficients: Float[Array, "degree 3 n"]
    """Of each power, at each sample [rad/s]."""
    reach: Float[Array, ""]
    """The longest delay that matters [s]."""
    remainder: float
    """The largest difference from the exact values, between the points, in parts of the largest effect."""

    def with_alphas(self, taps: Sequence[np.ndarray]) -> Float[np.ndarray, "degree signals 3 n"]:
        """Return the coefficients of omega, then of every differentiator's alpha: zero where it has none."""
        omega = np.asarray(self.coefficients)
        signals = np.zeros((len(omega), 1 + len(taps), *omega.shape[1:]))
        for of_power, coefficient in zip(signals, omega, strict=True):
            of_power[0] = coefficient
            for alpha, each in zip(of_power[1:], taps, strict=True):
                alpha[:, len(each) : -len(each)] = derivative(coefficient, each)
        return signals


def longest_delay(sources: Sequence[Source]) -> float:
    """Return the longest delay that matters [s]: all sources' means and six standard deviations together."""
    size = lambda source, draw: float(abs(effect(source, draw)))  # noqa: E731
    delays = [source for source in sources if source.perturbs == "gyro_delay"]
    return sum(size(s, s.mean) + SIGMAS * size(s, s.standard_deviation) for s in delays)


def delayed_omega(trajectory: Trajectory, t: Float[Array, " n"], reach: float) -> DelayedOmega:
    """Return the polynomial of a trajectory's angular velocity at instants ``t`` for delays up to ``reach`` [s]."""
    places = np.cos(np.pi * (np.arange(DEGREE + 1) + 0.5) / (DEGREE + 1))
    points = np.delete(places, DEGREE // 2)  # without zero, where nothing is added
    between = np.cos(np.pi * np.arange(DEGREE + 2) / (DEGREE + 1))
    powers = np.arange(1, DEGREE + 1)
    coefficients, off, largest = _fitted(
        trajectory, t, jax.device_put(reach), points, between, np.linalg.inv(points[:, None] ** powers)
    )
    sizes = np.abs(np.asarray(coefficients)).max(axis=(1, 2)) / max(float(largest), 1e-300)
    degree = max([1, *(1 + np.flatnonzero(sizes > NEGLIGIBLE))])
    remainder = float(off) / max(float(largest), 1e-300) + sizes[degree:].sum()
    return DelayedOmega(coefficients[:degree], jax.device_put(reach), float(remainder))


@jax.jit
def _fitted(
    trajectory: Trajectory, t: Array, reach: Array, points: Array, between: Array, inverse: Array
) -> tuple[Array, Array, Array]:
    now = jax.vmap(trajectory.omega, out_axes=1)(t)
    added = lambda part: jax.vmap(trajectory.omega, out_axes=1)(t - part * reach) - now  # noqa: E731
    coefficients = jnp.tensordot(inverse, jax.lax.map(added, points), 1)

    def compared(part):
        exact = added(part)
        return jnp.max(jnp.abs(exact - displacement(coefficients, part))), jnp.max(jnp.abs(exact))

    off, largest = jax.lax.map(compared, between)
    return coefficients, jnp.max(off), jnp.max(largest)


def displacement(coefficients: Float[Array, "degree *signals n"], part: Float[Array, ""]) -> Float[Array, "*signals n"]:
    """Return what a delay adds to the angular velocity [rad/s], or to what is linear in it.

    Args:
        coefficients: of each power.
        part: the delay in parts of the longest.
    """
    total = jnp.zeros_like(coefficients[0])
    for coefficient in coefficients[::-1]:
        total = (total + coefficient) * part
    return total
