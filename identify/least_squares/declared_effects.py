"""Effects of declared constant errors of the rig on the residuals of a run's lines, to first order.

Gains, cross-talk and axes of the load cell mix the wrench's lines; scale and axes of the gyro those of the motion's
features; a delay adds the slope of the fitted moment.
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from identify.least_squares.run_lines import MOTION, OMEGA_R_OF_ACTING, RunLines
from identify.rigid_body.regressor import PAIRS, cross_matrix

PLACES = np.array([[0, 3, 4], [3, 1, 5], [4, 5, 2]])
"""Place of each product ``omega_i omega_j`` among the acting features, which begin with them."""


class DeclaredError(NamedTuple):
    """Change of one unknown by one standard uncertainty of an independent axis of declared errors."""

    unknown: str
    """Name of the unknown that it changes, as in :data:`identify.estimation.joint.joint_model.SIZES`."""
    numbers: Float[np.ndarray, " numbers"]


def residual_changes(
    record: RunLines,
    inertia: Float[np.ndarray, "6"],
    r_cg: Float[np.ndarray, "3"],
    errors: Sequence[Sequence[DeclaredError]],
) -> Float[np.ndarray, "m 3 q"]:
    """Return the change of all lines of ``M - r × F - Omega_R i`` by one standard uncertainty of some axes [N·m].

    Args:
        record: of a run.
        inertia: packed tensor [kg·m²].
        r_cg: centre of gravity [m].
        errors: what each axis changes; other unknowns than :data:`EFFECTS` leave no trace in these rows.
    """
    changes = np.zeros((len(record), 3, len(errors)))
    for number, parts in enumerate(errors):
        for error in parts:
            if error.unknown in EFFECTS:
                changes[:, :, number] += EFFECTS[error.unknown](record, inertia, r_cg, error.numbers)
    return changes


def _cell(record: RunLines, inertia: np.ndarray, r_cg: np.ndarray, numbers: np.ndarray) -> np.ndarray:
    force, moment = np.split(numbers.reshape(6, 6) @ record.signals_at(slice(None))[MOTION.stop :], 2)
    return moment.T - np.cross(r_cg, force.T)


def _gyro(record: RunLines, inertia: np.ndarray, matrix: np.ndarray) -> np.ndarray:
    motion = record.signals_at(slice(None))[MOTION]
    change = np.einsum("ij,jkm->ikm", matrix, motion[PLACES])
    features = np.stack([change[i, j] + change[j, i] for i, j in PAIRS])
    return -np.concatenate([features, matrix @ motion[len(PAIRS) :]]).T @ (OMEGA_R_OF_ACTING @ inertia)


def _late(record: RunLines, inertia: np.ndarray, r_cg: np.ndarray, numbers: np.ndarray) -> np.ndarray:
    moment = record.lines.samples(record.signals_at(slice(None))[MOTION].T @ (OMEGA_R_OF_ACTING @ inertia))
    slope = np.zeros_like(moment)
    for segment in record.lines.segments:
        slope[segment] = np.gradient(moment[segment], 1 / record.run.rate, axis=0)
    return record.lines.transform(numbers[0] * slope)


EFFECTS: dict[str, Callable[[RunLines, np.ndarray, np.ndarray, np.ndarray], Float[np.ndarray, "m 3"]]] = {
    "cell_matrix": _cell,
    "gyro_scale": lambda record, inertia, r_cg, numbers: _gyro(record, inertia, np.diag(numbers)),
    "rotation": lambda record, inertia, r_cg, numbers: _gyro(record, inertia, -cross_matrix(numbers)),
    "delay": _late,
}
"""Effect of each unknown's error."""
