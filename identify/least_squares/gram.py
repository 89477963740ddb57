"""Least squares from sums over samples: what a million rows leave behind is small.

``Omega_R`` is linear in the features of :mod:`identify.rigid_body.regressor`, so ``ΩᵀΩ`` and ``Ωᵀ(M - r × F)`` of (10)
follow from the sums of the features' products with themselves, with the force and with the moment. The sums add over
blocks, devices and recorded runs.
"""

from collections.abc import Sequence
from typing import Literal, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.typing import ArrayLike
from jaxtyping import Bool, Float

from identify.exceptions import explains_names
from identify.least_squares.run_lines import filtered
from identify.one_at_a_time import one_at_a_time
from identify.rigid_body.regressor import OMEGA_R_OF_FEATURES, Array
from identify.signals.estimator_spec import EstimatorSpec

N_FEATURES = len(OMEGA_R_OF_FEATURES)

_GRAM_TO_NORMAL = np.einsum("kji,lje->iekl", OMEGA_R_OF_FEATURES, OMEGA_R_OF_FEATURES)
CONDITION_LIMIT = 1e12
"""Condition number of the normal equations beyond which an estimate is reported as failed."""


class Sums(NamedTuple):
    """Sums over samples of products of the features. Add two of them to join their samples."""

    gram: Float[Array, "k k"]
    """Sum of products of the features with one another; entry [0, 0] is the number of samples."""
    force: Float[Array, "k 3"]
    """Sum of products of the features with the force [N]."""
    moment: Float[Array, "k 3"]
    """Sum of products of the features with the moment about Q [N·m]."""


class Estimate(NamedTuple):
    """A least-squares estimate of the tensor from sums."""

    inertia: Float[jax.Array, "6 *#trials"]
    """Packed tensor about the centre of gravity [kg·m²]; NaN where the normal equations cannot be solved."""
    condition: Float[jax.Array, "*#trials"]
    """Condition number of ``ΩᵀΩ`` in the Frobenius norm: at most six times the square of the regressor's own."""
    ok: Bool[jax.Array, "*#trials"]
    """Whether the estimate is finite and its condition number below ``CONDITION_LIMIT``."""


@explains_names
def ordinary_least_squares(
    force: ArrayLike,
    moment: ArrayLike,
    omega: ArrayLike,
    *,
    rate: float | int | jax.Array,
    r_cg: ArrayLike | Sequence[float],
    estimator: EstimatorSpec,
    offsets: Literal["estimate", "none"] = "estimate",
) -> Float[Array, "6"]:
    """Return the inertia tensor about the centre of gravity from samples, by ordinary least squares (10).

    A pure function of its arrays, for ``jax.jit``, ``jax.vmap`` and ``jax.jacobian``: the estimate of
    ``identify(run, method="source")`` without its uncertainty and its checks. It solves
    ``Omega_R(omega, alpha) @ inertia = M - r × F`` over all samples, ``alpha`` being the derivative of ``omega``.

    Args:
        force: force on the body at the load cell's centre Q, in the body frame B [N], shape (n, 3).
        moment: moment on the body about Q, in B [N·m], shape (n, 3).
        omega: angular velocity in B [rad/s], shape (n, 3), at the same instants.
        rate: sample rate [Hz]; a number, which JAX does not trace, for the differentiator is made from it.
        r_cg: centre of gravity from Q, in B [m], shape (3,).
        estimator: differentiator and filter.
        offsets: ``estimate`` a constant offset of force and moment along with the tensor, or ``none``.

    Returns:
        The packed tensor I11 I12 I13 I22 I23 I33 [kg·m²], shape (6,), in the precision of the signals; NaN where the
        motion does not determine it.

    Raises:
        ValueError: a wrong shape, too few samples for the estimator, a rate too low for its band, a traced rate,
            offsets that are neither.
        TypeError: a centre of gravity in words.
    """
    if isinstance(rate, jax.core.Tracer):
        raise ValueError("Argument `rate` must be a number that JAX does not trace: leave it out of jit's arguments.")
    if offsets not in ("estimate", "none"):
        raise ValueError(f"Argument `offsets` must be estimate or none, but is {offsets!r}.")
    signals = {"force": jnp.asarray(force), "moment": jnp.asarray(moment), "omega": jnp.asarray(omega)}
    dtype = np.result_type(*(signal.dtype for signal in signals.values()))
    dtype = dtype if jnp.issubdtype(dtype, jnp.floating) else jnp.result_type(float)
    signals = {name: signal.astype(dtype) for name, signal in signals.items()}
    if isinstance(r_cg, str):
        raise TypeError(f"Argument `r_cg` must be three numbers [m], but is {r_cg!r}.")
    centre = jnp.asarray(r_cg).astype(dtype)
    for name, signal in signals.items():
        if signal.shape != (*signals["omega"].shape[:1], 3):
            raise ValueError(f"Argument `{name}` must have shape (n, 3), n the same of all, but has {signal.shape}.")
    if centre.shape != (3,):
        raise ValueError(f"Argument `r_cg` must have shape (3,), but has {centre.shape}.")
    taps, smoothing = (h.astype(dtype) for h in (estimator.taps(float(rate)), estimator.filter_taps(float(rate))))

    def tensor(force: Array, moment: Array, omega: Array, centre: Array) -> Array:
        phi, forces, moments = filtered(omega.T, force.T, moment.T, taps, smoothing)
        if offsets == "estimate":
            phi, forces, moments = (rows - rows.mean(axis=1, keepdims=True) for rows in (phi, forces, moments))
        return solve(sums_of(phi, forces, moments), centre).inertia

    return one_at_a_time(tensor)(*signals.values(), centre)


def sums_of(phi: Float[Array, "k n"], force: Float[Array, "3 n"], moment: Float[Array, "3 n"]) -> Sums:
    """Return the sums of features (the thirteen, or those of several estimators) with themselves and the wrench."""
    return Sums(phi @ phi.T, phi @ force.T, phi @ moment.T)


def normal_equations(sums: Sums, r_cg: Float[Array, "3"]) -> tuple[Float[Array, "6 6"], Float[Array, "6"]]:
    """Return ``ΩᵀΩ`` and ``Ωᵀ(M - r × F)`` of (10)."""
    xp = sums.gram.__array_namespace__()
    matrix = xp.einsum("iekl,kl->ie", _GRAM_TO_NORMAL.astype(sums.gram.dtype), sums.gram)
    right = sums.moment - xp.cross(r_cg, sums.force)
    return matrix, xp.einsum("kji,kj->i", OMEGA_R_OF_FEATURES.astype(right.dtype), right)


def solve(sums: Sums, r_cg: Float[Array, "3"]) -> Estimate:
    """Return the ordinary least-squares tensor (10) from sums.

    Never raises, also inside a batch: what cannot be solved is NaN and ``ok`` is False.
    """
    return solve_normal(*normal_equations(sums, r_cg))


def solve_normal(matrix: Float[Array, "6 6 *#trials"], right: Float[Array, "6 *#trials"]) -> Estimate:
    """Return the tensor from its normal equations; what cannot be solved is NaN and ``ok`` is False.

    Equations of many trials may stand side by side on trailing axes, which fill a processor's vector units where LAPACK
    would take one small matrix after another, or be mapped over by ``jax.vmap``.
    """
    inverse = _inverse(matrix)
    inertia = _product(inverse, right[:, None])[:, 0]
    condition = jnp.sqrt(jnp.sum(matrix * matrix, axis=(0, 1)) * jnp.sum(inverse * inverse, axis=(0, 1)))
    ok = jnp.all(jnp.isfinite(inertia), axis=0) & (condition < CONDITION_LIMIT)
    return Estimate(jnp.where(ok, inertia, jnp.nan), condition, ok)


@jax.custom_jvp
def _inverse(matrix: Float[Array, "6 6 *trials"]) -> Float[Array, "6 6 *trials"]:
    """Return the inverse, NaN where a pivot is not positive: Gauss and Jordan's elimination, in place.

    Each step exchanges the first unknown for its equation's right side, and puts both last: after six steps all are in
    order again. Positive definite matrices need no other exchange of rows. With weights that are held fixed the matrix
    is only nearly symmetric, so that it has no root of Cholesky's.
    """
    for _ in range(len(matrix)):
        reciprocal = 1 / jnp.where(matrix[0, 0] > 0, matrix[0, 0], jnp.nan)[None]
        row, column = matrix[0, 1:] * reciprocal, -matrix[1:, 0] * reciprocal
        others = matrix[1:, 1:] - matrix[1:, :1] * row[None]
        matrix = jnp.concat([jnp.concat([others, column[:, None]], axis=1), jnp.concat([row, reciprocal])[None]])
    return matrix


@_inverse.defjvp
def _change_of_inverse(primals, tangents):
    """Derivatives of every order are products of the inverse, cheaper than those of the elimination."""
    inverse = _inverse(*primals)
    return inverse, -_product(_product(inverse, *tangents), inverse)


def _product(first: Float[Array, "i j *#trials"], second: Float[Array, "j k *#trials"]) -> Float[Array, "i k *#trials"]:
    return jnp.einsum("ij...,jk...->ik...", first, second)
