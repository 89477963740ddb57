"""Least squares on explicit rows, with covariance, condition number, residuals; and what a motion cannot identify.

Rows come three to a sample, one an axis: ``rows`` (n, 3, p), ``values`` (n, 3). The sums of
:mod:`identify.estimators.gram` give the same ordinary estimate for millions of samples; this is its reference, by QR.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from identify.rigid_body.inertia import COMPONENTS


class Solution(NamedTuple):
    """A least-squares estimate."""

    value: Float[Array, " p"]
    """The estimated unknowns."""
    covariance: Float[Array, "p p"]
    """Covariance of ``value``: from the residuals' variance (ordinary), or from the stated errors (weighted,
    generalised)."""
    residuals: Float[Array, "n 3"]
    """Values minus fit, in the values' unit."""
    condition: Float[Array, ""]
    """Condition number of the (whitened) rows in the spectral norm."""


def ordinary(rows: Float[Array, "n 3 p"], values: Float[Array, "n 3"]) -> Solution:
    """Return the ordinary least-squares estimate (10); its covariance assumes white residuals of one variance."""
    value, unscaled, condition = _qr(rows.reshape(-1, rows.shape[2]), values.reshape(-1))
    residuals = values - rows @ value
    variance = jnp.sum(residuals**2) / (values.size - rows.shape[2])
    return Solution(value, variance * unscaled, residuals, condition)


def weighted(
    rows: Float[Array, "n 3 p"], values: Float[Array, "n 3"], standard_uncertainty: Float[Array, "*n 3"]
) -> Solution:
    """Return the least-squares estimate weighted by each axis's (or each sample's) standard uncertainty."""
    scale = jnp.broadcast_to(1 / standard_uncertainty, values.shape)
    value, covariance, condition = _qr(
        (rows * scale[:, :, None]).reshape(-1, rows.shape[2]), (values * scale).reshape(-1)
    )
    return Solution(value, covariance, values - rows @ value, condition)


def generalised(
    rows: Float[Array, "n 3 p"], values: Float[Array, "n 3"], covariance: Float[Array, "*n 3 3"]
) -> Solution:
    """Return the generalised (Gauss–Markov) estimate for errors correlated across the axes of a sample.

    ``covariance`` [unit of the values, squared] is one matrix for all samples or one for each; samples are independent.
    """
    lower = jnp.broadcast_to(jnp.linalg.cholesky(covariance), (*values.shape, 3))
    whiten = jax.vmap(lambda factor, right: jax.scipy.linalg.solve_triangular(factor, right, lower=True))
    white_rows, white_values = whiten(lower, rows), whiten(lower, values)
    value, spread, condition = _qr(white_rows.reshape(-1, rows.shape[2]), white_values.reshape(-1))
    return Solution(value, spread, values - rows @ value, condition)


def _qr(rows, values):
    q, upper = jnp.linalg.qr(rows)
    inverse = jax.scipy.linalg.solve_triangular(upper, jnp.eye(rows.shape[1], dtype=rows.dtype))
    singular = jnp.linalg.svd(upper, compute_uv=False)
    return inverse @ (q.T @ values), inverse @ inverse.T, singular[0] / singular[-1]


Matrix = Float[Array, "6 6"] | Float[np.ndarray, "6 6"]


class Excitation(NamedTuple):
    """The motion's information on the six components: the verdict on identifiability."""

    strength: np.ndarray
    """Eigenvalues of ``ΩᵀΩ``, ascending [s⁻⁴ times the number of samples]."""
    directions: np.ndarray
    """Unit eigenvectors of ``ΩᵀΩ`` in the space of packed tensors, one a row."""
    noise: np.ndarray
    """Expected part of each eigenvalue that the gyro's noise alone contributes."""
    identifiable: np.ndarray
    """Mask of the directions that stand out from noise and rounding."""

    @property
    def unidentifiable(self) -> tuple[str, ...]:
        """Names of the components that lie, for the greater part, in directions that the motion does not excite."""
        blind = self.directions[~self.identifiable]
        return tuple(name for name, share in zip(COMPONENTS, (blind**2).sum(axis=0), strict=True) if share > 0.4)

    @property
    def blind_direction(self) -> str:
        """The least excited direction in words, such as ``0.58 I11 +0.58 I22 +0.58 I33``."""
        shares = zip(COMPONENTS, self.directions[0], strict=True)
        return " ".join(f"{share:+.2g} {name}" for name, share in shares if abs(share) > 0.1).removeprefix("+")


def excitation(normal: Matrix, noise: Matrix) -> Excitation:
    """Judge which directions of the tensor a motion excites.

    A direction counts as identifiable when its strength is at least ten times what the gyro's noise contributes (less
    would dilute the estimate by more than a tenth) and above 1e-9 of the strongest.

    Args:
        normal: ``ΩᵀΩ``.
        noise: the expected contribution of the gyro's noise to it; zeros when there is none.
    """
    strength, vectors = np.linalg.eigh(np.asarray(normal, float))
    directions = vectors.T
    noise_strength = np.einsum("ki,ij,kj->k", directions, np.asarray(noise, float), directions)
    identifiable = (strength > 10 * noise_strength) & (strength > 1e-9 * strength[-1])
    return Excitation(strength, directions, noise_strength, identifiable)
