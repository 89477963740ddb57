"""Under which signs and orders of axes wrench and motion obey mechanics: 72 hypotheses on the sums of a run."""

from dataclasses import dataclass, field, replace
from itertools import permutations, product

import numpy as np

from rig.inspection import mechanics
from rig.inspection.features import FORCE, MOMENT, SPECIFIC, Array, Features
from rig.inspection.mechanics import FORCE_TERMS, MASS_AT, MOMENT_TERMS_WITH_WEIGHT


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A signed permutation of the axes of the ``sensor`` ('wrench' or 'imu') that undoes what was done to them."""

    sensor: str
    matrix: Array
    cost: float  # in chi-square, so that of equals the simplest wins

    def applied(self, features: Features) -> Features:
        """The features as they would be."""
        return features.turned(**{self.sensor: self.matrix})


def signed_axes() -> list[Array]:
    """The 48 signed permutation matrices."""
    found = []
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            matrix = np.zeros((3, 3))
            matrix[range(3), order] = signs
            found.append(matrix)
    return found


def hypotheses() -> list[Hypothesis]:
    """As it is; the wrench's sign reversed; turned; the wrench mirrored (or reversed and turned); the IMU mirrored."""
    found = []
    for matrix in signed_axes():
        proper = np.linalg.det(matrix) > 0
        cost = 8.0 if proper else 12.0
        if np.array_equal(np.abs(matrix), np.eye(3)) and abs(np.trace(matrix)) == 3:
            cost = 0.0 if proper else 4.0
        found.append(Hypothesis("wrench", matrix, cost))
        if not proper:
            found.append(Hypothesis("imu", matrix, 14.0))
    return sorted(found, key=lambda one: one.cost)


@dataclass(frozen=True, eq=False)
class Scales:
    """The units of chi-square: variances left in force and moment, priors of offset and lever; terms of the moment."""

    force: float
    moment: float
    offset: float
    lever: float
    terms: Array = field(default_factory=lambda: MOMENT_TERMS_WITH_WEIGHT)

    @property
    def priors(self) -> Array:
        """Of the unknowns of the force equation."""
        return np.array([np.inf, *[self.lever] * 3, *[self.offset] * 3])


LARGEST_LEVER = 0.5  # metres between IMU and centre of gravity, as a standard deviation
OFFSET = 0.1  # of the mean force that may be the load cell's zero, as a standard deviation


def scales(features: Features, *, weight: bool, terms: Array = MOMENT_TERMS_WITH_WEIGHT) -> Scales:
    """From the best that any hypothesis leaves; ``weight``: whether the mean force is the body's weight."""
    tried = [one.applied(features) for one in hypotheses()]
    force = min(mechanics.variance_left(one, FORCE_TERMS, FORCE) for one in tried)
    mean = float(np.linalg.norm(features.mean(FORCE)))
    mass = mean / max(float(np.linalg.norm(features.mean(SPECIFIC))), 1e-9)
    priors = (max(OFFSET * mean, features.noise[0] / 2), LARGEST_LEVER * mass) if weight else (np.inf, np.inf)
    given = Scales(force, np.inf, *priors, terms)
    quiet = [_fitted(one, given)[1] for one in tried]
    return replace(given, moment=min(mechanics.variance_left(one, terms, MOMENT) for one in quiet))


def _fitted(features: Features, given: Scales) -> tuple[mechanics.Fit, Features]:
    """The force's fit, and the features with the fitted force for the measured one, whose noise would mislead."""
    fit = mechanics.solve(features, FORCE_TERMS, FORCE, variance=given.force, priors=given.priors)
    change = np.eye(len(features.gram))
    change[FORCE] = np.einsum("p,pij->ij", fit.values, FORCE_TERMS)
    return fit, replace(features, gram=change @ features.gram @ change.T)


def chi_square(features: Features, given: Scales, *, admissible: bool = True) -> float:
    """How badly both equations fit; ``admissible``: with what mass and moments of inertia below zero cost."""
    force, quiet = _fitted(features, given)
    moment = mechanics.solve(quiet, given.terms, MOMENT, variance=given.moment)
    total = force.misfit + moment.misfit
    if not admissible:
        return total
    below = force.significance(MASS_AT) ** 2 if force.values[0] < 0 else 0.0
    return total + below + mechanics.negativity(moment)


DECISIVE = 60.0  # of chi-square, a likelihood of exp(30): no clean run comes near by chance
EQUAL = 12.0  # of chi-square: not told apart


def best_axes(features: Features, given: Scales) -> list[Hypothesis]:
    """The hypotheses that fit best and cannot be told apart, simplest first; the first is 'as it is' unless refuted."""
    scored = [(chi_square(one.applied(features), given) + one.cost, one) for one in hypotheses()]
    best = min(score for score, _ in scored)
    if scored[0][0] - best < DECISIVE:
        return [scored[0][1]]
    return [one for score, one in sorted(scored, key=lambda item: item[0]) if score < best + EQUAL]


def misalignment(features: Features, given: Scales) -> tuple[Array, float]:
    """The small rotation vector [rad] that turns the IMU's axes into the load cell's, and its chi-square (3 degrees).

    By Newton's method; zero where the sums do not determine it.
    """
    turn, hessian = np.zeros(3), np.eye(3)
    for _ in range(4):
        gradient, hessian = _derivatives(features, given, turn)
        if np.linalg.eigvalsh(hessian)[0] <= 0:
            return np.zeros(3), 0.0
        change = np.linalg.solve(hessian, gradient)
        turn = turn - change * min(1.0, 0.1 / float(np.linalg.norm(change)))
    turned = features.turned(imu=rotation(turn))
    gain = chi_square(features, given, admissible=False) - chi_square(turned, given, admissible=False)
    return (turn, min(gain, float(turn @ hessian @ turn) / 2)) if np.linalg.norm(turn) < 0.35 else (np.zeros(3), 0.0)


def _derivatives(features: Features, given: Scales, at: Array, step: float = 2e-3) -> tuple[Array, Array]:
    """Gradient and Hessian of chi-square by the rotation vector, by central differences."""

    def cost(delta: Array) -> float:
        return chi_square(features.turned(imu=rotation(at + delta)), given, admissible=False)

    unit = step * np.eye(3)
    values = {(i, j): cost(unit[i] + unit[j]) + cost(-unit[i] - unit[j]) for i in range(3) for j in range(i)}
    plus, minus, middle = [cost(one) for one in unit], [cost(-one) for one in unit], cost(np.zeros(3))
    gradient = (np.array(plus) - minus) / (2 * step)
    single = np.array(plus) + minus - 2 * middle
    hessian = np.diag(single)
    for (i, j), both in values.items():
        hessian[i, j] = hessian[j, i] = (both - 2 * middle - single[i] - single[j]) / 2
    return gradient, hessian / step**2


def rotation(vector: Array) -> Array:
    """The rotation matrix of a rotation vector [rad] (Rodrigues)."""
    angle = float(np.linalg.norm(vector))
    x, y, z = vector
    k = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    if angle < 1e-9:
        return np.eye(3) + k
    return np.eye(3) + np.sin(angle) / angle * k + (1 - np.cos(angle)) / angle**2 * k @ k


def as_axes(matrix: Array) -> str:
    """A signed permutation as ``"-y, z, x"``, any other matrix as rows of numbers with five decimals."""
    if np.allclose(np.abs(matrix).max(axis=1), 1, atol=1e-9):
        columns = np.abs(matrix).argmax(axis=1)
        return '"' + ", ".join(("-" if matrix[i, j] < 0 else "") + "xyz"[j] for i, j in enumerate(columns)) + '"'
    return "[" + ", ".join("[" + ", ".join(f"{x:.5f}" for x in row) + "]" for row in matrix) + "]"
