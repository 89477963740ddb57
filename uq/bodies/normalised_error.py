"""The normalised error E_n of a tensor against an expected one, and the chi-squared of all its components together."""

import numpy as np
import scipy

from identify.rigid_body.inertial_parameters import Tensor

USUAL = 2.0
"""Coverage factor of expanded uncertainties."""


def normalised_error(measured: Tensor, expected: Tensor, factor: np.ndarray | float = USUAL) -> np.ndarray:
    """Return E_n of each component, ``d / √(U² + U_ref²)`` (ISO 13528:2022, 9.7); infinite if U is zero.

    Args:
        measured: a tensor.
        expected: what it should be, U_ref = 2 u; its errors are independent of the measurement's.
        factor: coverage factor of the measured one, U = k u.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        both = np.sqrt(factor**2 * np.diag(measured.covariance) + USUAL**2 * np.diag(expected.covariance))
        ratio = (measured.inertia - expected.inertia) / both
    return np.where(np.isnan(ratio), 0.0, ratio)


def joint_chi_squared(measured: Tensor, expected: Tensor) -> tuple[float, int, float]:
    """Return ``dᵀ (V + V_ref)⁻¹ d`` of all six components, its degrees of freedom and its probability (chi-squared).

    Directions in which neither is uncertain, and components that are not determined, are left out.
    """
    deviation, covariance = measured.inertia - expected.inertia, measured.covariance + expected.covariance
    scale = np.sqrt(np.diag(covariance))
    uncertain = (scale > 0) & np.isfinite(scale)
    if not uncertain.any():
        return 0.0, 0, 1.0
    correlation = covariance[np.ix_(uncertain, uncertain)] / np.outer(scale[uncertain], scale[uncertain])
    values, vectors = np.linalg.eigh(correlation)
    determined = values > 1e-10
    squares = (vectors.T @ (deviation[uncertain] / scale[uncertain]))[determined] ** 2 / values[determined]
    return float(squares.sum()), int(determined.sum()), float(scipy.special.chdtrc(determined.sum(), squares.sum()))
