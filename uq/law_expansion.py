"""The law of propagation about the expected Gram sums: one case, one estimator, arrays in and out.

What is expanded is what every trial computes, :func:`identify.gram.with_offsets`, then ``normal_equations`` and
``solve_normal``: as a function of the constant offsets of omega, force, moment and r, and of the sums themselves. The
textbook's law expands the same function in the same errors about the noise-free sums, and stays with the first order.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from identify.gram import N_FEATURES, normal_equations, solve_normal, with_offsets
from uq.gram_moments import unpack
from uq.linear import expand, higher_order

OFFSETS = 12
"""Constant offsets: omega, force, moment, r_cg, three axes each."""
TRIANGLE = np.triu_indices(6)


class SumMoments(NamedTuple):
    """One estimator's sums under the gyro's white noise, packed (:mod:`uq.gram_moments`), as an expansion has them."""

    point: Float[Array, "*points s"]
    """Where the expansion is made."""
    change: Float[Array, "*points s"]
    """Their mean less that point."""
    covariance: Float[Array, "*points s s"]


class Errors(NamedTuple):
    """What else acts in one case."""

    wrench: Float[Array, "6"]
    """Variances of the white noise of force [N²] and moment [(N·m)²]."""
    offsets: Float[Array, "12 d"]
    """A root of the offsets' covariance: offsets are ``offsets @ z`` with independent standard normal z."""


class Propagated(NamedTuple):
    """What one case does to the estimate: mean error [kg·m²] and covariance [(kg·m²)²]."""

    mean_error: Float[Array, "6"]
    covariance: Float[Array, "6 6"]
    textbook_mean_error: Float[Array, "6"]
    """Second-order mean about the noise-free run, ``½ tr(H Σ)``, with the estimator's own error there."""
    textbook_covariance: Float[Array, "6 6"]
    """``J Σ Jᵀ`` about the noise-free run (GUM 5.1.2)."""


def estimate(sums: Float[Array, " s"], offsets: Float[Array, "12"], r_cg: Float[Array, "3"]) -> Float[Array, "6"]:
    """Return the tensor that a trial with these sums and offsets estimates."""
    return _solve(_equations(sums, offsets, r_cg))


def _equations(sums: Array, offsets: Array, r_cg: Array) -> Float[Array, "27"]:
    """The normal equations: the matrix's upper triangle, then the right-hand side."""
    omega, force, moment, r = offsets.reshape(4, 3)
    shifted = with_offsets(unpack(sums, N_FEATURES), omega, force, moment)
    matrix, right = normal_equations(shifted, r_cg + r)
    return jnp.concatenate([matrix[TRIANGLE], right])


def _solve(equations: Float[Array, "27"]) -> Float[Array, "6"]:
    upper = jnp.zeros((6, 6)).at[TRIANGLE].set(equations[:21])
    return solve_normal(upper + jnp.triu(upper, 1).T, equations[21:]).inertia


def propagate_case(sums: SumMoments, errors: Errors, r_cg: Float[Array, "3"], nominal: Float[Array, "6"]) -> Propagated:
    """Propagate one case.

    Args:
        sums: the sums under the case's gyro noise, about their mean and about the noise-free run, in this order.
        errors: the load cell's noise and the offsets.
        r_cg: the body's centre of gravity from Q [m].
        nominal: its tensor [kg·m²].

    Returns:
        Mean error and covariance, for normal errors: the offsets to the GUM's second order, the sums and their going
        together with the offsets to the second order.
    """
    about = jax.vmap(_about, (0, None, None))(sums, errors, r_cg)
    return Propagated(about.mean[0] - nominal, about.covariance[0], about.mean[1] - nominal, about.first_order[1])


class _About(NamedTuple):
    """The estimate's moments by an expansion about one point."""

    mean: Float[Array, "6"]
    first_order: Float[Array, "6 6"]
    covariance: Float[Array, "6 6"]


def _about(sums: SumMoments, errors: Errors, r_cg: Array) -> _About:
    def at(point, z):
        return estimate(point, errors.offsets @ z, r_cg)

    size = errors.offsets.shape[1]
    scatter = _with_wrench(sums, errors)
    offsets = expand(lambda z: at(sums.point, z), size)
    own = _of_sums(sums, scatter, r_cg)
    mixed = jax.jacfwd(lambda z: jax.jacrev(at)(sums.point, z))(jnp.zeros(size))
    crossed = jnp.einsum("asz,btz->ab", jnp.einsum("asz,st->atz", mixed, scatter), mixed)
    first = offsets.jacobian @ offsets.jacobian.T + own.first_order
    second = higher_order(offsets) + own.covariance - own.first_order + crossed
    return _About(offsets.value + offsets.shift + own.mean, first, first + second)


def _with_wrench(sums: SumMoments, errors: Errors) -> Float[Array, "s s"]:
    """The sums' covariance with the load cell's white noise: the features' Gram matrix times its variances."""
    gram = unpack(sums.point, N_FEATURES).gram
    first = len(sums.point) - 6 * N_FEATURES
    noise = jnp.einsum("km,ij->kimj", gram, jnp.diag(errors.wrench)).reshape(6 * N_FEATURES, 6 * N_FEATURES)
    return sums.covariance.at[first:, first:].add(noise)


def _of_sums(sums: SumMoments, scatter: Array, r_cg: Array) -> _About:
    """What the sums alone do, as a change of the estimate: through the normal equations, which are linear in them."""
    none = jnp.zeros(OFFSETS)
    equations = _equations(sums.point, none, r_cg)
    to_equations = jax.jacfwd(_equations)(sums.point, none, r_cg)
    scattered = to_equations @ scatter @ to_equations.T
    jacobian, hessian = jax.jacfwd(_solve)(equations), jax.jacfwd(jax.jacfwd(_solve))(equations)
    curved = jnp.einsum("aij,jk->aik", hessian, scattered)
    first = jacobian @ scattered @ jacobian.T
    second = 0.5 * jnp.einsum("aik,bki->ab", curved, curved)
    mean = jacobian @ (to_equations @ sums.change) + 0.5 * jnp.trace(curved, axis1=1, axis2=2)
    return _About(mean, first, first + second)
