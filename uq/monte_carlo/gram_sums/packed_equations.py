"""Normal equations as 27 packed numbers, in NumPy: what they are made of, and the derivatives of their solution."""

import numpy as np
from jaxtyping import Float

from identify.least_squares.gram import CONDITION_LIMIT
from identify.rigid_body.regressor import ArrayT, cross_matrix, library_of
from uq.monte_carlo.gram_sums.case_equations import (
    AXES,
    LOWER6,
    LOWER9,
    NO_NOISE,
    OF_OMEGA_R,
    RIGHT_SIDE,
    WEIGHTS,
    NoiseExpectation,
)
from uq.monte_carlo.gram_sums.noise_algebra import NoiseAlgebra

MATRIX = np.zeros((27, 6, 6))
"""Derivative of the normal equations' matrix by their 27 packed numbers."""
MATRIX[np.arange(21), LOWER6[:, 0], LOWER6[:, 1]] = MATRIX[np.arange(21), LOWER6[:, 1], LOWER6[:, 0]] = 1.0
RIGHT = np.eye(6, 27, 21)
"""Derivative of the normal equations' right-hand side by their 27 packed numbers."""


def expected_by_axes(gram: Float[ArrayT, "*n 13 13"], noise: NoiseExpectation) -> Float[ArrayT, "*n 6 21"]:
    """Return :func:`uq.monte_carlo.gram_sums.case_equations.sums_by_axes` as expected under the gyro's noise.

    Any number of sums may lead.
    """
    lower = gram[..., 4 + LOWER9[:, 0], 4 + LOWER9[:, 1]] + gram[..., 0] @ noise.gram.T
    return (lower @ WEIGHTS.T).reshape(*gram.shape[:-2], len(AXES), 21)


def packed_equations(
    gram: Float[ArrayT, "*n 13 13"], moment: Float[ArrayT, "*n 13 3"], noise: NoiseExpectation
) -> Float[ArrayT, "*n 27"]:
    """Return the normal equations of mapped sums as expected under the gyro's noise: linear in the sums.

    Args:
        gram: sums of the features' products, any number of them on leading axes.
        moment: sums of the features with ``M - r × F``.
        noise: what the gyro's noise adds on the average.

    Returns:
        The normal matrix's lower triangle row by row, then the right side.
    """
    # ΩᵀΩ = Σ_a Ω_aᵀ Ω_a: the first three pairs are of an axis with itself. All below is linear in the sums, which lets
    # the law differentiate sums in place of equations
    matrix = expected_by_axes(gram, noise)[..., :3, :].sum(-2)
    right = moment[..., OF_OMEGA_R, :] + noise.feature[:, None] * moment[..., :1, :]
    right = right.reshape(*right.shape[:-2], 27) @ RIGHT_SIDE.T
    return library_of(matrix, right).concat([matrix, right], axis=-1)


def solution_series(
    equations: Float[np.ndarray, "27"],
) -> tuple[Float[np.ndarray, "6"], Float[np.ndarray, "6 27"], Float[np.ndarray, "6 27 27"]]:
    """Return ``x = A⁻¹ y``, its first and second derivatives by A's lower triangle and y.

    From ``A x = y``: ``x_i = A⁻¹ (y_i - A_i x)``, and once more ``x_ij = -A⁻¹ (A_i x_j + A_j x_i)``, since A and y are
    linear in the packed numbers. All are NaN where A is singular.
    """
    matrix = np.tensordot(equations, MATRIX, 1)
    regular = np.linalg.cond(matrix) < CONDITION_LIMIT
    inverse = np.linalg.inv(matrix) if regular else np.full((6, 6), np.nan)
    value = inverse @ equations[21:]
    first = inverse @ (RIGHT - (MATRIX @ value).T)
    # implicit differentiation, twice; A⁻¹ A_i x_j for all i, j at once, its transpose A⁻¹ A_j x_i
    crossed = (inverse @ MATRIX @ first).swapaxes(0, 1)
    return value, first, -crossed - crossed.swapaxes(1, 2)


def equations_of_products(
    algebra: NoiseAlgebra, estimator: int, r_cg: Float[np.ndarray, "3"]
) -> Float[np.ndarray, "27 products"]:
    """Return the matrix that gives an estimator's normal equations from the sums of ``algebra.products``.

    Args:
        algebra: of all estimators.
        estimator: its number.
        r_cg: believed centre of gravity from Q, in B [m].
    """
    # of a linear function, the images of unit vectors are the matrix's columns
    products = np.eye(len(algebra.products))
    moment = products[:, algebra.wrench[estimator]] @ about_cg(r_cg).T
    return packed_equations(products[:, algebra.gram[estimator]], moment, NO_NOISE).T


def about_cg(r_cg: Float[ArrayT, "3"]) -> Float[ArrayT, "3 6"]:
    """Return the matrix that gives ``M - r × F`` from force and moment."""
    return library_of(r_cg).concat([-cross_matrix(r_cg), np.eye(3)], axis=1)


def cell_scatter(
    by_axes: Float[np.ndarray, "... 6 21"], cell: Float[np.ndarray, "... 6 6"], r_cg: Float[np.ndarray, "3"]
) -> Float[np.ndarray, "... 27 27"]:
    """Return the covariance of the normal equations under the load cell's white noise, ``Σ Ωᵀ S Ω`` of the right side.

    S, the covariance of ``M - r × F`` at one sample, is the same at all: so six sums, one a pair of axes, are enough.
    The matrix ``ΩᵀΩ`` has no noise of the load cell.

    Args:
        by_axes: sums of the regressor's rows, pair by pair of axes
        (:func:`uq.monte_carlo.gram_sums.case_equations.sums_by_axes`).
        cell: covariance of force and moment at one sample; leading axes as those of ``by_axes`` broadcast.
        r_cg: believed centre of gravity from Q, in B [m].
    """
    to_moment = about_cg(r_cg)
    first, second = np.array(AXES).T
    residual = (to_moment @ cell @ to_moment.T)[..., first, second]
    right_side = np.tensordot((residual[..., None, :] @ by_axes)[..., 0, :], MATRIX[:21], 1)
    return np.asarray(RIGHT.T @ right_side @ RIGHT)
