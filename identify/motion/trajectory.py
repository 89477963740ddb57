"""Trajectories: angular velocity as a closed form of time, its derivative, the attitude, the platform's translation.

A trajectory is a pure function ``omega(t)`` of one instant; ``alpha`` is its exact derivative by autodiff. Every one
starts and ends at rest with all derivatives (and so do the seams between segments).
"""

from abc import abstractmethod
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from identify.rigid_body.dynamics import acceleration_at
from identify.rigid_body.rotation import exponential, rate_of_turn

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


class Trajectory(eqx.Module):
    """A rotation of the body in time."""

    duration: eqx.AbstractVar[Scalar]

    @abstractmethod
    def omega(self, t: Float[Array, ""]) -> Float[Array, "3"]:
        """Return the angular velocity in B at time ``t`` [s], in rad/s."""

    def alpha(self, t: Float[Array, ""]) -> Float[Array, "3"]:
        """Return the angular acceleration in B at time ``t`` [s], in rad/s²: the exact derivative of ``omega``."""
        return jax.jvp(self.omega, (t,), (jnp.ones_like(t),))[1]

    def displacement(self, t: Float[Array, ""]) -> Float[Array, "3"]:
        """Return how far the point that carries the rotation has moved by time ``t`` [s], in A [m]: not at all here."""
        return jnp.zeros(3, jnp.asarray(t).dtype)


class Sphere(Trajectory):
    """The source's T1 and T2: omega and alpha trace spheres, along a spiral that precesses about a pole.

    ``alpha0 = A (sin Ωt cos εt, cos Ωt, sin Ωt sin εt)`` with ``Ω = A / W`` and ``ε = 2π precessions / duration``
    (written for the pole b2); ``omega`` is its integral without the mean, times the window.
    """

    angular_velocity: Scalar
    """Radius W of the sphere of angular velocity [rad/s]."""
    angular_acceleration: Scalar
    """Radius A of the sphere of angular acceleration [rad/s²]."""
    duration: Scalar
    """Duration T [s]."""
    ramp: Scalar
    """Time to start and to stop [s]."""
    precessions: Scalar
    """Turns of the spiral about its pole."""
    pole: int = eqx.field(static=True)
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


class Harmonic(Trajectory):
    """The source's T3 and T4: simple harmonic motion about b1, then b2, then b3, a third of the duration each."""

    angular_velocity: Scalar
    """Amplitude W [rad/s]."""
    angular_acceleration: Scalar
    """Amplitude A [rad/s²]; the motion's angular frequency is A / W."""
    duration: Scalar
    """Duration T of the three segments together [s]."""
    ramp: Scalar
    """Time to start and to stop each segment [s]."""

    def omega(self, t: Float[Array, ""]) -> Float[Array, "3"]:
        """Return the angular velocity in B at ``t``."""
        segment = self.duration / 3
        number = jnp.clip(jnp.floor(t / segment), 0, 2)
        local = t - number * segment
        swing = jnp.sin(self.angular_acceleration / self.angular_velocity * local)
        turning = self.angular_velocity * swing * window(local, segment, self.ramp)
        return jnp.where(jnp.arange(3.0) == number, turning, 0.0)


class Multisine(Trajectory):
    """A multi-frequency motion, rotation and translation: sums of sines and cosines, each times its stage's window.

    Its rotation vector is ``φ(t) = Σ_k w_k(t) (c_k cos 2πf_k t + s_k sin 2πf_k t)``, the attitude ``R_AB = exp(φ)``;
    the displacement of the platform's centre has the same form. Sines that start together are a stage, which ends at
    rest, at home, when the next one starts.
    """

    frequency: Float[Array | np.ndarray, " k"]
    """Frequencies f_k [Hz]."""
    cosine: Float[Array | np.ndarray, "6 k"]
    """Amplitudes c_k: displacement [m] along the axes of A, then rotation vector [rad]."""
    sine: Float[Array | np.ndarray, "6 k"]
    """Amplitudes s_k, alike."""
    duration: Scalar
    """Duration [s]."""
    ramp: Scalar
    """Time to start and to stop each stage [s]."""
    start: Float[Array | np.ndarray, " k"] | None = None
    """When the stage of each sine starts [s]; None: all at 0, one stage."""

    def coordinates(self, t: Float[Array, ""]) -> Float[Array, "6"]:
        """Return displacement [m] and rotation vector [rad] at ``t``."""
        angle = 2 * jnp.pi * jnp.asarray(self.frequency) * t
        if self.start is None:
            shape = jnp.asarray(self.cosine) @ jnp.cos(angle) + jnp.asarray(self.sine) @ jnp.sin(angle)
            return self.window(t, self.duration) * shape
        own = jax.vmap(lambda start, end: self.window(t - start, end - start))(self.start, self.end)
        return jnp.asarray(self.cosine) @ (own * jnp.cos(angle)) + jnp.asarray(self.sine) @ (own * jnp.sin(angle))

    def window(self, t: Scalar, duration: Scalar) -> Float[Array, ""]:
        """Return the window of a stage at ``t`` from its start, which starts and stops it within a ramp."""
        return swell(t / self.ramp) * swell((duration - t) / self.ramp)

    @property
    def end(self) -> Float[Array, " k"]:
        """When the stage of each sine ends [s]: with the next one's start, or with the motion."""
        start = jnp.zeros(len(self.frequency)) if self.start is None else jnp.asarray(self.start)
        next_start = jnp.where(start[None] > start[:, None], start[None], jnp.inf).min(axis=1)
        return jnp.minimum(next_start, self.duration)

    @property
    def stages(self) -> int:
        """How many stages there are."""
        return 1 if self.start is None else len(np.unique(np.asarray(self.start)))

    @property
    def period(self) -> float:
        """Time within which each stage repeats [s]; infinite where a frequency is no multiple of its lowest one."""
        frequency, longest = np.asarray(self.frequency), 0.0
        start = np.zeros(len(frequency)) if self.start is None else np.asarray(self.start)
        for own in (frequency[start == one] for one in np.unique(start)):
            orders = own / own.min()
            whole = np.abs(orders - np.round(orders)).max() < 1e-9
            longest = max(longest, 1 / own.min() if whole else np.inf)
        return longest

    def lasting(self, duration: float) -> "Multisine":
        """Return the motion of another duration [s], its ramps as they are, each stage longer or shorter alike."""
        start = None if self.start is None else duration / np.asarray(self.duration) * np.asarray(self.start)
        if start is not None and np.isfinite(self.period):  # ramps then meet the same phases
            start = np.round(start / self.period) * self.period
        return Multisine(self.frequency, self.cosine, self.sine, np.array(float(duration)), self.ramp, start)

    @property
    def shortest(self) -> float:
        """How short the motion may be made before one of its stages is nothing but two ramps [s]."""
        starts = np.unique(np.zeros(1) if self.start is None else np.asarray(self.start))
        return 2 * float(self.ramp * self.duration / np.diff([*starts, float(self.duration)]).min())

    def displacement(self, t: Float[Array, ""]) -> Float[Array, "3"]:
        """Return the displacement of the platform's centre at ``t``, in A."""
        return self.coordinates(t)[:3]

    def omega(self, t: Float[Array, ""]) -> Float[Array, "3"]:
        """Return the angular velocity in B at ``t``."""
        turn, rate = jax.jvp(self.coordinates, (t,), (jnp.ones_like(t),))
        return rate_of_turn(turn[3:], rate[3:])


class Motion(NamedTuple):
    """A sampled motion of the body, component first: what a perfect rig would do."""

    t: Float[Array, " n"]
    """Time [s], uniform."""
    omega: Float[Array, "3 n"]
    """Angular velocity in B [rad/s]."""
    alpha: Float[Array, "3 n"]
    """Angular acceleration in B [rad/s²]."""
    rotation: Float[Array, "n 3 3"]
    """Attitude R_AB, taking components in B to components in A."""
    specific_force_cg: Float[Array, "3 n"]
    """``a_CG - R g`` in B [m/s²]."""


def attitude(
    trajectory: Trajectory, t: Float[Array, " n"], start: Float[Array, "3 3"] | None = None
) -> Float[Array, "n 3 3"]:
    """Integrate the angular velocity to attitudes R_AB at the instants ``t``, starting from ``start`` (level).

    Fourth-order Magnus steps on two Gauss points each (Iserles et al., doi:10.1017/S0962492900002154).
    """
    h = jnp.diff(t)
    middle, offset = (t[1:] + t[:-1]) / 2, np.sqrt(3) / 6
    w1, w2 = (jax.vmap(trajectory.omega)(middle + sign * offset * h) for sign in (-1, 1))
    turn = h[:, None] / 2 * (w1 + w2) + (np.sqrt(3) / 12 * h**2)[:, None] * jnp.cross(w1, w2)
    first = jnp.eye(3, dtype=t.dtype) if start is None else start
    return _running_product(jnp.concatenate([first[None], jax.vmap(exponential)(turn)]))


def _running_product(matrices: Float[Array, "n 3 3"]) -> Float[Array, "n 3 3"]:
    """Products of the first matrices, in rows of √n that are multiplied side by side: √n steps instead of n."""
    n = len(matrices)
    size = int(np.ceil(np.sqrt(n)))
    rows = jnp.concatenate([matrices, jnp.broadcast_to(jnp.eye(3, dtype=matrices.dtype), (size * size - n, 3, 3))])

    def advance(product, one):
        product = product @ one
        return product, product

    def along(first, steps):
        return jax.lax.scan(advance, first, steps)

    unit = jnp.eye(3, dtype=matrices.dtype)
    ends, within = along(jnp.broadcast_to(unit, (size, 3, 3)), rows.reshape(size, size, 3, 3).swapaxes(0, 1))
    _, before = along(unit, ends)
    before = jnp.concatenate([unit[None], before[:-1]])
    return (before[:, None] @ within.swapaxes(0, 1)).reshape(-1, 3, 3)[:n]


@eqx.filter_jit
def sample(
    trajectory: Trajectory,
    t: Float[Array, " n"],
    *,
    r_cg_from_still: Float[Array | np.ndarray, "3"],
    gravity: Scalar,
) -> Motion:
    """Sample a trajectory at uniform instants.

    Args:
        trajectory: the rotation.
        t: instants [s]; the first is level.
        r_cg_from_still: centre of gravity from the body-fixed point that keeps still, in B [m]: zero for T1 and T3,
            r_CG/OMB for T2 and T4, whose platform centre OMB keeps still.
        gravity: local gravity [m/s²], along -z of frame A.
    """
    omega = jax.vmap(trajectory.omega)(t)
    alpha = jax.vmap(trajectory.alpha)(t)
    rotation = attitude(trajectory, t)
    acceleration = jax.vmap(acceleration_at, in_axes=(None, 0, 0))(jnp.asarray(r_cg_from_still), omega, alpha)
    moving = jnp.einsum("nji,nj->ni", rotation, jax.vmap(lambda at: acceleration_of(trajectory, at))(t))
    specific_force = acceleration + moving + gravity * rotation[:, 2, :]  # -R g, with R the transpose of R_AB
    return Motion(t, omega.T, alpha.T, rotation, specific_force.T)


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


def platform_position(rotation: Float[Array, "3 3"], r_cg_from_omb: Float[Array, "3"]) -> Float[Array, "3"]:
    """Return the position of the platform's centre OMB from the still centre of gravity, in A [m].

    ``p_OMB - p_CG = -R_AB r_CG/OMB``: the closed form of (12) rotated into A and integrated twice.
    """
    return -rotation @ r_cg_from_omb
