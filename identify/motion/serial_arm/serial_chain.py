"""A serial chain of revolute and prismatic joints: pose and motion of its tool, and the efforts that drive its joints.

One instant in, one out, pure functions of JAX with exact derivatives. The recursion runs outward for velocities and
accelerations and inward for forces (recursive Newton–Euler; Featherstone, Rigid Body Dynamics Algorithms, 2008, 5.3).
Gravity enters as an acceleration of the base upwards, so that every acceleration is a specific force.
"""

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from identify.pytree import Pytree, static_field
from identify.rigid_body.dynamics import acceleration_at, moment_about_cg
from identify.rigid_body.inertia import Body
from identify.rigid_body.rotation import exponential


class SerialChain(Pytree):
    """Joints from the base to the tool, n of them, and the links that they move, as URDF describes them."""

    rotation: Float[Array | np.ndarray, "n 3 3"]
    """Rotation of each joint's frame at zero: takes components in it to those in the frame of the preceding link."""
    position: Float[Array | np.ndarray, "n 3"]
    """Position of each joint from the preceding one, in the frame of the preceding link [m]."""
    axis: Float[Array | np.ndarray, "n 3"]
    """Unit vector along each joint's axis, in the joint's frame."""
    tool_rotation: Float[Array | np.ndarray, "3 3"]
    """Rotation that takes components in the tool's frame B to those in the last link's frame."""
    tool_position: Float[Array | np.ndarray, "3"]
    """Position of the tool's origin Q from the last joint, in the last link's frame [m]."""
    mass: Float[Array | np.ndarray, " n"]
    """Mass of each link [kg], without what the tool carries."""
    r_cg: Float[Array | np.ndarray, "n 3"]
    """Centre of gravity of each link from its joint, in the link's frame [m]."""
    inertia: Float[Array | np.ndarray, "n 6"]
    """Packed tensor of each link about its centre of gravity, in the link's frame [kg·m²]."""
    prismatic: tuple[bool, ...] = static_field()
    """Mask of the joints that slide; the others turn."""

    @property
    def count(self) -> int:
        """Number of joints."""
        return len(self.prismatic)


class LinkMotion(NamedTuple):
    """Motion of a frame of the arm, in its own axes."""

    omega: Float[Array, "3"]
    """Angular velocity of the frame [rad/s]."""
    alpha: Float[Array, "3"]
    """Angular acceleration of the frame [rad/s²]."""
    specific_force: Float[Array, "3"]
    """Acceleration of the frame's origin less gravity [m/s²]."""


class LinkPoses(NamedTuple):
    """Poses of the frames of an arm, in the base's frame."""

    rotation: Float[Array, "m 3 3"]
    """Rotation that takes components in each frame to those in the base's frame."""
    position: Float[Array, "m 3"]
    """Position of each frame's origin [m]."""


class Driven(NamedTuple):
    """Motion of an arm's tool and efforts of its joints at one instant."""

    tool: LinkMotion
    """Motion of the tool's frame B, whose origin is Q."""
    effort: Float[Array, " n"]
    """Effort of each joint's drive: torque [N·m], or force of a prismatic joint [N]."""


def poses(chain: SerialChain, q: Float[Array, " n"]) -> LinkPoses:
    """Return the poses of all links and, last, of the tool, at joint positions [rad or m]: n + 1 frames."""
    turn, place = jnp.eye(3), jnp.zeros(3)
    rotations, positions = [], []
    for k in range(chain.count):
        step, at = _placement(chain, k, q[k])
        turn, place = turn @ step, place + turn @ at
        rotations.append(turn)
        positions.append(place)
    rotations.append(turn @ jnp.asarray(chain.tool_rotation))
    positions.append(place + turn @ jnp.asarray(chain.tool_position))
    return LinkPoses(jnp.stack(rotations), jnp.stack(positions))


def driven(
    chain: SerialChain,
    q: Float[Array, " n"],
    speed: Float[Array, " n"],
    acceleration: Float[Array, " n"],
    body: Body,
    gravity: Float[Array, ""] | float,
) -> Driven:
    """Return how the tool moves and what the joints' drives exert, without friction and the drives' own inertia.

    Args:
        chain: the arm.
        q: positions of the joints [rad or m].
        speed: their first derivative.
        acceleration: their second derivative.
        body: what the tool carries, from Q in B.
        gravity: local gravity [m/s²], along -z of the base.
    """
    steps, links = [], []
    motion = LinkMotion(jnp.zeros(3), jnp.zeros(3), jnp.array([0.0, 0.0, 1.0]) * gravity)
    for k in range(chain.count):
        steps.append(_placement(chain, k, q[k]))
        motion = _moved(chain, k, motion, steps[k], speed[k], acceleration[k])
        links.append(motion)
    to_tool, at_tool = jnp.asarray(chain.tool_rotation), jnp.asarray(chain.tool_position)
    tool = _seen_from(to_tool, at_tool, motion)
    force, moment = _wrench(body, tool)
    force, moment = to_tool @ force, to_tool @ moment + jnp.cross(at_tool, to_tool @ force)
    efforts: list[Array] = []
    for k in reversed(range(chain.count)):
        link = Body(*(jnp.asarray(array)[k] for array in (chain.mass, chain.r_cg, chain.inertia)))
        more_force, more_moment = _wrench(link, links[k])
        force, moment = force + more_force, moment + more_moment
        efforts.append(jnp.dot(jnp.asarray(chain.axis)[k], force if chain.prismatic[k] else moment))
        turn, at = steps[k]
        force, moment = turn @ force, turn @ moment + jnp.cross(at, turn @ force)
    return Driven(tool, jnp.stack(efforts[::-1]))


def _placement(chain: SerialChain, k: int, q: Array) -> tuple[Array, Array]:
    """Rotation and position of a link's frame in that of the link before."""
    turn, at, axis = (jnp.asarray(array)[k] for array in (chain.rotation, chain.position, chain.axis))
    return (turn, at + turn @ (q * axis)) if chain.prismatic[k] else (turn @ exponential(q * axis), at)


def _seen_from(turn: Array, at: Array, motion: LinkMotion) -> LinkMotion:
    """The motion of a frame that is fixed to another one, at this place, in its own axes."""
    carried = motion.specific_force + acceleration_at(at, motion.omega, motion.alpha)
    return LinkMotion(turn.T @ motion.omega, turn.T @ motion.alpha, turn.T @ carried)


def _moved(
    chain: SerialChain, k: int, before: LinkMotion, step: tuple[Array, Array], speed: Array, acceleration: Array
) -> LinkMotion:
    """The motion of a link from that of the one before."""
    omega, alpha, specific_force = _seen_from(*step, before)
    axis = jnp.asarray(chain.axis)[k]
    if chain.prismatic[k]:
        sliding = acceleration * axis + 2 * speed * jnp.cross(omega, axis)
        return LinkMotion(omega, alpha, specific_force + sliding)
    turning = acceleration * axis + speed * jnp.cross(omega, axis)
    return LinkMotion(omega + speed * axis, alpha + turning, specific_force)


def _wrench(body: Body, motion: LinkMotion) -> tuple[Array, Array]:
    """Force and moment about a frame's origin that a body fixed to the frame needs."""
    omega, alpha, specific_force = motion
    r_cg = jnp.asarray(body.r_cg_from_q)
    force = body.mass * (specific_force + acceleration_at(r_cg, omega, alpha))
    return force, moment_about_cg(jnp.asarray(body.inertia), omega, alpha) + jnp.cross(r_cg, force)
