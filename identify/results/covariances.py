"""Covariances of a result: finite, and positive semidefinite, or they are not told."""

from collections.abc import Iterator

import numpy as np

from identify.exceptions import RunError
from identify.results.identification_result import Identification
from identify.rigid_body.inertial_parameters import PARAMETERS

LEAST = -1e-6
"""Eigenvalue of a matrix of correlations below which it is none; rounding leaves some 1e-12."""


def check_covariances(result: Identification) -> None:
    """Refuse a result of which a covariance is none.

    Raises:
        RunError: one is not finite, or not positive semidefinite.
    """
    for what, names, covariance in _covariances(result):
        bad = [name for name, variance in zip(names, np.diag(covariance), strict=True) if not 0 <= variance < np.inf]
        if bad or not np.isfinite(covariance).all():
            raise RunError(
                f"the covariance of {what} is not finite ({', '.join(bad or names)}): check the declared "
                "uncertainties, or use the method source"
            )
        least = least_eigenvalue(covariance)
        if least < LEAST:
            raise RunError(
                f"the covariance of {what} is not positive semidefinite (eigenvalue {least:.2g}): check the declared "
                "uncertainties, or use the method source"
            )


def _covariances(result: Identification) -> Iterator[tuple[str, tuple[str, ...], np.ndarray]]:
    """Return title, names and covariance of each quantity, without components that are not determined."""
    ten = np.ones(10, bool)
    ten[0] = result.mass is not None
    ten[4:] = result.determined
    names = tuple(name for name, stated in zip(PARAMETERS, ten, strict=True) if stated)
    yield "mass, centre of gravity and tensor", names, result.parameters.covariance[np.ix_(ten, ten)]
    for what, aligned in (("delay", result.delay), ("rotation", result.rotation)):
        if aligned is not None:
            yield f"the {what}", (what,) * len(aligned.value), aligned.covariance
    for run in result.runs:
        if run.offsets is not None:
            yield f"the offsets of {run.file}", ("M1", "M2", "M3"), run.offsets.covariance


def least_eigenvalue(covariance: np.ndarray) -> float:
    """The least eigenvalue of the correlations; what is exact counts as uncorrelated, unless its row says otherwise."""
    u = np.sqrt(np.diag(covariance))
    if np.abs(covariance[u == 0]).max(initial=0.0) > 0:
        return -np.inf
    correlation = covariance[np.ix_(u > 0, u > 0)] / np.outer(u[u > 0], u[u > 0])
    return float(np.linalg.eigvalsh(correlation)[0]) if correlation.size else 0.0
