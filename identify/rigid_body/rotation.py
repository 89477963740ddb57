"""Rotations: from declared axes, quaternions and matrices; exponential and angular velocity of a rotation vector.

A rotation vector may be an array of JAX or of NumPy; nothing here imports JAX.
"""

import numpy as np
from jaxtyping import Float
from numpy.typing import ArrayLike

from identify.rigid_body.regressor import ArrayT, cross_matrices

CROSS = cross_matrices(np.eye(3))
"""``unit vector ×``, as a matrix, for each axis."""
TOLERANCE = 1e-3
"""Departure of a written matrix from orthonormal that counts as rounding of its decimals."""


def nearest_rotation(matrix: ArrayLike) -> Float[np.ndarray, "3 3"]:
    """Return the rotation nearest to a matrix that was written with few decimals (polar decomposition).

    Args:
        matrix: nearly a rotation, shape (3, 3).

    Raises:
        ValueError: another shape, a number that is not finite, not orthonormal within ``TOLERANCE``, or left-handed.
    """
    rows = np.asarray(matrix, float)
    if rows.shape != (3, 3) or not np.isfinite(rows).all():
        raise ValueError("is not three rows of three finite numbers: write them so")
    if np.abs(rows @ rows.T - np.eye(3)).max() > TOLERANCE:
        raise ValueError("is no rotation: its rows must be of unit length and at right angles")
    if np.linalg.det(rows) < 0:
        raise ValueError("is left-handed: change the sign of one axis, or swap two")
    return rows if np.array_equal(rows @ rows.T, np.eye(3)) else closest_rotation(rows)


def closest_rotation(matrix: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, "3 3"]:
    """Return the rotation whose elements are closest to a matrix's: of a mean of rotations, the mean rotation."""
    left, _, right = np.linalg.svd(matrix)
    return np.asarray(left * [1, 1, np.linalg.det(left @ right)] @ right)


def from_quaternion(w: float, x: float, y: float, z: float) -> Float[np.ndarray, "3 3"]:
    """Return the rotation matrix of a unit quaternion ``w + x i + y j + z k``, scalar first by name.

    Raises:
        ValueError: its norm is not 1 within ``TOLERANCE``.
    """
    q = np.array([w, x, y, z], float)
    norm = np.linalg.norm(q)
    if not abs(norm - 1) <= TOLERANCE:
        raise ValueError(f"has the norm {norm:.6g}: write a quaternion of norm 1")
    return from_quaternions(q[None] / norm)[0]


def from_axes(text: str) -> Float[np.ndarray, "3 3"]:
    """Return the rotation of signed axes such as ``"-y, z, x"``: the body's x is the sensor's −y, its y the sensor's z.

    Raises:
        ValueError: not three axes with their signs, one axis twice, or left-handed.
    """
    return nearest_rotation(signed_order(text, "xyz"))


def signed_order(text: str, names: str) -> Float[np.ndarray, "n n"]:
    """Return the matrix of names with their signs, such as ``"-y, z, x"``: of each row, the name that it takes.

    Raises:
        ValueError: not each of ``names`` once, with one sign at most.
    """
    words = [word.strip().lower() for word in text.split(",")]
    plain = [word.lstrip("+-").strip() for word in words]
    if sorted(plain) != sorted(names) or any(len(word) - len(word.lstrip("+-")) > 1 for word in words):
        example = ", ".join(names[1:] + names[0])
        count = {3: "three", 4: "four"}[len(names)]
        raise ValueError(f'is not {count} signed axes: write each of {", ".join(names)} once, such as "-{example}"')
    rows = np.zeros((len(names), len(names)))
    for row, word, name in zip(rows, words, plain, strict=True):
        row[names.index(name)] = -1.0 if word.startswith("-") else 1.0
    return rows


def exponential(turn: Float[ArrayT, "*n 3"]) -> Float[ArrayT, "*n 3 3"]:
    """Return the rotation matrix of a rotation vector [rad] (Rodrigues), with its Taylor branch near zero."""
    xp = turn.__array_namespace__()
    square = (turn * turn).sum(axis=-1)[..., None, None]
    small = square < 1e-8
    angle = xp.sqrt(xp.where(small, 1.0, square))
    sine = xp.where(small, 1 - square / 6, xp.sin(angle) / angle)
    cosine = xp.where(small, 0.5 - square / 24, (1 - xp.cos(angle)) / angle**2)
    cross = CROSS.astype(turn.dtype)  # float64 would stay so where it is off
    # a product of matrices may round to three digits on a GPU; the sum is traced faster than cross_matrix
    by_product = isinstance(turn, np.ndarray)
    hat = np.tensordot(turn, cross, 1) if by_product else (cross * turn[..., None, None]).sum(axis=-3)
    return xp.eye(3, dtype=turn.dtype) + sine * hat + cosine * (hat @ hat)


def quaternions(rotations: Float[np.ndarray, "n 3 3"]) -> Float[np.ndarray, "n 4"]:
    """Return the unit quaternions w, x, y, z of many rotation matrices, w not negative, in NumPy."""
    trace, unit = np.trace(rotations, axis1=1, axis2=2)[:, None, None], np.eye(3)
    products = np.empty((len(rotations), 4, 4))  # of the quaternion with itself, four times
    products[:, 0, 0] = 1 + trace[:, 0, 0]
    products[:, 0, 1:] = products[:, 1:, 0] = np.einsum("kij,nij->nk", CROSS, rotations)
    products[:, 1:, 1:] = rotations + rotations.swapaxes(1, 2) + (1 - trace) * unit
    largest = np.argmax(np.diagonal(products, axis1=1, axis2=2), axis=1)
    largest_rows = products[np.arange(len(rotations)), largest]
    signs = np.where(largest_rows[:, :1] < 0, -1, 1)
    return np.asarray(largest_rows * signs / np.linalg.norm(largest_rows, axis=1, keepdims=True))


def from_quaternions(values: Float[np.ndarray, "n 4"]) -> Float[np.ndarray, "n 3 3"]:
    """Return the rotation matrices of many unit quaternions w, x, y, z, in NumPy."""
    hats = cross_matrices(values[:, 1:])
    return np.asarray(np.eye(3) + 2 * (values[:, :1, None] * hats + hats @ hats))


def rotation_vectors(rotations: Float[np.ndarray, "n 3 3"]) -> Float[np.ndarray, "n 3"]:
    """Return the rotation vectors [rad] of many rotation matrices, of length π at most, in NumPy."""
    values = quaternions(rotations)
    sine = np.linalg.norm(values[:, 1:], axis=1, keepdims=True)
    angle = 2 * np.arctan2(sine, values[:, :1])
    return np.asarray(values[:, 1:] * np.where(sine > 0, angle / np.where(sine > 0, sine, 1), 2))


def cumulative_product(matrices: Float[np.ndarray, "n 3 3"]) -> Float[np.ndarray, "n 3 3"]:
    """Return the products of the first 1 … n matrices, in √n rows that are multiplied side by side: √n steps, not n.

    As :func:`identify.motion.attitude.running_product` does it in JAX.
    """
    n, unit = len(matrices), np.eye(3)
    size = int(np.ceil(np.sqrt(n)))
    rows = np.concatenate([matrices, np.broadcast_to(unit, (size * size - n, 3, 3))]).reshape(size, size, 3, 3)
    for k in range(1, size):
        rows[:, k] = rows[:, k - 1] @ rows[:, k]
    before = [unit]
    for end in rows[:-1, -1]:
        before.append(before[-1] @ end)
    return np.asarray((np.array(before)[:, None] @ rows).reshape(-1, 3, 3)[:n])


def rate_of_turn(turn: Float[ArrayT, "3"], rate: Float[ArrayT, "3"]) -> Float[ArrayT, "3"]:
    """Return the angular velocity in B [rad/s] of the attitude ``exp(turn)``, whose rotation vector has this rate."""
    xp = turn.__array_namespace__()
    square = xp.dot(turn, turn)
    small = square < 1e-6
    safe = xp.where(small, 1.0, square)
    angle = xp.sqrt(safe)
    first = xp.where(small, 0.5 - square / 24 + square**2 / 720, (1 - xp.cos(angle)) / safe)
    second = xp.where(small, 1 / 6 - square / 120 + square**2 / 5040, (angle - xp.sin(angle)) / (safe * angle))
    crossed = xp.cross(turn, rate)
    return rate - first * crossed + second * xp.cross(turn, crossed)
