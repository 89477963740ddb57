"""Mass, centre of gravity and tensor of bodies made of simple solids: closed forms.

A solid is its volume and its mean squares ``<x²>, <y²>, <z²>`` about its own centre in its own axes, in which it is
symmetric. With ``S = ∫ ζ ζᵀ dm`` the tensor is ``tr(S) 1 - S``; masses, first moments and S of parts add up, and those
of holes are subtracted.
"""

from collections.abc import Sequence
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from identify.rigid_body.inertia import pack

Length = Float[Array, ""] | Float[np.ndarray, ""] | float


class Solid(NamedTuple):
    """A homogeneous solid about its centre, in its own axes."""

    volume: Float[Array, ""]
    """Volume of the solid [m³]."""
    mean_squares: Float[Array, "3"]
    """Mean squares ``∫x² dV / V`` of the three coordinates [m²]."""


class Part(NamedTuple):
    """A solid with its mass, in the frame of the whole."""

    mass: Float[Array, ""]
    """Mass of the part [kg]; negative for a hole."""
    mean_squares: Float[Array, "3"]
    """Mean squares of the coordinates, in the part's axes [m²]."""
    rotation: Float[Array | np.ndarray, "3 3"]
    """Rotation that takes components in the part's axes to components in the frame."""
    position: Float[Array, "3"]
    """Position of the part's centre in the frame [m]."""


def cylinder(diameter: Length, length: Length, inner_diameter: Length = 0.0) -> Solid:
    """Return a solid or hollow cylinder along its own z: ``<x²> = (D² + d²)/16``, ``<z²> = L²/12``."""
    across, bore = jnp.asarray(diameter) ** 2, jnp.asarray(inner_diameter) ** 2
    along = jnp.asarray(length) ** 2
    return Solid(jnp.pi / 4 * (across - bore) * length, jnp.stack([across + bore, across + bore, 4 / 3 * along]) / 16)


def cuboid(size: Float[Array, "3"]) -> Solid:
    """Return a cuboid with these edges along its own axes: ``<x²> = a²/12``."""
    return Solid(jnp.prod(size), size**2 / 12)


def sphere(diameter: Length, inner_diameter: Length = 0.0) -> Solid:
    """Return a solid or hollow sphere: ``<x²> = (R⁵ - r⁵) / (R³ - r³) / 5``."""
    big, small = jnp.asarray(diameter) / 2, jnp.asarray(inner_diameter) / 2
    cubes = big**3 - small**3
    return Solid(4 / 3 * jnp.pi * cubes, jnp.broadcast_to((big**5 - small**5) / cubes / 5, (3,)))


def composite(parts: Sequence[Part]) -> Float[Array, "10"]:
    """Return mass, centre of gravity and packed tensor about it, of parts and holes together [kg, m, kg·m²]."""
    mass = sum((part.mass for part in parts), jnp.zeros(()))
    centre = sum((part.mass * part.position for part in parts), jnp.zeros(3)) / mass
    second = sum((_second_moment(part, centre) for part in parts), jnp.zeros((3, 3)))
    return jnp.concatenate([mass[None], centre, pack(jnp.trace(second) * jnp.eye(3) - second)])


def _second_moment(part: Part, point: Float[Array, "3"]) -> Float[Array, "3 3"]:
    """``∫ ζ ζᵀ dm`` about a point."""
    arm, turn = part.position - point, jnp.asarray(part.rotation)
    return part.mass * (turn * part.mean_squares[None] @ turn.T + jnp.outer(arm, arm))
