"""Any rotation between load cell and IMU under which both obey mechanics, with its uncertainty; signs may be reversed.

A grid of all rotations is tried on the sums of a run for each handedness, and Newton's method goes on from the best.
One that is no order of the axes is named in words, with its cure.
"""

import functools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np
from jaxtyping import Float

from identify.display.rounding import fixed, with_uncertainty
from identify.judge.conventions import convention_fit
from identify.judge.conventions.axis_hypotheses import (
    COSTS,
    DECISIVE,
    EQUAL,
    Hypothesis,
    Scales,
    chi_square,
    derivatives,
    nearest_minimum,
    scales,
    signed_axes,
)
from identify.judge.conventions.convention_fit import (
    FORCE,
    FORCE_TERMS,
    INERTIA_AT,
    MOMENT,
    MOMENT_TERMS,
    MOMENT_TERMS_WITH_WEIGHT,
    NOT_RIGID,
    WIDTH,
    ConventionSums,
    Matrix,
    Terms,
    Vector,
)
from identify.rigid_body.regressor import cross_matrix
from identify.rigid_body.rotation import exponential, rotation_vectors

Packed = Float[np.ndarray, "6"]
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


def free_rotation(
    sums: ConventionSums,
    given: Scales,
    *,
    weight: bool,
    terms: Terms,
    reversals: Sequence[Hypothesis] = REVERSED,
) -> FreeRotation:
    """Return the rotation that fits best.

    Args:
        sums: of a run.
        given: scales from the best of the signed orders of the axes, which are too wide where none of them fits.
        weight: whether the mean force is the body's weight.
        terms: of the moment; fewer than in the grid's search tell the rotation better.
        reversals: tried before the rotation.
    """
    scored = []
    for reverse in reversals:
        fits = chi_square(reverse.applied(sums).turned(imu=grid()), given).tolist()
        scored += [(fit + reverse.cost, matrix, reverse) for fit, matrix in zip(fits, grid(), strict=True)]
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


@functools.cache
def grid() -> Float[np.ndarray, "n 3 3"]:
    """Return the 24 right-handed orders of the axes, and each turned about its faces' and corners' axes."""
    axes = [*np.eye(3), *-np.eye(3), *(np.array(signs) / np.sqrt(3) for signs in product((1.0, -1.0), repeat=3))]
    around = [np.eye(3), *(exponential(BETWEEN * axis) for axis in axes)]
    return np.array([turn @ matrix for matrix in signed_axes() if np.linalg.det(matrix) > 0 for turn in around])


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
    if well_explained(sums):
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


def other_sign(sums: ConventionSums, rotation: FreeRotation) -> FreeRotation | None:
    """Return the rotation of static poses with the other sign of the wrench, if it fits as well."""
    others = [reverse for reverse in REVERSED[:2] if reverse is not rotation.reversed]
    other = free_rotation(sums, rotation.given, weight=False, terms=MOMENT_TERMS_WITH_WEIGHT, reversals=others)
    fits = [float(chi_square(turn.applied(sums), rotation.given)) + turn.reversed.cost for turn in (other, rotation)]
    return other if fits[0] < fits[1] + EQUAL else None


def explains(sums: ConventionSums, columns: slice, variance: float) -> bool:
    """Whether some rigid body, or white noise, explains force or moment: hands on the body are not judged."""
    return bool(variance < max(9 * _white(sums, columns), NOT_RIGID**2 * float(sums.changes(columns))))


def well_explained(sums: ConventionSums, within: float = WELL_EXPLAINED) -> bool:
    """Return whether a rigid body on this motion leaves at most white noise and a part of force and moment.

    Args:
        sums: of the run.
        within: the part of their changes.
    """
    fits = (
        (FORCE, convention_fit.variance_left(sums, FORCE_TERMS, FORCE)),
        (MOMENT, convention_fit.variance_left(sums, MOMENT_TERMS, MOMENT)),
    )
    return all(
        variance < 2 * _white(sums, columns) + within**2 * float(sums.changes(columns)) for columns, variance in fits
    )


def _white(sums: ConventionSums, columns: slice) -> float:
    return float(sums.noise[columns.start // 3] ** 2 * sums.white)


def turn_text(vector: Vector, u: float) -> str:
    """Return a rotation vector [rad] as angle, with its 95 % uncertainty, and axis.

    Args:
        vector: the rotation vector [rad].
        u: standard uncertainty of the angle [rad].
    """
    size = float(np.linalg.norm(vector))
    about = ", ".join(fixed(part, 2) for part in vector / max(size, 1e-12))
    return f"{with_uncertainty(*np.degrees([size, COVERAGE * u]))} deg about ({about})"


def small_turn_text(turn: Vector, covariance: Matrix) -> str:
    """Return a small rotation vector [rad] with its 95 % uncertainties, from its covariance."""
    u = COVERAGE * np.sqrt(np.diag(covariance))
    parts = ", ".join(with_uncertainty(x, half) for x, half in np.degrees([turn, u]).T)
    return f"({parts}) deg about x, y, z"


def tensor_about_centre(sums: ConventionSums, r_cg: Vector | None) -> Packed:
    """Return the packed tensor that the moment shows, by least squares [kg·m²].

    Args:
        sums: of a run.
        r_cg: centre of gravity from the point where the moment is taken [m]; None: the moment tells it, too.
    """
    if r_cg is None:
        return convention_fit.solve(sums, MOMENT_TERMS, MOMENT, variance=1.0).values[INERTIA_AT]
    about = np.eye(WIDTH)
    about[MOMENT, FORCE] = -cross_matrix(r_cg)
    moved = replace(sums, gram=about @ sums.gram @ about.T)
    return convention_fit.solve(moved, MOMENT_TERMS[INERTIA_AT.start :], MOMENT, variance=1.0).values[:6]
