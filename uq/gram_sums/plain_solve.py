"""Roots and solutions of six equations in plain arithmetic: thousands of trials go through vector units at once.

Why it stands beside :func:`identify.estimators.gram.solve_normal`: see :mod:`uq.gram_sums.sum_equations`.

A symmetric matrix is the entries of its lower triangle, each an array over trials (or one figure that all share).
"""

from collections.abc import Iterable, Sequence

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from identify.estimators.gram import CONDITION_LIMIT

SIZE = 6
LOWER = [(i, j) for i in range(SIZE) for j in range(i + 1)]
"""Places of the lower triangle."""

Trials = Float[Array, "..."]
Vector = Sequence[Trials] | Array
"""Components first."""
Lower = dict[tuple[int, int], Trials]


def total(terms: Iterable[Trials]) -> Trials:
    """Return the sum of at least one array; shapes broadcast."""
    first, *rest = terms
    for term in rest:
        first = first + term
    return first


def triangular_root(matrix: Lower) -> tuple[Lower, list[Trials], Bool[Array, "..."]]:
    """Return the root L of ``L Lᵀ`` (Cholesky), the reciprocals of its diagonal, and whether all pivots are positive.

    A column whose pivot is not is zero, so that a covariance that is zero in some direction has its root.
    """
    lower: Lower = {}
    inverse, definite = [], []
    for j in range(SIZE):
        pivot = total([matrix[j, j], *(-lower[j, k] * lower[j, k] for k in range(j))])
        positive = pivot > 0
        scale = jnp.where(positive, jax.lax.rsqrt(jnp.where(positive, pivot, 1.0)), 0.0)
        lower[j, j] = pivot * scale
        for i in range(j + 1, SIZE):
            lower[i, j] = total([matrix[i, j], *(-lower[i, k] * lower[j, k] for k in range(j))]) * scale
        inverse.append(scale)
        definite.append(positive)
    ok = definite[0]
    for positive in definite[1:]:
        ok = ok & positive
    return lower, inverse, ok


def times_root(matrix: Lower, noise: Vector) -> list[Trials]:
    """Return a normal vector of this covariance from six standard normal numbers."""
    lower, _, _ = triangular_root(matrix)
    return [total(lower[i, k] * noise[k] for k in range(i + 1)) for i in range(SIZE)]


def solve(matrix: Lower, right: Vector) -> tuple[list[Trials], Bool[Array, "..."]]:
    """Solve positive definite equations; the second result is that of :func:`identify.estimators.gram.solve_normal`.

    Returns:
        The six unknowns (any figures where they cannot be solved), and whether the matrix is definite with a condition
        number in the Frobenius norm below ``CONDITION_LIMIT``.
    """
    lower, scale, definite = triangular_root(matrix)
    root: Lower = {}  # inverse of the root
    for j in range(SIZE):
        root[j, j] = scale[j]
        for i in range(j + 1, SIZE):
            root[i, j] = -total(lower[i, k] * root[k, j] for k in range(j, i)) * scale[i]
    half = [total(root[i, k] * right[k] for k in range(i + 1)) for i in range(SIZE)]
    solution = [total(root[i, k] * half[i] for i in range(k, SIZE)) for k in range(SIZE)]
    inverse = {(i, j): total(root[k, i] * root[k, j] for k in range(i, SIZE)) for i, j in LOWER}
    return solution, definite & (_square_norm(matrix) * _square_norm(inverse) < CONDITION_LIMIT**2)


def _square_norm(matrix: Lower) -> Trials:
    return total(matrix[i, j] * matrix[i, j] * (1.0 if i == j else 2.0) for i, j in LOWER)
