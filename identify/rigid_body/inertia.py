"""The inertia tensor: packing, the parallel axis, another frame.

A packed tensor is ``(I11, I12, I13, I22, I23, I33)`` in kg·m². Its off-diagonal terms are the tensor's entries,
``I_ij = ∫(δij |ζ|² - ζi ζj) dm``, the sign that URDF and MJCF use. Every function takes arrays of JAX or of NumPy and
returns the same kind; nothing here imports JAX.
"""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from identify.rigid_body.regressor import Array, ArrayT

COMPONENTS = ("I11", "I12", "I13", "I22", "I23", "I33")
"""Names of a packed tensor's six numbers, in their order: moments are the numbers 0, 3 and 5."""
MOMENTS = (0, 3, 5)  # where the moments of inertia stand in a packed tensor
PRODUCTS = (1, 2, 4)  # where the products of inertia stand
ENTRIES = np.array([1.0, 2.0, 2.0, 1.0, 2.0, 1.0])
"""Number of entries of the tensor that equal each packed component: weights of its squared Frobenius norm."""
GRAM_METRE = 1e3
"""g·m² in a kg·m²."""

_ROWS, _COLUMNS = np.triu_indices(3)


class Body(NamedTuple):
    """A rigid body: what (4) and (5) need to know of it."""

    mass: Float[Array, ""]
    """Mass of the body [kg]."""
    r_cg_from_q: Float[Array, "3"]
    """Centre of gravity from the load cell's centre Q, in the body frame B [m]."""
    inertia: Float[Array, "6"]
    """Packed inertia tensor about the centre of gravity, in B [kg·m²]."""


def pack(tensor: Float[ArrayT, "3 3"]) -> Float[ArrayT, "6"]:
    """Return the upper triangle of a symmetric tensor, row by row."""
    return tensor[_ROWS, _COLUMNS]


def unpack(inertia: Float[ArrayT, "6"]) -> Float[ArrayT, "3 3"]:
    """Return the symmetric 3×3 tensor of a packed one."""
    i11, i12, i13, i22, i23, i33 = inertia
    return inertia.__array_namespace__().array([[i11, i12, i13], [i12, i22, i23], [i13, i23, i33]])


def parallel_axis(
    inertia: Float[ArrayT, "6"], mass: Float[ArrayT, ""], offset: Float[ArrayT, "3"]
) -> Float[ArrayT, "6"]:
    """Return the tensor about a point at ``offset`` [m] from the centre of gravity (Huygens–Steiner)."""
    xp = offset.__array_namespace__()
    return inertia + mass * pack(xp.dot(offset, offset) * xp.eye(3) - xp.outer(offset, offset))


def rotate(inertia: Float[ArrayT, "6"], rotation: Float[ArrayT, "3 3"]) -> Float[ArrayT, "6"]:
    """Return the tensor in frame C, where ``rotation`` takes components in B to components in C."""
    return pack(rotation @ unpack(inertia) @ rotation.T)
