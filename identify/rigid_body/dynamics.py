"""From motion to the wrench that the load cell exerts on the body at Q: (4), (5), (11). One sample in, one out."""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float

from identify.rigid_body.inertia import Body, unpack


class Wrench(NamedTuple):
    """Force [N] and moment about Q [N·m], in B."""

    force: Float[Array, "3"]
    moment: Float[Array, "3"]


def wrench(
    body: Body, omega: Float[Array, "3"], alpha: Float[Array, "3"], specific_force_cg: Float[Array, "3"]
) -> Wrench:
    """Return the wrench ON THE BODY at Q, in B.

    Args:
        body: mass, centre of gravity from Q, tensor about the centre of gravity.
        omega: angular velocity in B [rad/s].
        alpha: angular acceleration in B [rad/s²].
        specific_force_cg: ``a_CG - R g`` in B [m/s²]; (0, 0, |g|) for a level body at rest.

    Returns:
        F of (4) and M of (5), solved for M.
    """
    force = body.mass * specific_force_cg
    tensor = unpack(body.inertia)
    moment = tensor @ alpha + jnp.cross(omega, tensor @ omega) + jnp.cross(body.r_cg_from_q, force)
    return Wrench(force, moment)


def acceleration_at(offset: Float[Array, "3"], omega: Float[Array, "3"], alpha: Float[Array, "3"]) -> Float[Array, "3"]:
    """Return the acceleration of a body-fixed point relative to another, ``alpha × ρ + omega × (omega × ρ)`` [m/s²].

    ``offset`` ρ is the vector between the two points in B [m]. With the centre of gravity still, (12) is this with
    ρ reversed: the acceleration that the platform's centre OMB must have.
    """
    return jnp.cross(alpha, offset) + jnp.cross(omega, jnp.cross(omega, offset))
