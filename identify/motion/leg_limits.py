"""Demands of a trajectory on a platform: poses, legs and forces at many instants, compared with its limits."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from identify.motion.attitude import attitude
from identify.motion.limit_peaks import Peak, largest_uses
from identify.motion.stewart_platform import Legs, Pose, StewartPlatform, Twist, forces, joint_angles, legs, lengths
from identify.motion.trajectory import Trajectory, acceleration_of
from identify.rigid_body.dynamics import acceleration_at, wrench
from identify.rigid_body.inertia import Body

LEG_QUANTITIES = ("length", "speed", "acceleration", "force", "joint_angle")
"""Limited quantities of a leg; the others are those of an axis."""


@jax.jit
def leg_lengths(platform: StewartPlatform, poses: Pose) -> Float[Array, "n 6"]:
    """Return the legs' lengths [m] in each of several poses."""
    return jax.vmap(lambda pose: lengths(platform, pose))(poses)


class PlatformMotion(NamedTuple):
    """A platform's motion, instants first."""

    t: Float[Array, " n"]
    """Instants of the motion [s]."""
    pose: Pose
    """Position of OMB, (n, 3), and attitude, (n, 3, 3)."""
    twist: Twist
    """Velocity and acceleration of OMB in A; omega and alpha in B; (n, 3) each."""


@jax.jit
def platform_motion(
    platform: StewartPlatform, trajectory: Trajectory, t: Float[Array, " n"], still_from_omb: Float[Array, "3"]
) -> PlatformMotion:
    """Return the motion of a platform that carries out a trajectory, level and at home at the first instant.

    Equation (12) rotated into A and integrated twice, in closed form, so nothing drifts: the point that keeps still is
    at ``p + R s``, hence ``p = home + s - R s``; a trajectory of its own displacement adds it.

    Args:
        platform: for its home.
        trajectory: rotation, and displacement of the point that carries it.
        t: instants [s], uniform.
        still_from_omb: the point s that the rotation keeps still, from OMB, in B [m]: the centre of gravity, or zero.
    """
    omega, alpha = jax.vmap(trajectory.omega)(t), jax.vmap(trajectory.alpha)(t)
    rotation = attitude(trajectory.omega, t)
    to_a = lambda vectors: jnp.einsum("nij,nj->ni", rotation, vectors)  # noqa: E731
    turning = jax.vmap(acceleration_at, in_axes=(None, 0, 0))(-still_from_omb, omega, alpha)
    moved = jax.vmap(trajectory.displacement)(t)
    speed = jax.vmap(lambda at: jax.jvp(trajectory.displacement, (at,), (jnp.ones_like(at),))[1])(t)
    lever = jnp.broadcast_to(still_from_omb, omega.shape)
    position: Array = (jnp.asarray(platform.home) + still_from_omb)[None] - to_a(lever) + moved
    velocity = to_a(jnp.cross(omega, -lever)) + speed
    acceleration = to_a(turning) + jax.vmap(lambda at: acceleration_of(trajectory, at))(t)
    return PlatformMotion(t, Pose(position, rotation), Twist(velocity, omega, acceleration, alpha))


class Effort(NamedTuple):
    """Demands of a motion on platform, load cell, gyro and body, instants first."""

    legs: Legs
    """Lengths, speeds and accelerations of the legs, (n, 6) each."""
    force: Float[Array, "n 6"]
    """Force along each leg [N]."""
    joint_angle: Float[Array, "n 6"]
    """The larger of the angles at a leg's two joints, from home [rad]."""
    cell_force: Float[Array, "n 3"]
    """Force on the load cell [N]."""
    cell_moment: Float[Array, "n 3"]
    """Moment on the load cell about Q [N·m]."""
    omega: Float[Array, "n 3"]
    """Angular velocity of the body [rad/s]."""
    body_acceleration: Float[Array, " n"]
    """Acceleration of the body's centre of gravity, without gravity [m/s²]."""


@jax.jit
def effort(
    platform: StewartPlatform,
    body: Body,
    r_cg_from_omb: Float[Array, "3"],
    motion: PlatformMotion,
    gravity: Float[Array, ""],
) -> Effort:
    """Return what a motion asks for.

    Args:
        platform: geometry and moving masses.
        body: the body, its centre of gravity from Q.
        r_cg_from_omb: the same from OMB, in B [m].
        motion: of the platform.
        gravity: local gravity [m/s²].
    """
    carried = Body(body.mass, r_cg_from_omb, body.inertia)

    def of_instant(pose: Pose, twist: Twist):
        base, top = joint_angles(platform, pose)
        turning = acceleration_at(r_cg_from_omb, twist.omega, twist.alpha)
        acceleration = pose.rotation.T @ twist.acceleration + turning
        on_body = wrench(body, twist.omega, twist.alpha, acceleration + gravity * pose.rotation[2])
        return (
            legs(platform, pose, twist),
            forces(platform, carried, pose, twist, gravity),
            jnp.maximum(base, top),
            on_body.force,
            on_body.moment,
            jnp.linalg.norm(acceleration),
        )

    leg_motion, force, angle, cell_force, cell_moment, acceleration = jax.vmap(of_instant)(motion.pose, motion.twist)
    return Effort(
        legs=leg_motion, force=force, joint_angle=angle, cell_force=cell_force, cell_moment=cell_moment,
        omega=motion.twist.omega, body_acceleration=acceleration,
    )  # fmt: skip


class Limits(NamedTuple):
    """Limits of a rig; infinite where nothing limits."""

    length: Float[np.ndarray, "6 2"]
    """Shortest and longest length of each leg [m]."""
    speed: Float[np.ndarray, "6"]
    """Largest speed of each leg, either way [m/s]."""
    acceleration: Float[np.ndarray, "6"]
    """Largest acceleration of each leg, either way [m/s²]."""
    force: Float[np.ndarray, "6"]
    """Largest force along each leg, either way [N]."""
    joint_angle: Float[np.ndarray, ""]
    """Largest angle of the joints from home [rad]."""
    cell_force: Float[np.ndarray, "3"]
    """Rated force of the load cell on each axis [N]."""
    cell_moment: Float[np.ndarray, "3"]
    """Rated moment of the load cell on each axis [N·m]."""
    gyro_range: Float[np.ndarray, ""]
    """Range of the gyro on each axis [rad/s]."""
    body_acceleration: Float[np.ndarray, ""]
    """Largest acceleration that the body bears, without gravity [m/s²]."""
    bandwidth: float
    """Highest frequency of the platform's command [Hz]."""

    @classmethod
    def none(cls) -> "Limits":
        """Return no limits at all."""
        free, six, three = np.array(np.inf), np.full(6, np.inf), np.full(3, np.inf)
        ends = np.stack([np.zeros(6), six], axis=1)
        return cls(
            length=ends, speed=six, acceleration=six, force=six, joint_angle=free, cell_force=three, cell_moment=three,
            gyro_range=free, body_acceleration=free, bandwidth=np.inf,
        )  # fmt: skip


def needs(asked: Effort) -> Limits:
    """Return the tightest limits of the legs under which a motion can be run; sensors and body are left free."""
    largest = lambda values: np.abs(np.asarray(values)).max(axis=0)  # noqa: E731
    length = np.asarray(asked.legs.length)
    return Limits.none()._replace(
        length=np.stack([length.min(axis=0), length.max(axis=0)], axis=1),
        speed=largest(asked.legs.speed),
        acceleration=largest(asked.legs.acceleration),
        force=largest(asked.force),
    )


def shares(asked: Effort, limits: Limits) -> dict[str, Any]:
    """Return by quantity which share of its limit a motion uses at each instant, (n, k): legs or axes.

    A share of 1 or -1 is the limit. Shares have the quantities' signs and are smooth in time; a length counts from the
    middle of its range.
    """
    low, high = limits.length.T
    finite = np.isfinite(high)
    middle, half = np.where(finite, (low + high) / 2, 0.0), np.where(finite, (high - low) / 2, np.inf)
    return {
        "length": (asked.legs.length - middle[None]) / half[None],
        "speed": asked.legs.speed / limits.speed[None],
        "acceleration": asked.legs.acceleration / limits.acceleration[None],
        "force": asked.force / limits.force[None],
        "joint_angle": asked.joint_angle / limits.joint_angle,
        "cell_force": asked.cell_force / limits.cell_force[None],
        "cell_moment": asked.cell_moment / limits.cell_moment[None],
        "gyro_range": asked.omega / limits.gyro_range,
        "body_acceleration": asked.body_acceleration[:, None] / limits.body_acceleration,
    }


def channel_name(quantity: str, channel: int) -> str:
    """Return what to call a quantity's leg or axis."""
    return f"{'leg' if quantity in LEG_QUANTITIES else 'axis'} {channel + 1}"


def peaks(asked: Effort, limits: Limits, t: Float[Array, " n"]) -> list[Peak]:
    """Return each limited quantity's largest use, the largest first."""
    return [peak for peak in largest_uses(shares(asked, limits), t, channel_name) if peak.share > 0]
