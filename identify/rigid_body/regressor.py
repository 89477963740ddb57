"""The regressors: ONE sample in, its rows out.

``Omega_R`` of (7) is linear in nine features of the motion, ``alpha`` and the products ``omega_i omega_j``; with
``omega`` itself and 1 these are thirteen, and everything that least squares needs is sums of their products
(:mod:`identify.least_squares.gram`). Features stand on the leading axis, so ``(3,)`` gives one sample and ``(3, n)`` a
block. Every function takes arrays of JAX or of NumPy and returns the same kind; nothing here imports JAX, so that the
tables and ``inertia inspect`` start without it.
"""

from typing import TYPE_CHECKING, Any, TypeVar

import numpy as np
from jaxtyping import Float

if TYPE_CHECKING:
    import jax

    Array = jax.Array | np.ndarray
    ArrayT = TypeVar("ArrayT", np.ndarray, jax.Array, Array)  # the kind that is given
else:
    Array = ArrayT = Any  # jaxtyping's Array would import JAX


def library_of(*arrays: Any) -> Any:
    """Return the array library that computes with all of these: JAX where one of them is its array, else NumPy."""
    numpy_types = np.ndarray | np.generic | float | int
    return next((x.__array_namespace__() for x in arrays if not isinstance(x, numpy_types)), np)


FEATURES = ("1", "w1", "w2", "w3", "w1w1", "w2w2", "w3w3", "w1w2", "w1w3", "w2w3", "a1", "a2", "a3")
OMEGA, PRODUCTS, ALPHA = slice(1, 4), slice(4, 10), slice(10, 13)
"""Slices of omega, of its products and of alpha among the features."""
PAIRS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
"""The axes of the products ``omega_i omega_j``."""


def features(omega: Float[ArrayT, "3 *n"], alpha: Float[ArrayT, "3 *n"]) -> Float[ArrayT, "13 *n"]:
    """Return the features ``FEATURES`` of angular velocity [rad/s] and angular acceleration [rad/s²]."""
    xp = omega.__array_namespace__()
    products = xp.stack([omega[i] * omega[j] for i, j in PAIRS])
    return xp.concat([xp.ones_like(omega[:1]), omega, products, alpha])


def _omega_r(feature):
    """Omega_R from the features of one sample; works on any array library."""
    _, _, _, _, w11, w22, w33, w12, w13, w23, a1, a2, a3 = feature
    return [
        [a1, a2 - w13, a3 + w12, -w23, w22 - w33, w23],
        [w13, a1 + w23, w33 - w11, a2, a3 - w12, -w13],
        [-w12, w11 - w22, a1 - w23, w12, a2 + w13, a3],
    ]


def omega_r(omega: Float[ArrayT, "3"], alpha: Float[ArrayT, "3"]) -> Float[ArrayT, "3 6"]:
    """Return ``Omega_R`` of (7): ``Omega_R @ inertia == I·alpha + omega × (I·omega)`` [N·m].

    Raises:
        ValueError: they are not of one sample.
    """
    if omega.shape != (3,) or alpha.shape != (3,):
        raise ValueError(f"omega_r takes one sample, (3,), but has {omega.shape}, {alpha.shape}: jax.vmap takes many")
    return omega.__array_namespace__().array(_omega_r(features(omega, alpha)))


OMEGA_R_OF_FEATURES = np.array([_omega_r(unit) for unit in np.eye(len(FEATURES))])
"""Coefficients (13, 3, 6) of ``Omega_R = sum_k feature_k * OMEGA_R_OF_FEATURES[k]``."""


def _first_moment(feature):
    """``[alpha]× + [omega]×[omega]×`` from the features of one sample; works on any array library."""
    _, _, _, _, w11, w22, w33, w12, w13, w23, a1, a2, a3 = feature
    return [
        [-w22 - w33, w12 - a3, w13 + a2],
        [w12 + a3, -w11 - w33, w23 - a1],
        [w13 - a2, w23 + a1, -w11 - w22],
    ]


FIRST_MOMENT_OF_FEATURES = np.array([_first_moment(unit) for unit in np.eye(len(FEATURES))])
"""Coefficients (13, 3, 3) of the features in the matrix that multiplies the first moment ``m r`` in the force."""


def pi(force: Float[ArrayT, "3"]) -> Float[ArrayT, "3 3"]:
    """Return ``Pi`` of (7): ``Pi(F) @ r == r × F``."""
    return -cross_matrix(force)


def cross_matrix(vector: Float[ArrayT, "3 *n"]) -> Float[ArrayT, "3 3 *n"]:
    """Return the matrix with ``cross_matrix(v) @ x == v × x``."""
    v1, v2, v3 = vector
    xp = vector.__array_namespace__()
    zero = xp.zeros_like(v1)
    return xp.array([[zero, -v3, v2], [v3, zero, -v1], [-v2, v1, zero]])


def cross_matrices(vectors: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3 3"]:
    """Return :func:`cross_matrix` of many vectors, in NumPy."""
    return np.ascontiguousarray(np.moveaxis(cross_matrix(vectors.T), -1, 0))


PI_OF_FORCE = np.array([pi(unit) for unit in np.eye(3)])
"""Coefficients (3, 3, 3) of ``Pi(F) = sum_k F_k * PI_OF_FORCE[k]``."""


def wrench_regressor(
    omega: Float[ArrayT, "3"], alpha: Float[ArrayT, "3"], specific_force: Float[ArrayT, "3"]
) -> Float[ArrayT, "6 10"]:
    """Return the regressor of the wrench at Q over the ten inertial parameters.

    Args:
        omega: angular velocity in B [rad/s].
        alpha: angular acceleration in B [rad/s²].
        specific_force: ``a_Q - R g`` at the load cell's centre Q, in B [m/s²].

    Returns:
        ``Y`` with ``Y @ (m, m r, inertia about Q) == (F, M)``: (4) and (11) written about Q, where they are linear
        in mass [kg], first moment ``m r`` [kg·m] and the packed tensor about Q [kg·m²].
    """
    xp = omega.__array_namespace__()
    first_moment = xp.array(_first_moment(features(omega, alpha)))
    force = xp.hstack([specific_force[:, None], first_moment, xp.zeros((3, 6), omega.dtype)])
    moment = xp.hstack([xp.zeros((3, 1), omega.dtype), pi(specific_force), omega_r(omega, alpha)])
    return xp.vstack([force, moment])
