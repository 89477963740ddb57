"""A periodic motion of the platform, from amplitudes: pose and three derivatives in closed form over one period.

An optimiser's unknowns are the amplitudes of the legs' accelerations as they would be if the legs' Jacobian stayed
that of home, each in units of what its leg may do: so every unknown has the same weight, whatever the platform.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from identify.motion.leg_limits import Limits, PlatformMotion
from identify.motion.stewart_platform import Pose, StewartPlatform, Twist, jacobian
from identify.motion.trajectory import Motion
from identify.pytree import Pytree
from identify.rigid_body.dynamics import acceleration_at
from identify.rigid_body.rotation import exponential, rate_of_turn

TYPICAL = 2 * np.pi
"""Angular frequency [rad/s] at which a limited speed or stroke is turned into an acceleration where none is limited."""


class Periodic(Pytree):
    """Harmonics of one period, sampled on a uniform grid."""

    frequency: Float[np.ndarray, " k"]
    """Frequencies of the harmonics [Hz]."""
    t: Float[np.ndarray, " n"]
    """Instants of one period [s]."""
    to_pose: Float[np.ndarray, "6 6"]
    """Matrix from the unknowns of six legs to accelerations of displacement [m/s²] and rotation vector [rad/s²]."""

    @classmethod
    def of(cls, platform: StewartPlatform, limits: Limits, *, period: float, band: float, rate: float) -> "Periodic":
        """Prepare the harmonics up to ``band`` [Hz] of a period [s], on a grid of about ``rate`` [Hz]."""
        harmonics = np.arange(1, np.floor(period * band + 1e-9) + 1) / period
        n = round(period * rate)
        at_home = np.asarray(jacobian(platform, platform.home_pose))
        return cls(harmonics, np.arange(n) * period / n, np.linalg.solve(at_home, np.diag(accelerations(limits))))

    @property
    def period(self) -> float:
        """Duration of one period [s]."""
        return float(1 / self.frequency[0])

    @property
    def unknowns(self) -> int:
        """Number of unknowns that describe a motion."""
        return 12 * len(self.frequency)

    def amplitudes(self, unknowns: Float[Array, " u"]) -> Float[Array, "2 6 k"]:
        """Return the amplitudes of cosines and sines: displacement [m], then rotation vector [rad]."""
        square = (2 * np.pi * self.frequency) ** 2
        return -jnp.einsum("ij,cjk->cik", jnp.asarray(self.to_pose), unknowns.reshape(2, 6, -1)) / square[None, None]

    def unknowns_of(self, amplitudes: Float[np.ndarray, "2 6 k"]) -> Float[np.ndarray, " u"]:
        """Return the unknowns that give these amplitudes."""
        square = (2 * np.pi * self.frequency) ** 2
        return np.einsum("ij,cjk->cik", np.linalg.inv(self.to_pose), -square * amplitudes).ravel()

    def coordinates(self, unknowns: Float[Array, " u"], t: Float[np.ndarray, " n"]) -> Float[Array, "4 n 6"]:
        """Return displacement and rotation vector at instants [s], with their three derivatives."""
        cosine, sine = self.amplitudes(unknowns)
        speed = 2 * np.pi * self.frequency
        angle = speed * t[:, None]
        cos, sin = np.cos(angle), np.sin(angle)

        def of_order(order: int) -> Array:  # each derivative turns (cos, sin) by a quarter
            turned = [(cos, sin), (-sin, cos), (-cos, -sin), (sin, -cos)][order]
            factor = speed[None] ** order
            return (turned[0] * factor) @ cosine.T + (turned[1] * factor) @ sine.T

        return jnp.stack([of_order(order) for order in range(4)])


def accelerations(limits: Limits) -> Float[np.ndarray, "6"]:
    """Return an acceleration for each leg [m/s²] that its limits allow, roughly: the unit of the unknowns."""
    stroke = (limits.length[:, 1] - limits.length[:, 0]) / 2
    allowed = np.minimum(limits.acceleration, np.minimum(TYPICAL * limits.speed, TYPICAL**2 * stroke))
    return np.where(np.isfinite(allowed), allowed, 1.0)


class Moved(NamedTuple):
    """Motion of the platform, and of the body with the derivative of alpha."""

    platform: PlatformMotion
    body: Motion
    jerk: Float[Array, "3 n"]
    """Derivative of alpha in B [rad/s³]."""


def moved(
    platform: StewartPlatform,
    t: Float[Array, " n"],
    coordinates: Float[Array, "4 n 6"],
    r_cg_from_omb: Float[Array, "3"],
    gravity: Float[Array, ""],
) -> Moved:
    """Return what platform and body do.

    Args:
        platform: for its home.
        t: instants [s].
        coordinates: displacement from home [m] and rotation vector [rad] there, with their three derivatives.
        r_cg_from_omb: centre of gravity from the platform's centre, in B [m].
        gravity: local gravity [m/s²].
    """
    at, speed, acceleration, jolt = coordinates
    omega, alpha, jerk = jax.vmap(turning)(at[:, 3:], speed[:, 3:], acceleration[:, 3:], jolt[:, 3:])
    rotation = jax.vmap(exponential)(at[:, 3:])
    position = jnp.asarray(platform.home)[None] + at[:, :3]
    twist = Twist(speed[:, :3], omega, acceleration[:, :3], alpha)
    turning_acceleration = jax.vmap(acceleration_at, in_axes=(None, 0, 0))(r_cg_from_omb, omega, alpha)
    specific = (
        turning_acceleration + jnp.einsum("nji,nj->ni", rotation, acceleration[:, :3]) + gravity * rotation[:, 2, :]
    )
    body = Motion(t=t, omega=omega.T, alpha=alpha.T, rotation=rotation, specific_force_cg=specific.T)
    return Moved(PlatformMotion(t, Pose(position, rotation), twist), body, jerk.T)


def turning(
    turn: Float[Array, "3"], rate: Float[Array, "3"], second: Float[Array, "3"], third: Float[Array, "3"]
) -> tuple[Float[Array, "3"], Float[Array, "3"], Float[Array, "3"]]:
    """Return angular velocity, acceleration and jerk in B of ``exp(turn)`` from the rotation vector's derivatives."""

    def once(turn, rate, second):
        return jax.jvp(rate_of_turn, (turn, rate), (rate, second))

    (omega, alpha), (_, jerk) = jax.jvp(once, (turn, rate, second), (rate, second, third))
    return omega, alpha, jerk
