"""The law of propagation about expected sums: one run, one estimator, arrays in and out.

What is expanded is what every trial computes: errors become maps of the sums (:mod:`uq.gram_sums.error_maps`), the sums
become normal equations, and these are solved (:mod:`identify.estimators.gram`). Constant errors enter through the maps;
white noise through the mean and covariance of the sums (:mod:`uq.gram_sums.gram_moments`).
"""

from collections.abc import Collection
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.linalg import block_diag
from jaxtyping import Array, Float

from identify.estimators.gram import N_FEATURES, Sums, normal_equations, solve_normal
from identify.pytree import Pytree, static_field
from identify.rigid_body.inertia import Body
from uq.gram_sums.error_maps import Columns, Platform, element_map
from uq.gram_sums.gram_moments import GramMoments, unpack
from uq.sources.constant_errors import Errors, no_errors
from uq.sources.random_normals import Index

OF_NOISE = (0, 1, 2, 3, 10)
"""Indices of the true elements that multiply the noise in other elements: 1, omega and t."""
TRIANGLE = np.triu_indices(6)
MATRIX = np.zeros((27, 6, 6))
"""Derivative of the normal equations' matrix by their 27 packed numbers."""
MATRIX[np.arange(21), TRIANGLE[0], TRIANGLE[1]] = MATRIX[np.arange(21), TRIANGLE[1], TRIANGLE[0]] = 1.0
RIGHT = np.eye(6, 27, 21)
"""Derivative of the normal equations' right-hand side by their 27 packed numbers."""


class TrueSums(NamedTuple):
    """Sums over the elements of ``true_elements`` and every estimator's alpha, without noise."""

    gram: Float[Array, "elements elements"]
    wrench: Float[Array, "elements columns"]
    """Sums of products of the elements with the columns of :class:`uq.gram_sums.error_maps.Columns`."""

    def of_estimator(self, estimator: Index) -> "TrueSums":
        """Return those of one estimator."""
        index = jnp.concatenate([jnp.arange(15), 15 + 3 * jnp.asarray(estimator) + jnp.arange(3)])
        return TrueSums(self.gram[index[:, None], index], self.wrench[index])


class NoiseFreeRun(Pytree):
    """Sums over one run without noise: all that the effect of constant errors of any size depends on."""

    body: Body
    platform: Platform
    sums: tuple[TrueSums, TrueSums, TrueSums]
    """Sums, and their first and second derivatives by a delay of the gyro [1/s, 1/s²]."""
    columns: Columns = static_field()


class RunSums(Pytree):
    """Sums over one run: all that the law depends on, whatever the size of the errors."""

    noise_free: NoiseFreeRun
    moments: GramMoments


class Point(NamedTuple):
    """The point of an expansion."""

    errors: Float[Array | np.ndarray, " e"]
    """Errors that are expected, :class:`uq.sources.constant_errors.Errors` raveled."""
    variance: Float[Array | np.ndarray, "3"]
    """Variance of omega's white noise [rad²/s²] whose expected sums these are; zero for the noise-free run."""


class Expansion(NamedTuple):
    """The estimate about a point; of several estimators and cases, these lead."""

    value: Float[Array | np.ndarray, "*n 6"]
    jacobian: Float[Array | np.ndarray, "*n 6 d"]
    """Derivative of the tensor by the numbers that constant sources draw, in SI."""
    hessian: Float[Array | np.ndarray, "*n 6 d d"]
    by_equations: Float[Array | np.ndarray, "*n 6 27"]
    """Derivative of the tensor by the normal equations: the matrix's upper triangle, then the right-hand side."""
    twice_by_equations: Float[Array | np.ndarray, "*n 6 27 27"]


def expand_at(
    run: RunSums, estimator: Index, point: Point, errors: Float[Array, "e d"], fields: Collection[str]
) -> Expansion:
    """Expand one estimator's estimate about a point, to the second order.

    Args:
        run: its sums and their moments.
        estimator: its number.
        point: expected errors and noise.
        errors: how they follow from the d numbers that are drawn.
        fields: those of the errors that may not be zero; of the others nothing is computed.
    """

    def equations(z):
        of_alpha = run.moments.alphas[estimator, estimator]
        acting = point.errors + errors @ z
        return equations_of(run.noise_free, estimator, acting, point.variance, of_alpha, fields=fields)

    def first(z):
        jacobian = jax.jacfwd(equations)(z)
        return jacobian, jacobian

    zero = jnp.zeros(errors.shape[1])
    second, slopes = jax.jacfwd(first, has_aux=True)(zero)
    solution = equations(zero)
    by_equations, twice = _of_solution(solution)
    hessian = jnp.einsum("ak,kij->aij", by_equations, second) + jnp.einsum("ki,akl,lj->aij", slopes, twice, slopes)
    return Expansion(tensor_of(solution), by_equations @ slopes, hessian, by_equations, twice)


def _of_solution(equations: Float[Array, "27"]) -> tuple[Float[Array, "6 27"], Float[Array, "6 27 27"]]:
    """First and second derivatives of ``x = A⁻¹ y`` by A's upper triangle and y: ``dx = A⁻¹ (dy - dA x)``."""
    matrix = _matrix_of(equations)
    inverse = jnp.linalg.inv(matrix)
    first = inverse @ (RIGHT - jnp.einsum("kij,j->ik", MATRIX, inverse @ equations[21:]))
    crossed = jnp.einsum("ai,kij,jl->akl", inverse, MATRIX, first)
    return first, -crossed - crossed.swapaxes(1, 2)


def _matrix_of(equations: Array) -> Float[Array, "6 6"]:
    upper = jnp.zeros((6, 6)).at[TRIANGLE].set(equations[:21])
    return upper + jnp.triu(upper, 1).T


def tensor_of(equations: Float[Array, "27"]) -> Float[Array, "6"]:
    """Return the estimate from packed normal equations."""
    return solve_normal(_matrix_of(equations), equations[21:]).inertia


def _packed(sums: Sums, r_cg: Array) -> Float[Array, "27"]:
    matrix, right = normal_equations(sums, r_cg)
    return jnp.concatenate([matrix[TRIANGLE], right])


def equations_of(
    run: NoiseFreeRun,
    estimator: Index,
    errors: Float[Array, " e"],
    variance: Float[Array | np.ndarray, "3"],
    of_alpha: Float[Array, ""],
    *,
    fields: Collection[str] = Errors._fields,
) -> Float[Array, "27"]:
    """Return the packed normal equations of a run with these errors, made of its expected sums under the noise.

    Args:
        run: without noise.
        estimator: its number.
        errors: :class:`uq.sources.constant_errors.Errors` raveled.
        variance: of omega's white noise [rad²/s²].
        of_alpha: variance of alpha's noise for noise of omega of unit variance [1/s²].
        fields: those of the errors that may not be zero.
    """
    each = unravel(errors)
    present = no_errors()._replace(**{field: getattr(each, field) for field in fields})
    delay = present.gyro_delay
    delayed = jax.tree.map(lambda a, b, c: a + delay * b + 0.5 * delay**2 * c, *run.sums)
    expected = expected_sums(delayed.of_estimator(estimator), variance, of_alpha)
    elements = element_map(present, gyro_mapped=True)
    measured = expected.wrench @ run.columns.map(run.body, run.platform, present).T
    measured = measured + expected.gram[:, :1] * present.cell_bias[None]
    sums = Sums(elements @ expected.gram @ elements.T, elements @ measured[:, :3], elements @ measured[:, 3:])
    return _packed(sums, run.body.r_cg_from_q + present.r_cg)


def unravel(errors: Float[Array | np.ndarray, " e"]) -> Errors:
    """Return errors from all their numbers in one array, of JAX or of NumPy."""
    like = no_errors()
    parts = zip(like, np.cumsum([each.size for each in like]).tolist(), strict=True)
    return Errors(*(errors[end - each.size : end].reshape(each.shape) for each, end in parts))


def expected_sums(true: TrueSums, variance: Float[Array | np.ndarray, "3"], of_alpha: Float[Array, ""]) -> TrueSums:
    """Return the expected sums over all elements of :func:`uq.gram_sums.error_maps.element_map`.

    Args:
        true: one estimator's noise-free sums.
        variance: of omega's white noise [rad²/s²].
        of_alpha: variance of alpha's noise for noise of omega of unit variance [1/s²].
    """
    squares = jnp.concatenate([variance, jnp.zeros(3)])
    linear = jnp.kron(true.gram[np.ix_(OF_NOISE, OF_NOISE)], jnp.diag(variance))
    v1, v2, v3 = variance
    fourth = jnp.outer(squares, squares) + jnp.diag(
        jnp.stack([2 * v1 * v1, 2 * v2 * v2, 2 * v3 * v3, v1 * v2, v1 * v3, v2 * v3])
    )
    count = true.gram[0, 0]
    noise = block_diag(linear, count * fourth, count * of_alpha * jnp.diag(variance))
    mean = jnp.concatenate([jnp.zeros(15), squares, jnp.zeros(3)])
    crossed = jnp.outer(mean, true.gram[0])
    gram = jnp.block([[true.gram, crossed.T], [crossed, noise]])
    return TrueSums(gram, jnp.concatenate([true.wrench, jnp.outer(mean, true.wrench[0])]))


def to_equations(r_cg: Float[Array, "3"]) -> Float[Array, "27 products"]:
    """Return the matrix that takes an estimator's sums (as ``gram_moments.pack``) to normal equations."""
    size = N_FEATURES * (N_FEATURES + 1) // 2 + 6 * N_FEATURES
    return jax.jacfwd(lambda sums: _packed(unpack(sums, N_FEATURES), r_cg))(jnp.zeros(size))


def of_wrench_noise(
    sums: Float[np.ndarray, "... products"],
    covariance: Float[np.ndarray, "... 6 6"],
    equations: Float[np.ndarray, "27 products"],
) -> Float[np.ndarray, "... 27 27"]:
    """Return the covariance of the normal equations under the load cell's white noise: features' Gram times its own."""
    row, column = np.triu_indices(N_FEATURES)
    gram = np.zeros((*sums.shape[:-1], N_FEATURES, N_FEATURES))
    gram[..., row, column] = gram[..., column, row] = sums[..., : len(row)]
    by_wrench = equations[:, -6 * N_FEATURES :].reshape(-1, N_FEATURES, 6)
    left, right = gram[..., None, :, :] @ by_wrench, by_wrench @ covariance[..., None, :, :]
    return _flat(left) @ _flat(right).swapaxes(-1, -2)


def _flat(stack: np.ndarray) -> np.ndarray:
    return stack.reshape(*stack.shape[:-2], -1)


class Moments(NamedTuple):
    """The estimate's moments by an expansion."""

    mean: Float[np.ndarray, "... 6"]
    first_order: Float[np.ndarray, "... 6 6"]
    covariance: Float[np.ndarray, "... 6 6"]


def propagate_case(
    expansion: Expansion,
    covariance: Float[np.ndarray, "... d d"],
    scatter: Float[np.ndarray, "... 27 27"],
    change: Float[np.ndarray, "... 27"] | None = None,
) -> Moments:
    """Return mean and covariance of estimates for normal errors, in NumPy: nothing waits for a compiler.

    Args:
        expansion: about the errors' and sums' expectations, one for each of n cases.
        covariance: of the numbers that act; zero rows for those that do not.
        scatter: covariance of the normal equations under white noise.
        change: mean of the normal equations less those of the point; None: none.

    Returns:
        The mean with ``½ tr(H Σ)``; the covariance ``J Σ Jᵀ`` and that with ``½ tr(H Σ H Σ)`` (GUM 5.1.2), in the
        constant errors and in the sums. Products of a constant error's and the noise's effects are left out: relative
        to the noise's own they are of the square of the constant error's relative size.
    """
    mean, first, second = np.asarray(expansion.value), np.zeros(()), np.zeros(())
    _, *derivatives = map(np.asarray, expansion)
    for jacobian, hessian, sigma in zip(derivatives[::2], derivatives[1::2], (covariance, scatter), strict=True):
        curved = hessian @ sigma[..., None, :, :]
        mean = mean + 0.5 * np.trace(curved, axis1=-2, axis2=-1)
        first = first + jacobian @ sigma @ jacobian.swapaxes(-1, -2)
        second = second + 0.5 * _flat(curved) @ _flat(curved.swapaxes(-1, -2)).swapaxes(-1, -2)
    if change is not None:
        mean = mean + (derivatives[2] @ change[..., None])[..., 0]
    return Moments(mean, first, first + second)
