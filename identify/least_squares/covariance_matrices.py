"""Roots of covariance matrices: changes by one standard uncertainty of independent numbers."""

import numpy as np
from jaxtyping import Float


def root_of(
    covariance: Float[np.ndarray, "n n"], of: Float[np.ndarray, "n n"] | None = None
) -> Float[np.ndarray, "n n"]:
    """Return a matrix whose product with its transpose is a covariance, zero columns where that is singular.

    Args:
        covariance: symmetric; its negative part, by rounding, is left out.
        of: covariance of which this is a part, in whose units rounding is judged; None: its own.
    """
    scale = np.sqrt(np.maximum(np.diag(covariance if of is None else of), 1e-300))
    values, vectors = np.linalg.eigh((covariance + covariance.T) / 2 / np.outer(scale, scale))
    return np.asarray(scale[:, None] * vectors * np.where(values > 1e-12, np.sqrt(np.maximum(values, 0)), 0.0))
