"""Check of the axes that give the poses' attitude against the load cell's, by its forces alone."""

from typing import NamedTuple

import numpy as np
import scipy
from jaxtyping import Float

from identify.display.rounding import with_uncertainty
from identify.rigid_body.regressor import cross_matrices
from identify.rigid_body.rotation import exponential, rotation_vectors

LEAST_POSES = 6
LEAST_TURN = np.radians(0.5)
"""A smaller turn [rad] is what sensors are mounted to."""
CHANCE = 1e-6
"""Chance of a false alarm."""
ROUNDING = 1e-6
"""Relative rounding error of the forces, below which a residual says nothing."""


class Turn(NamedTuple):
    """The rotation vector from the attitude's axes into the load cell's, with its standard uncertainty [rad]."""

    vector: Float[np.ndarray, "3"]
    standard_uncertainty: Float[np.ndarray, "3"]

    @property
    def matrix(self) -> Float[np.ndarray, "3 3"]:
        """Matrix of the rotation."""
        return exponential(self.vector)

    def __str__(self) -> str:
        pairs = zip(np.degrees(self.vector), np.degrees(self.standard_uncertainty), strict=True)
        return f"({', '.join(with_uncertainty(float(x), float(u)) for x, u in pairs)}) deg"


def attitude_turn(
    force: Float[np.ndarray, "n 3"], specific_force: Float[np.ndarray, "n 3"],
    further: Float[np.ndarray, "n 3 c"] | None = None,
) -> Turn | None:  # fmt: skip
    """Return the turn R of ``F = m R f + F0``, fitted by least squares; None where the poses do not show one.

    They show it where the fit without it has residuals larger than chance makes them (F test).

    Args:
        force: mean force on the body of each pose [N].
        specific_force: its specific force by the sensor of the attitude, in the same axes as declared [m/s²].
        further: further columns of the force, such as those of a drift; None: none.
    """
    count, offset = len(force), np.tile(np.eye(3), (len(force), 1))
    if further is not None:
        acting = further.any(axis=(0, 1))
        offset = np.column_stack([offset, further[:, :, acting].reshape(3 * count, -1)])
    freedom = 3 * count - 4 - offset.shape[1]
    if count < LEAST_POSES:
        return None
    plain = np.column_stack([specific_force.reshape(-1), offset])
    before = _square(plain, force)
    turn = np.eye(3)
    for _ in range(5):  # each step turns by what the one before left
        turned = specific_force @ turn.T
        rows = np.column_stack([turned.reshape(-1), -cross_matrices(turned).reshape(-1, 3), offset])
        if freedom < 1 or np.linalg.matrix_rank(rows) < rows.shape[1]:
            return None
        fitted = np.linalg.lstsq(rows, force.reshape(-1), rcond=None)[0]
        turn = exponential(fitted[1:4] / fitted[0]) @ turn
    variance = (_square(rows, force) + ROUNDING**2 * float(np.square(force).sum())) / freedom
    spread = np.sqrt(variance * np.diag(np.linalg.inv(rows.T @ rows))[1:4]) / abs(fitted[0])
    shown = scipy.special.fdtrc(3, freedom, (before - _square(rows, force)) / 3 / variance) < CHANCE
    vector = rotation_vectors(turn[None])[0]
    return Turn(vector, spread) if shown and np.linalg.norm(vector) > LEAST_TURN else None


def _square(rows: np.ndarray, force: np.ndarray) -> float:
    """Sum of squares of what least squares leaves."""
    fitted = np.linalg.lstsq(rows, force.reshape(-1), rcond=None)[0]
    return float(np.square(force.reshape(-1) - rows @ fitted).sum())
