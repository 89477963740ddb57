"""Normal equations of rows that have several axes: their products, solutions, and the unknowns that runs share."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float


def products(left: Float[np.ndarray, "m rows p"], right: Float[np.ndarray, "m rows q"]) -> Float[np.ndarray, "p q"]:
    """Return the sums of products of columns over all lines and rows, (p, q)."""
    count = left.shape[0] * left.shape[1]  # stated, since a shape of -1 knows no columns of none
    return np.asarray(left.reshape(count, left.shape[2]).T @ right.reshape(count, right.shape[2]))


def solution(normal: Float[np.ndarray, "p p"], right: Float[np.ndarray, "p *k"]) -> Float[np.ndarray, "p *k"]:
    """Return the solution of normal equations, of least norm where they are singular."""
    scale = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    scaled = np.linalg.lstsq(normal / np.outer(scale, scale), (right.T / scale).T, rcond=1e-13)[0]
    return np.asarray((scaled.T / scale).T)


def inverse(normal: Float[np.ndarray, "p p"]) -> Float[np.ndarray, "p p"]:
    """Return the inverse of a normal matrix, its pseudo-inverse where it is singular."""
    scale = 1 / np.sqrt(np.maximum(np.diag(normal), 1e-300))
    return np.linalg.pinv(normal * np.outer(scale, scale), rcond=1e-13, hermitian=True) * np.outer(scale, scale)


class SharedEquations(NamedTuple):
    """A run's normal equations of the unknowns that runs share, and how its others follow from these.

    The others are ``by_right + by_shared @ shared``.
    """

    matrix: Float[np.ndarray, "s s"]
    right: Float[np.ndarray, "s k"]
    by_right: Float[np.ndarray, "others k"]
    by_shared: Float[np.ndarray, "others s"]
    covariance: Float[np.ndarray, "others others"]
    """Covariance of the others, given the shared ones."""


def eliminated(
    normal: Float[np.ndarray, "p p"], right: Float[np.ndarray, "p k"], shared: Bool[np.ndarray, " p"]
) -> SharedEquations:
    """Return a run's equations of the shared unknowns: the Schur complement of the others."""
    covariance = inverse(normal[np.ix_(~shared, ~shared)])
    cross = normal[np.ix_(shared, ~shared)]
    by_right, by_shared = covariance @ right[~shared], -covariance @ cross.T
    return SharedEquations(
        matrix=normal[np.ix_(shared, shared)] + cross @ by_shared, right=right[shared] - cross @ by_right,
        by_right=by_right, by_shared=by_shared, covariance=covariance,
    )  # fmt: skip
