"""A rotation between load cell and IMU that is no order of the axes: when it is named, and in what words."""

import numpy as np
from jaxtyping import Float

from identify.judge.conventions import convention_fit
from identify.judge.conventions.convention_fit import FORCE_TERMS, MOMENT_TERMS, MOMENT_TERMS_WITH_WEIGHT, NOT_RIGID
from identify.judge.conventions.convention_sums import FORCE, MOMENT, ConventionSums
from identify.judge.conventions.conventions import DECISIVE, Scales, chi_square
from identify.judge.conventions.declared_rig import Matrix, Vector
from identify.judge.conventions.free_rotation import FreeRotation, free_rotation
from identify.judge.findings import Contradiction, Finding
from identify.rounding import fixed, with_uncertainty

LEAST_TURN = np.radians(0.5)
"""Smallest turn that is named [rad].

Choice: half a degree, as a mounting is by eye. In 40 clean runs at most 0.023 deg (``tests.helpers.judge_margins``).
"""
SMALL_TURN = np.radians(10.0)
"""Turn from the axes as they are up to which it is measured as a small one, after all else [rad].

Choice: within it, a linear correction converges.
"""
CERTAIN_SHIFT = 40.0
"""Chi-square, of three degrees of freedom, from which a turn or a shift is certain.

Chance: 1.1e-8. In 40 clean runs at most 0.3 (``tests.helpers.judge_margins``).
"""
WELL_EXPLAINED = 0.05
"""Part of the changes below which nothing is left that a rotation could explain.

Choice: a turn by ten degrees leaves up to 17 %.
"""
COVERAGE = 2.0
"""Coverage factor of the uncertainties that are printed.

Definition: 95 % of a normal distribution (JCGM 100:2008, G.6.6).
"""


def oblique_rotation(sums: ConventionSums, given: Scales, *, weighed: bool) -> FreeRotation | None:
    """Return the rotation under which a rigid body explains the run, where no signed order of the axes does.

    Args:
        sums: of the run.
        given: scales from the best of the signed orders of the axes.
        weighed: whether the mean force is the body's weight.
    """
    if _well_explained(sums):
        return None
    terms = MOMENT_TERMS if weighed else MOMENT_TERMS_WITH_WEIGHT
    free = free_rotation(sums, given, weight=weighed, terms=terms)
    explained = explains(sums, FORCE, free.given.force) and explains(sums, MOMENT, free.given.moment)
    if free.gain < DECISIVE or not explained:
        return None
    nearest, angle = free.nearest_axes()
    if np.array_equal(nearest, np.eye(3)):
        return free if angle > SMALL_TURN else None
    turned = chi_square(free.reversed.applied(sums).turned(imu=nearest), free.given)
    gain = turned - chi_square(free.applied(sums), free.given)
    return free if angle > LEAST_TURN and gain > CERTAIN_SHIFT else None


def explains(sums: ConventionSums, columns: slice, variance: float) -> bool:
    """Whether some rigid body, or white noise, explains force or moment: hands on the body are not judged."""
    return bool(variance < max(9 * _white(sums, columns), NOT_RIGID**2 * float(sums.changes(columns))))


def _well_explained(sums: ConventionSums) -> bool:
    fits = (
        (FORCE, convention_fit.variance_left(sums, FORCE_TERMS, FORCE)),
        (MOMENT, convention_fit.variance_left(sums, MOMENT_TERMS, MOMENT)),
    )
    return all(
        variance < 2 * _white(sums, columns) + WELL_EXPLAINED**2 * float(sums.changes(columns))
        for columns, variance in fits
    )


def _white(sums: ConventionSums, columns: slice) -> float:
    return float(sums.noise[columns.start // 3] ** 2 * sums.white)


def rotation_finding(rotation: FreeRotation, topic: str, cure: str) -> Contradiction:
    """Return the finding: angle with its 95 % uncertainty, axis, what is reversed, the cure."""
    vector = rotation.vector
    x, y, z = vector / max(float(np.linalg.norm(vector)), 1e-12)
    angle, u = np.degrees([float(np.linalg.norm(vector)), COVERAGE * rotation.standard_uncertainty])
    about = ", ".join(fixed(part, 2) for part in (x, y, z))
    turn = f"{with_uncertainty(angle, u)} deg about ({about})"
    if np.array_equal(rotation.reversed.matrix, np.eye(3)):
        return Finding.TURNED.on(topic, turn=turn, sign="", lines=cure)
    if rotation.reversed.sensor == "wrench":
        lines = f'wrench = "on_sensor" ("on_body" where it says so already) and {cure}'
        return Finding.TURNED.on(topic, turn=turn, sign=", and force and moment have the reversed sign", lines=lines)
    return Finding.IMU_MIRRORED_AND_TURNED.on(topic, turn=turn)


def small_turn_text(turn: Vector, hessian: Matrix) -> str:
    """Return a small rotation vector [rad] with its 95 % uncertainties, from the Hessian of chi-square there."""
    u = COVERAGE * np.sqrt(np.diag(2 * np.linalg.pinv(hessian, hermitian=True)).clip(0))
    parts = ", ".join(with_uncertainty(x, half) for x, half in np.degrees([turn, u]).T)
    return f"({parts}) deg about x, y, z"


def compound(matrix: Matrix, before: Matrix | None) -> Matrix:
    """Return a rotation after one that is declared already."""
    return matrix if before is None else matrix @ before


def axes_text(matrix: Float[np.ndarray, "n n"]) -> str:
    """Return a signed permutation as ``"-y, z, x"``, any other matrix as rows of numbers with five decimals."""
    if np.allclose(np.abs(matrix).max(axis=1), 1, atol=1e-9):
        columns = np.abs(matrix).argmax(axis=1)
        return '"' + ", ".join(("-" if matrix[i, j] < 0 else "") + "xyzw"[j] for i, j in enumerate(columns)) + '"'
    return "[" + ", ".join("[" + ", ".join(f"{x:.5f}" for x in row) + "]" for row in matrix) + "]"
