"""Second moments of a body and its log-Cholesky parameters: a smooth parametrisation of the bodies that can be.

Any tensor of a body has second moments ``Σ = U Uᵀ`` with ``U`` upper triangular of positive diagonal, its logarithms
and the rest free numbers (log-Cholesky; Rucker and Wensing 2022, doi:10.1109/LRA.2022.3186511); all ten parameters of a
body have such a pseudo-inertia ``J = [[Σ_Q, m r], [m rᵀ, m]] = U Uᵀ``.
"""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from identify.rigid_body.inertia import pack, unpack

UNITS = np.array([unpack(unit) for unit in np.eye(6)])
"""Symmetric matrix of each packed unit tensor, (6, 3, 3)."""
SECOND_MOMENT = np.array([0.5 * np.trace(unit) * np.eye(3) - unit for unit in UNITS])
"""Second-moment matrix of each packed unit tensor, (6, 3, 3)."""


def second_moment(inertia: Float[np.ndarray, "6"]) -> Float[np.ndarray, "3 3"]:
    """Return ``Σ = ½ tr(I) 1 - I`` [kg·m²] of a packed tensor."""
    return np.tensordot(inertia, SECOND_MOMENT, axes=1)


def of_second_moment(moments: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, "6"]:
    """Return the packed tensor ``I = tr(Σ) 1 - Σ``."""
    return pack(np.trace(moments) * np.eye(3) - moments)


def log_cholesky(free: Float[Array, "6"]) -> Float[Array, "6"]:
    """Return the packed tensor of ``U = [[e^d1, s12, s13], [0, e^d2, s23], [0, 0, e^d3]]``, free = (d, s12, s23, s13).

    ``Σ = U Uᵀ`` and ``I = tr(Σ) 1 - Σ`` [kg·m²]: a body's tensor whatever the six numbers are.
    """
    d1, d2, d3, s12, s23, s13 = free
    zero = jnp.zeros_like(d1)
    upper = jnp.array([[jnp.exp(d1), s12, s13], [zero, jnp.exp(d2), s23], [zero, zero, jnp.exp(d3)]])
    moments = upper @ upper.T
    return pack(jnp.trace(moments) * jnp.eye(3, dtype=moments.dtype) - moments)


def pseudo_inertia(free: Float[Array, "10"]) -> Float[Array, "10"]:
    """Return mass [kg], r_CG [m] and packed tensor about the CG [kg·m²] of ``(α, d1, d2, d3, s12, s23, s13, t)``.

    ``J = U Uᵀ`` with ``U = e^α [[e^d1, s12, s13, t1], [0, e^d2, s23, t2], [0, 0, e^d3, t3], [0, 0, 0, 1]]``: a body
    whatever the ten numbers are, with mass ``e^2α`` and its centre of gravity at ``t``.
    """
    mass = jnp.exp(2 * free[0])
    return jnp.concatenate([mass[None], free[7:], mass * log_cholesky(free[1:7])])


def free_of(inertia: Float[np.ndarray, "6"]) -> Float[np.ndarray, "6"]:
    """Return the free numbers of a tensor that a body has: the inverse of :func:`log_cholesky`.

    Raises:
        ValueError: no body has it.
    """
    flipped = second_moment(np.asarray(inertia, float))[::-1, ::-1]
    if not (np.linalg.eigvalsh(flipped) > 0).all():
        raise ValueError("Argument `inertia` must be a physically possible tensor, but breaks the triangle inequality.")
    upper = np.linalg.cholesky(flipped)[::-1, ::-1]
    return np.array([*np.log(np.diag(upper)), upper[0, 1], upper[1, 2], upper[0, 2]])
