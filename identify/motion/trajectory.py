"""Trajectories: angular velocity as a closed form of time, and the body's motion at instants of it.

A trajectory is a pure function ``omega(t)`` of one instant; ``alpha`` is its exact derivative by autodiff. Every one
starts and ends at rest with all derivatives (and so do the seams between segments).
"""

from abc import abstractmethod
from dataclasses import replace
from typing import TYPE_CHECKING, ClassVar, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from identify.exceptions import RunError
from identify.motion.attitude import attitude
from identify.pytree import Pytree, static_field
from identify.rigid_body.dynamics import acceleration_at

Scalar = Float[Array, ""] | Float[np.ndarray, ""] | float


def step(u: Scalar) -> Float[Array, ""]:
    """Return the smooth step from 0 (u ≤ 0) to 1 (u ≥ 1), ``1 / (1 + exp(1/u - 1/(1-u)))``, flat at both ends."""
    inside = (u > 0) & (u < 1)
    safe = jnp.where(inside, u, 0.5)
    exponent = jnp.clip(1 / (1 - safe) - 1 / safe, -80.0, 80.0)
    return jnp.where(inside, jax.nn.sigmoid(exponent), jnp.where(u >= 1, 1.0, 0.0))


def window(t: Scalar, duration: Scalar, ramp: Scalar) -> Float[Array, ""]:
    """Return the window ``s(t) s(D - t)`` that starts and stops a motion within ``ramp`` [s] at either end."""
    return step(t / ramp) * step((duration - t) / ramp)


def swell(u: Scalar) -> Float[Array, ""]:
    """Return another smooth step, ``sin(π/2 step(u))``: fast where it is small, slow where it is near one.

    An oscillation of angular frequency Ω times a window w asks for an acceleration of ``√(w² + (2w'/Ω)²)`` of its own,
    which for ``w = sin Ωt/2`` is one all the time.
    """
    return jnp.sin(jnp.pi / 2 * step(u))


class Trajectory(Pytree):
    """A rotation of the body in time."""

    if TYPE_CHECKING:  # a field, whose place among the others is the subclass's own

        @property
        def duration(self) -> Scalar:
            """Duration of the motion [s]."""

    @abstractmethod
    def omega(self, t: Float[Array, ""]) -> Float[Array, "3"]:
        """Return the angular velocity in B at time ``t`` [s], in rad/s."""

    def alpha(self, t: Float[Array, ""]) -> Float[Array, "3"]:
        """Return the angular acceleration in B at time ``t`` [s], in rad/s²: the exact derivative of ``omega``."""
        return jax.jvp(self.omega, (t,), (jnp.ones_like(t),))[1]

    def displacement(self, t: Float[Array, ""]) -> Float[Array, "3"]:
        """Return how far the point that carries the rotation has moved by time ``t`` [s], in A [m]: not at all here."""
        return jnp.zeros(3, jnp.asarray(t).dtype)

    def scaled(self, size: float, speed: float = 1.0) -> "Trajectory":
        """Return the motion with ``size`` times its angles and displacement, ``speed`` times as fast.

        Raises:
            RunError: it has no amplitude.
        """
        raise RunError(f"a {type(self).__name__.lower()} has no amplitude: rehearse it at a lower speed")

    @property
    def highest_frequency(self) -> float:
        """Highest frequency of the motion [Hz], apart from its ramps; RunError: it states none."""
        raise RunError(f"a {type(self).__name__.lower()} states no highest frequency: choose another trajectory")


class SourceTrajectory(Trajectory):
    """Trajectory of the paper: a rotation whose angular velocity and acceleration have stated amplitudes."""

    SEGMENTS: ClassVar[int] = 1
    """Number of motions from rest to rest."""
    angular_velocity: Scalar
    """Amplitude W of the angular velocity [rad/s]; of a sphere its radius."""
    angular_acceleration: Scalar
    """Amplitude A of the angular acceleration [rad/s²]; the motion's angular frequency is A / W."""
    duration: Scalar
    """Duration T of the motion [s], all segments together."""
    ramp: Scalar
    """Time to start and to stop each segment [s]."""

    def scaled(self, size: float, speed: float = 1.0) -> "SourceTrajectory":
        """Return the motion with ``size`` times its angles, ``speed`` times as fast, in the same time."""
        return replace(
            self,
            angular_velocity=np.array(size * speed * self.angular_velocity),
            angular_acceleration=np.array(size * speed**2 * self.angular_acceleration),
        )

    @property
    def highest_frequency(self) -> float:
        """Highest frequency of the motion [Hz], apart from its ramps."""
        return float(self.angular_acceleration / self.angular_velocity) / (2 * np.pi)

    def lasting(self, duration: float) -> "SourceTrajectory":
        """Return the motion of another duration [s], its ramps as they are."""
        return replace(self, duration=np.array(float(duration)))

    @property
    def shortest(self) -> float:
        """Shortest duration before a segment is nothing but two ramps [s]."""
        return 2 * self.SEGMENTS * float(self.ramp)


class Sphere(SourceTrajectory):
    """The paper's T1 and T2: omega and alpha trace spheres, along a spiral that precesses about a pole.

    ``alpha0 = A (sin Ωt cos εt, cos Ωt, sin Ωt sin εt)`` with ``Ω = A / W`` and ``ε = 2π precessions / duration``
    (written for the pole b2); ``omega`` is its integral without the mean, times the window.
    """

    precessions: Scalar
    """Turns of the spiral about its pole."""
    pole: int = static_field()
    """Body axis of the spiral's pole: 0, 1, 2."""

    def omega(self, t: Float[Array, ""]) -> Float[Array, "3"]:
        """Return the angular velocity in B at ``t``."""
        fast = self.angular_acceleration / self.angular_velocity
        slow = 2 * jnp.pi * self.precessions / self.duration
        plus, minus, T = fast + slow, fast - slow, self.duration

        def cos_term(rate):  # antiderivative of sin(rate t), without its mean over the run
            return -(jnp.cos(rate * t) - jnp.sin(rate * T) / (rate * T)) / rate

        def sin_term(rate):  # antiderivative of cos(rate t), without its mean over the run
            return (jnp.sin(rate * t) - (1 - jnp.cos(rate * T)) / (rate * T)) / rate

        sine = (cos_term(plus) + cos_term(minus)) / 2  # of sin Ωt cos εt
        cosine = sin_term(fast)  # of cos Ωt
        cross = (sin_term(minus) - sin_term(plus)) / 2  # of sin Ωt sin εt
        spiral = jnp.roll(jnp.stack([sine, cosine, cross]), self.pole - 1)
        return jnp.asarray(self.angular_acceleration * spiral * window(t, T, self.ramp))

    @property
    def highest_frequency(self) -> float:
        """Highest frequency of the motion [Hz]: that of the spiral and the precession's."""
        return super().highest_frequency + float(self.precessions / self.duration)

    def lasting(self, duration: float) -> "Sphere":
        """Return the motion of another duration [s], as fast in its precession."""
        turns = np.asarray(self.precessions) * duration / float(self.duration)
        return replace(self, duration=np.array(float(duration)), precessions=turns)


class Harmonic(SourceTrajectory):
    """The paper's T3 and T4: simple harmonic motion about b1, then b2, then b3, a third of the duration each."""

    SEGMENTS = 3

    def omega(self, t: Float[Array, ""]) -> Float[Array, "3"]:
        """Return the angular velocity in B at ``t``."""
        segment = self.duration / 3
        number = jnp.clip(jnp.floor(t / segment), 0, 2)
        local = t - number * segment
        swing = jnp.sin(self.angular_acceleration / self.angular_velocity * local)
        turning = self.angular_velocity * swing * window(local, segment, self.ramp)
        return jnp.where(jnp.arange(3.0) == number, turning, 0.0)


class Motion(NamedTuple):
    """A sampled motion of the body, component first: what a perfect rig would do."""

    t: Float[Array, " n"]
    """Instants of the samples [s], uniform."""
    omega: Float[Array, "3 n"]
    """Angular velocity in B [rad/s]."""
    alpha: Float[Array, "3 n"]
    """Angular acceleration in B [rad/s²]."""
    rotation: Float[Array, "n 3 3"]
    """Attitude R_AB, taking components in B to components in A."""
    specific_force_cg: Float[Array, "3 n"]
    """Specific force ``a_CG - R g`` of the centre of gravity, in B [m/s²]."""


@jax.jit
def sample(
    trajectory: Trajectory,
    t: Float[Array, " n"],
    *,
    r_cg_from_still: Float[Array | np.ndarray, "3"],
    gravity: Scalar,
    start: Float[Array, "3 3"] | None = None,
) -> Motion:
    """Sample a trajectory at uniform instants.

    Args:
        trajectory: the rotation.
        t: instants [s].
        r_cg_from_still: centre of gravity from the body-fixed point that keeps still, in B [m]: zero for T1 and T3,
            r_CG/OMB for T2 and T4, whose platform centre OMB keeps still.
        gravity: local gravity [m/s²], along -z of frame A.
        start: attitude R_AB at the first instant; None: level.
    """
    omega = jax.vmap(trajectory.omega)(t)
    alpha = jax.vmap(trajectory.alpha)(t)
    rotation = attitude(trajectory.omega, t, start)
    acceleration = jax.vmap(acceleration_at, in_axes=(None, 0, 0))(jnp.asarray(r_cg_from_still), omega, alpha)
    moving = jnp.einsum("nji,nj->ni", rotation, jax.vmap(lambda at: acceleration_of(trajectory, at))(t))
    specific_force = acceleration + moving + gravity * rotation[:, 2, :]  # -R g, with R the transpose of R_AB
    return Motion(t=t, omega=omega.T, alpha=alpha.T, rotation=rotation, specific_force_cg=specific_force.T)


_accelerations_at = jax.jit(jax.vmap(acceleration_at, in_axes=(None, 1, 1), out_axes=1))


def further_from_still(motion: Motion, offset: Float[Array | np.ndarray, "3"]) -> Motion:
    """Return the same rotation with the centre of gravity further from the point that keeps still, by this in B [m]."""
    more = _accelerations_at(jnp.asarray(offset), motion.omega, motion.alpha)
    return motion._replace(specific_force_cg=motion.specific_force_cg + more)


def acceleration_of(trajectory: Trajectory, t: Float[Array, ""]) -> Float[Array, "3"]:
    """Return the acceleration of the point that carries the rotation, in A [m/s²]."""

    def velocity(at):
        return jax.jvp(trajectory.displacement, (at,), (jnp.ones_like(at),))[1]

    return jax.jvp(velocity, (t,), (jnp.ones_like(t),))[1]
