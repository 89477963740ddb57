"""The wrench that the load cell exerts on the body at Q, from the motion: (4), (5), (11). One sample in, one out."""

from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from identify.rigid_body.inertia import Body, unpack
from identify.rigid_body.regressor import Array, ArrayT

Vectors = Float[Array, "... 3"] | Float[np.ndarray, "... 3"]
"""Vectors of three components as an array of JAX or NumPy."""


class Wrench(NamedTuple):
    """Force [N] and moment about Q [N·m], in B."""

    force: Float[Array, "3 *n"]
    moment: Float[Array, "3 *n"]


def wrench(
    body: Body, omega: Float[Array, "3 *n"], alpha: Float[Array, "3 *n"], specific_force_cg: Float[Array, "3 *n"]
) -> Wrench:
    """Return the wrench ON THE BODY at Q, in B; components first.

    Args:
        body: mass, centre of gravity from Q, tensor about the centre of gravity.
        omega: angular velocity in B [rad/s].
        alpha: angular acceleration in B [rad/s²].
        specific_force_cg: ``a_CG - R g`` in B [m/s²]; (0, 0, |g|) for a level body at rest.

    Returns:
        F of (4) and M of (5), solved for M.
    """
    force = body.mass * specific_force_cg
    xp = omega.__array_namespace__()
    r_cg_from_q = xp.reshape(body.r_cg_from_q, (3, *(1,) * (force.ndim - 1)))
    return Wrench(force, moment_about_cg(body.inertia, omega, alpha) + xp.cross(r_cg_from_q, force, axis=0))


def moment_about_cg(
    inertia: Float[ArrayT, "6"], omega: Float[ArrayT, "3 *n"], alpha: Float[ArrayT, "3 *n"]
) -> Float[ArrayT, "3 *n"]:
    """Return Euler's moment about the centre of gravity, ``I·alpha + omega × (I·omega)`` [N·m].

    Args:
        inertia: packed tensor about the centre of gravity [kg·m²].
        omega: angular velocity [rad/s], components first.
        alpha: angular acceleration [rad/s²], components first.
    """
    tensor = unpack(inertia)
    return tensor @ alpha + omega.__array_namespace__().cross(omega, tensor @ omega, axis=0)


def acceleration_at(offset: Vectors, omega: Vectors, alpha: Vectors) -> Any:
    """Return the acceleration of a body-fixed point relative to another, ``alpha × ρ + omega × (omega × ρ)`` [m/s²].

    ``offset`` ρ is the vector between the two points in B [m]. With the centre of gravity still, (12) is this with
    ρ reversed: the acceleration that the platform's centre OMB must have.
    """
    xp: Any = omega.__array_namespace__()
    return xp.cross(alpha, offset) + xp.cross(omega, xp.cross(omega, offset))


def moment_about(
    moment: Float[np.ndarray, "n 3"], force: Float[np.ndarray, "n 3"], offset: Float[np.ndarray, "3"]
) -> Float[np.ndarray, "n 3"]:
    """Return the moment about Q of a wrench whose moment was taken about P: ``M_Q = M_P + p × F``, p from Q to P."""
    return moment + np.cross(offset, force)


def specific_force_at(
    specific_force: Float[np.ndarray, "n 3"],
    omega: Float[np.ndarray, "n 3"],
    alpha: Float[np.ndarray, "n 3"],
    offset: Float[np.ndarray, "3"],
) -> Float[np.ndarray, "n 3"]:
    """Return the specific force [m/s²] at one point of the body from that at another, by :func:`acceleration_at`.

    Args:
        specific_force: at the accelerometer [m/s²].
        omega: angular velocity [rad/s].
        alpha: angular acceleration [rad/s²].
        offset: ρ, from the accelerometer to the point [m].
    """
    return specific_force + acceleration_at(offset, omega, alpha)
