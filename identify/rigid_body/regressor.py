"""The regressors: ONE sample in, its rows out.

``Omega_R`` of (7) is linear in nine features of the motion, ``alpha`` and the products ``omega_i omega_j``; with
``omega`` itself and 1 these are thirteen, and everything that least squares needs is sums of their products
(:mod:`identify.estimators.gram`). Features stand on the leading axis, so ``(3,)`` gives one sample and ``(3, n)`` a
block.
"""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

FEATURES = ("1", "w1", "w2", "w3", "w1w1", "w2w2", "w3w3", "w1w2", "w1w3", "w2w3", "a1", "a2", "a3")
OMEGA, ALPHA = slice(1, 4), slice(10, 13)
"""Where omega and alpha stand among the features."""


def features(omega: Float[Array, "3 *n"], alpha: Float[Array, "3 *n"]) -> Float[Array, "13 *n"]:
    """Return the features ``FEATURES`` of angular velocity [rad/s] and angular acceleration [rad/s²]."""
    w1, w2, w3 = omega
    products = jnp.stack([w1 * w1, w2 * w2, w3 * w3, w1 * w2, w1 * w3, w2 * w3])
    return jnp.concatenate([jnp.ones_like(omega[:1]), omega, products, alpha])


def _omega_r(feature):
    """Omega_R from the features of one sample; works on any array library."""
    _, _, _, _, w11, w22, w33, w12, w13, w23, a1, a2, a3 = feature
    return [
        [a1, a2 - w13, a3 + w12, -w23, w22 - w33, w23],
        [w13, a1 + w23, w33 - w11, a2, a3 - w12, -w13],
        [-w12, w11 - w22, a1 - w23, w12, a2 + w13, a3],
    ]


def omega_r(omega: Float[Array, "3"], alpha: Float[Array, "3"]) -> Float[Array, "3 6"]:
    """Return ``Omega_R`` of (7): ``Omega_R @ inertia == I·alpha + omega × (I·omega)`` [N·m]."""
    return jnp.array(_omega_r(features(omega, alpha)))


OMEGA_R_OF_FEATURES = np.array([_omega_r(unit) for unit in np.eye(len(FEATURES))])
"""Shape (13, 3, 6): ``Omega_R = sum_k feature_k * OMEGA_R_OF_FEATURES[k]``."""


def pi(force: Float[Array, "3"]) -> Float[Array, "3 3"]:
    """Return ``Pi`` of (7): ``Pi(F) @ r == r × F``."""
    return -cross_matrix(force)


def cross_matrix(vector: Float[Array, "3"]) -> Float[Array, "3 3"]:
    """Return the matrix with ``cross_matrix(v) @ x == v × x``."""
    v1, v2, v3 = vector
    zero = jnp.zeros_like(v1)
    return jnp.array([[zero, -v3, v2], [v3, zero, -v1], [-v2, v1, zero]])


def wrench_regressor(
    omega: Float[Array, "3"], alpha: Float[Array, "3"], specific_force: Float[Array, "3"]
) -> Float[Array, "6 10"]:
    """Return the regressor of the wrench at Q over the ten inertial parameters.

    Args:
        omega: angular velocity in B [rad/s].
        alpha: angular acceleration in B [rad/s²].
        specific_force: ``a_Q - R g`` at the load cell's centre Q, in B [m/s²].

    Returns:
        ``Y`` with ``Y @ (m, m r, inertia about Q) == (F, M)``: (4) and (11) written about Q, where they are linear
        in mass [kg], first moment ``m r`` [kg·m] and the packed tensor about Q [kg·m²].
    """
    spin = cross_matrix(omega)
    first_moment = cross_matrix(alpha) + spin @ spin
    force = jnp.hstack([specific_force[:, None], first_moment, jnp.zeros((3, 6), omega.dtype)])
    moment = jnp.hstack([jnp.zeros((3, 1), omega.dtype), -cross_matrix(specific_force), omega_r(omega, alpha)])
    return jnp.vstack([force, moment])
