"""Any rotation between load cell and IMU under which both obey mechanics, with its uncertainty; signs may be reversed.

A grid of all rotations is tried on the sums of a run for each handedness, and Newton's method goes on from the best.
"""

from dataclasses import dataclass
from itertools import product

import numpy as np
from jaxtyping import Float

from identify.judge.conventions.convention_fit import MOMENT_TERMS, Terms
from identify.judge.conventions.convention_sums import ConventionSums
from identify.judge.conventions.conventions import (
    COSTS,
    Hypothesis,
    Scales,
    chi_square,
    derivatives,
    nearest_minimum,
    scales,
    signed_axes,
)
from identify.rigid_body.rotation import exponential, rotation_vectors

BETWEEN = np.radians(35.0)
"""Angle from a signed order of the axes to the grid's points about it [rad].

Numerical: between neighbouring orders, which are 90° apart.
"""
STARTS = 4
"""Points of the grid from which Newton's method is tried.

Numerical: the best of them is the answer.
"""
AS_IT_IS = Hypothesis("imu", np.eye(3), 0.0)
REVERSED = (
    AS_IT_IS,
    Hypothesis("wrench", -np.eye(3), COSTS["reversed"]),
    Hypothesis("imu", -np.eye(3), COSTS["left-handed IMU"]),
)
"""Reversals that are tried before the rotation: nothing, the sign of the wrench, the handedness of the IMU."""


@dataclass(frozen=True, eq=False)
class FreeRotation:
    """The rotation that turns the IMU's axes into the load cell's."""

    matrix: Float[np.ndarray, "3 3"]
    reversed: Hypothesis
    """The reversal of signs that precedes the rotation."""
    covariance: Float[np.ndarray, "3 3"]
    """Covariance of a small rotation vector that follows the rotation [rad²]."""
    given: Scales
    """The units of chi-square: what is left under this rotation."""
    gain: float
    """Decrease of chi-square against the sums without the rotation."""

    @property
    def vector(self) -> Float[np.ndarray, "3"]:
        """The rotation vector [rad]."""
        return rotation_vectors(self.matrix[None])[0]

    @property
    def standard_uncertainty(self) -> float:
        """Standard uncertainty of the angle [rad]."""
        vector = self.vector
        axis = vector / max(float(np.linalg.norm(vector)), 1e-12)
        return float(np.sqrt(axis @ self.covariance @ axis))

    def applied(self, sums: ConventionSums) -> ConventionSums:
        """The sums as they would be."""
        return self.reversed.applied(sums).turned(imu=self.matrix)

    def nearest_axes(self) -> tuple[Float[np.ndarray, "3 3"], float]:
        """The signed order of axes, right-handed, that is nearest, and the angle to it [rad]."""
        proper = [matrix for matrix in signed_axes() if np.linalg.det(matrix) > 0]
        nearest = max(proper, key=lambda matrix: float(np.trace(matrix.T @ self.matrix)))
        return nearest, float(np.linalg.norm(rotation_vectors((nearest.T @ self.matrix)[None])))


def free_rotation(sums: ConventionSums, given: Scales, *, weight: bool, terms: Terms = MOMENT_TERMS) -> FreeRotation:
    """Return the rotation that fits best.

    Args:
        sums: of a run.
        given: scales from the best of the signed orders of the axes, which are too wide where none of them fits.
        weight: whether the mean force is the body's weight.
        terms: of the moment; fewer than in the grid's search tell the rotation better.
    """
    scored = []
    for reverse in REVERSED:
        fits = chi_square(reverse.applied(sums).turned(imu=GRID), given).tolist()
        scored += [(fit + reverse.cost, matrix, reverse) for fit, matrix in zip(fits, GRID, strict=True)]
    scored.sort(key=lambda item: item[0])
    polished = [
        (nearest_minimum(reverse.applied(sums), given, matrix), reverse) for _, matrix, reverse in scored[:STARTS]
    ]
    matrix, reverse = min(
        polished, key=lambda item: float(chi_square(item[1].applied(sums).turned(imu=item[0]), given)) + item[1].cost
    )
    reversed_sums = reverse.applied(sums)
    narrow = scales(reversed_sums.turned(imu=matrix), weight=weight, terms=terms, candidates=(AS_IT_IS,))
    matrix = nearest_minimum(reversed_sums, narrow, matrix)
    turned = reversed_sums.turned(imu=matrix)
    hessian = derivatives(turned, narrow)[1]
    values, vectors = np.linalg.eigh(hessian)
    covariance = 2 * vectors / np.maximum(values, 1e-9) @ vectors.T
    gain = float(chi_square(sums, narrow) - chi_square(turned, narrow)) - reverse.cost
    return FreeRotation(matrix=matrix, reversed=reverse, covariance=covariance, given=narrow, gain=gain)


def _grid() -> Float[np.ndarray, "n 3 3"]:
    """The 24 right-handed orders of the axes, and each turned about its faces' and corners' axes."""
    axes = [*np.eye(3), *-np.eye(3), *(np.array(signs) / np.sqrt(3) for signs in product((1.0, -1.0), repeat=3))]
    around = [np.eye(3), *(exponential(BETWEEN * axis) for axis in axes)]
    return np.array([turn @ matrix for matrix in signed_axes() if np.linalg.det(matrix) > 0 for turn in around])


GRID = _grid()
