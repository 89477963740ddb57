"""A Stewart–Gough platform: where its legs are, how fast they move, what force they need. One instant in, one out.

A pose is the position of the platform's centre OMB and its attitude in the base's frame A (z up). Everything is a pure
function of pose, velocity and acceleration, so ``vmap`` runs a trajectory and ``jax.grad`` goes through it.
Kinematics: Merlet, Parallel Robots (2006), doi:10.1007/1-4020-4133-0, chapters 3 to 5. Forces: d'Alembert's principle
with the legs' own masses.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from identify.pytree import Pytree
from identify.rigid_body.dynamics import acceleration_at, wrench
from identify.rigid_body.inertia import Body
from identify.rigid_body.rotation import exponential


class Pose(NamedTuple):
    """Position and attitude of the platform."""

    position: Float[Array, "3"]
    """Position of OMB, in A [m]."""
    rotation: Float[Array, "3 3"]
    """R_AB, taking components in the platform's frame B to components in A."""


class Twist(NamedTuple):
    """Velocity and acceleration of a platform at one instant."""

    velocity: Float[Array, "3"]
    """Velocity of OMB, in A [m/s]."""
    omega: Float[Array, "3"]
    """Angular velocity, in B [rad/s]."""
    acceleration: Float[Array, "3"]
    """Acceleration of OMB, in A [m/s²]."""
    alpha: Float[Array, "3"]
    """Angular acceleration, in B [rad/s²]."""


class Legs(NamedTuple):
    """Six legs at one instant."""

    length: Float[Array, "6"]
    """Distance between the centres of each leg's joints [m]."""
    speed: Float[Array, "6"]
    """Rate of change of each leg's length [m/s]."""
    acceleration: Float[Array, "6"]
    """Second derivative of each leg's length [m/s²]."""


class Rod(NamedTuple):
    """One half of a leg, slender: the cylinder at the base or the rod at the platform."""

    mass: Float[Array, ""]
    """Mass of the rod [kg]."""
    distance: Float[Array, ""]
    """Distance of the rod's centre of mass from its joint, along the leg [m]."""
    inertia: Float[Array, ""]
    """Moment of inertia about the rod's centre of mass, across the leg [kg·m²]."""


class StewartPlatform(Pytree):
    """Geometry and masses of a platform with six legs."""

    base: Float[Array | np.ndarray, "6 3"]
    """Centres of the joints at the base, in A [m]."""
    joints: Float[Array | np.ndarray, "6 3"]
    """Centres of the joints at the platform, from OMB, in B [m]."""
    home: Float[Array | np.ndarray, "3"]
    """Position of OMB at home, in A [m]; the attitude at home is that of A."""
    plate: Body
    """Mass, centre of gravity from OMB and tensor of what moves beside the body: plate and load cell."""
    cylinder: Rod
    """Mass properties of each leg's part at the base."""
    rod: Rod
    """Mass properties of each leg's part at the platform."""

    @property
    def home_pose(self) -> Pose:
        """The pose at home."""
        home = jnp.asarray(self.home)
        return Pose(home, jnp.eye(3, dtype=home.dtype))


def vectors(platform: StewartPlatform, pose: Pose) -> Float[Array, "6 3"]:
    """Return the vectors from the base's joints to the platform's, in A [m]."""
    return pose.position[None] + platform.joints @ pose.rotation.T - platform.base


def lengths(platform: StewartPlatform, pose: Pose) -> Float[Array, "6"]:
    """Return the legs' lengths [m]: the inverse kinematics."""
    return jnp.linalg.norm(vectors(platform, pose), axis=1)


def jacobian(platform: StewartPlatform, pose: Pose) -> Float[Array, "6 6"]:
    """Return the matrix that takes (velocity of OMB in A, omega in B) to the legs' speeds."""
    along = vectors(platform, pose)
    along = along / jnp.linalg.norm(along, axis=1, keepdims=True)
    return jnp.hstack([along, jnp.cross(platform.joints, along @ pose.rotation)])


def moved(pose: Pose, twist: Twist, time: Float[Array, ""]) -> Pose:
    """Return the pose after a short ``time`` [s]: exact in its first two derivatives at zero."""
    turn = twist.omega * time + twist.alpha * time**2 / 2
    shift = twist.velocity * time + twist.acceleration * time**2 / 2
    return Pose(pose.position + shift, pose.rotation @ exponential(turn))


def second_order(function, pose: Pose, twist: Twist):
    """Return a function of the pose and its first two time derivatives along a motion."""
    zero, unit = jnp.zeros_like(pose.position[0]), jnp.ones_like(pose.position[0])

    def rate(time):
        return jax.jvp(lambda s: function(moved(pose, twist, s)), (time,), (unit,))

    (value, speed), (_, acceleration) = jax.jvp(rate, (zero,), (unit,))
    return value, speed, acceleration


def legs(platform: StewartPlatform, pose: Pose, twist: Twist) -> Legs:
    """Return the legs' lengths, speeds and accelerations."""
    return Legs(*second_order(lambda at: lengths(platform, at), pose, twist))


def joint_angles(platform: StewartPlatform, pose: Pose) -> tuple[Float[Array, "6"], Float[Array, "6"]]:
    """Return how far each leg leans from its direction at home [rad]: seen from the base, and from the platform."""
    at_home, now = vectors(platform, platform.home_pose), vectors(platform, pose)
    return _between(at_home, now), _between(at_home, now @ pose.rotation)


def _between(first: Float[Array, "6 3"], second: Float[Array, "6 3"]) -> Float[Array, "6"]:
    """Angles between vectors, exact also where they are small."""
    across = jnp.cross(first, second)
    square = (across**2).sum(axis=1)
    safe = jnp.where(square > 0, square, 1.0)
    return jnp.arctan2(jnp.where(square > 0, jnp.sqrt(safe), 0.0), (first * second).sum(axis=1))


def forces(
    platform: StewartPlatform, body: Body, pose: Pose, twist: Twist, gravity: Float[Array, ""]
) -> Float[Array, "6"]:
    """Return the force along each leg that the motion takes [N], positive where the leg pushes.

    The virtual work of the legs' forces is that of all masses times their accelerations less gravity: body, plate, and
    the two halves of each leg, whose turning about the leg's own axis is left out.

    Args:
        platform: geometry and moving masses.
        body: the body on it; its centre of gravity from OMB, in B.
        pose: where the platform is.
        twist: how it moves.
        gravity: local gravity [m/s²], along −z of A.
    """
    up = gravity * jnp.array([0.0, 0.0, 1.0])
    carried = sum(_load(rigid_body, pose, twist, up) for rigid_body in (platform.plate, body))
    halves = _of_legs(platform, pose, twist, up)
    return jnp.linalg.solve(jacobian(platform, pose).T, carried + halves)


def _load(body: Body, pose: Pose, twist: Twist, up: Float[Array, "3"]) -> Float[Array, "6"]:
    """Generalised force (in A; about OMB, in B) that a rigid body on the platform takes."""
    at_omb = pose.rotation.T @ (twist.acceleration + up)
    turning = acceleration_at(body.r_cg_from_q, twist.omega, twist.alpha)
    force, moment = wrench(body, twist.omega, twist.alpha, at_omb + turning)
    return jnp.concatenate([pose.rotation @ force, moment])


def _of_legs(platform: StewartPlatform, pose: Pose, twist: Twist, up: Float[Array, "3"]) -> Float[Array, "6"]:
    """Generalised force that the legs' own masses take: two centres of mass and two directions each."""

    def places(at: Pose):
        along = vectors(platform, at)
        direction = along / jnp.linalg.norm(along, axis=1, keepdims=True)
        low = platform.base + platform.cylinder.distance * direction
        return low, platform.base + along - platform.rod.distance * direction, direction

    _, _, accelerations = second_order(places, pose, twist)
    low, high, turning = accelerations
    needed = (
        platform.cylinder.mass * (low + up[None]),
        platform.rod.mass * (high + up[None]),
        (platform.cylinder.inertia + platform.rod.inertia) * turning,
    )

    def displaced(step):
        return places(Pose(pose.position + step[:3], pose.rotation @ exponential(step[3:])))

    return jax.vjp(displaced, jnp.zeros(6, pose.position.dtype))[1](needed)[0]
