"""A square root of a covariance that may be singular, in plain arithmetic.

LAPACK in small batches can block XLA's threads if each core is a device.
"""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float


def covariance_root(covariance: Float[Array, "k k"]) -> Float[Array, "k k"]:
    """Return the triangular ``L`` with ``L Lᵀ`` the covariance, but for 1e-12 of each variance on the diagonal."""
    scale = jnp.sqrt(jnp.diag(covariance))
    inverse = jnp.where(scale > 0, 1 / jnp.where(scale > 0, scale, 1), 0)
    size = len(covariance)
    nearly_singular = max(
        1e-12, 64 * size * float(jnp.finfo(covariance.dtype).eps)
    )  # alphas of similar differentiators
    correlation = covariance * jnp.outer(inverse, inverse) + nearly_singular * jnp.eye(size)
    return scale[:, None] * _triangular_root(correlation)


def _triangular_root(matrix: Array) -> Array:
    """Cholesky's; a pivot that the rounding of float32 sums has left below zero counts as zero."""
    index = jnp.arange(len(matrix))

    def step(k, state):
        rest, root = state
        pivot = jnp.where(rest[k, k] > 0, rest[k, k], jnp.inf)
        column = jnp.where(index >= k, rest[:, k], 0) * jax.lax.rsqrt(pivot)
        return rest - jnp.outer(column, column), root.at[:, k].set(column)

    return jax.lax.fori_loop(0, len(matrix), step, (matrix, jnp.zeros_like(matrix)))[1]
