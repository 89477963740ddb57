"""Signs and orders of axes under which wrench and motion obey mechanics: 72 hypotheses on the sums of a run."""

import functools
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import permutations, product

import numpy as np
from jaxtyping import Float

from identify.judge.conventions import convention_fit
from identify.judge.conventions.convention_fit import (
    FORCE,
    FORCE_TERMS,
    GRAVITY,
    MASS_AT,
    MOMENT,
    MOMENT_TERMS_WITH_WEIGHT,
    SPECIFIC,
    ConventionSums,
    Terms,
)
from identify.rigid_body.rotation import exponential, rotation_vectors

COSTS = {
    "reversed": 4.0, "accelerometer reversed": 6.0, "turned": 8.0, "turned and reversed": 12.0, "left-handed IMU": 14.0,
}  # fmt: skip
"""Chi-square that a hypothesis must gain before it counts as equally good.

Choice: the order alone counts, the likelier mistake first; all are far below ``DECISIVE``.
"""


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A signed permutation of the axes of the ``sensor`` ('wrench' or 'imu') that undoes what was done to them."""

    sensor: str
    matrix: Float[np.ndarray, "3 3"]
    cost: float
    """Penalty added to chi-square, so that the simplest of equally good hypotheses wins."""
    accelerometer: float = 1.0
    """Sign of the specific force: -1 where the accelerometer reads downwards at rest, or force and moment differ."""

    def applied(self, sums: ConventionSums) -> ConventionSums:
        """The sums as they would be."""
        turned = sums.turned(**{self.sensor: self.matrix})
        return turned if self.accelerometer > 0 else turned.scaled(slice(SPECIFIC.start, GRAVITY.stop), -1.0)


def signed_axes() -> list[Float[np.ndarray, "3 3"]]:
    """The 48 signed permutation matrices."""
    rows = [np.eye(3)[list(order)] for order in permutations(range(3))]
    return [np.array(signs)[:, None] * matrix for matrix in rows for signs in product((1.0, -1.0), repeat=3)]


@functools.cache
def hypotheses() -> tuple[Hypothesis, ...]:
    """Return the hypotheses: none; the wrench's sign reversed, turned or mirrored; the IMU mirrored."""
    candidates = []
    for matrix in signed_axes():
        proper = np.linalg.det(matrix) > 0
        cost = COSTS["turned"] if proper else COSTS["turned and reversed"]
        if abs(np.trace(matrix)) == 3:
            cost = 0.0 if proper else COSTS["reversed"]
        candidates.append(Hypothesis("wrench", matrix, cost))
        if not proper:
            candidates.append(Hypothesis("imu", matrix, COSTS["left-handed IMU"]))
    return tuple(sorted(candidates, key=lambda hypothesis: hypothesis.cost))


@dataclass(frozen=True, eq=False)
class Scales:
    """The units of chi-square: variances left in force and moment, priors of offset and lever; terms of the moment."""

    force: float
    moment: float
    offset: float
    lever: float
    terms: Terms

    @property
    def priors(self) -> Float[np.ndarray, "7"]:
        """Return the priors of the unknowns of the force equation."""
        return np.array([np.inf, *[self.lever] * 3, *[self.offset] * 3])


LARGEST_LEVER = 0.5
"""Distance between any two of Q, IMU and centre of gravity, as a standard deviation [m].

Prior: wider than the bodies of a bench.
"""
OFFSET = 0.1
"""Part of the force that may be the load cell's zero, as a standard deviation.

Prior: our choice, wide, so that a zero of the load cell is no evidence of anything else.
"""


def scales(
    sums: ConventionSums,
    *,
    weight: bool,
    terms: Terms = MOMENT_TERMS_WITH_WEIGHT,
    candidates: Sequence[Hypothesis] | None = None,
) -> Scales:
    """Return the scales by the best fit of any hypothesis; ``weight``: whether the mean force is the weight."""
    tried = ConventionSums.stacked([hypothesis.applied(sums) for hypothesis in candidates or hypotheses()])
    force = convention_fit.variance_left(tried, FORCE_TERMS, FORCE)
    size = sums.size(FORCE)
    mass = size / max(sums.size(SPECIFIC), 1e-9)
    priors = (max(OFFSET * size, sums.noise[0] / 2), LARGEST_LEVER * mass) if weight else (np.inf, np.inf)
    given = Scales(force, np.inf, *priors, terms)
    return replace(given, moment=convention_fit.variance_left(_fitted_force(tried, given)[1], terms, MOMENT))


def _fitted_force(sums: ConventionSums, given: Scales) -> tuple[convention_fit.ConventionFit, ConventionSums]:
    """The force's fit, and the sums with the fitted force for the measured one, whose noise would mislead."""
    fit = convention_fit.solve(sums, FORCE_TERMS, FORCE, variance=given.force, priors=given.priors)
    change = np.broadcast_to(np.eye(sums.gram.shape[-1]), sums.gram.shape).copy()
    change[..., FORCE, :] = np.tensordot(fit.values, FORCE_TERMS, axes=1)
    return fit, replace(sums, gram=change @ sums.gram @ np.swapaxes(change, -1, -2))


def chi_square(sums: ConventionSums, given: Scales, *, admissible: bool = True) -> Float[np.ndarray, "*m"]:
    """Return the misfit of both equations; ``admissible``: with a cost of negative mass and moments of inertia."""
    force, quiet = _fitted_force(sums, given)
    moment = convention_fit.solve(quiet, given.terms, MOMENT, variance=given.moment)
    total = force.misfit + moment.misfit
    if not admissible:
        return np.asarray(total)
    below = np.where(force.values[..., 0] < 0, force.significance(MASS_AT) ** 2, 0.0)
    return np.asarray(total + below + convention_fit.negativity(moment))


DECISIVE = 60.0
"""Chi-square by which another hypothesis must be better: a likelihood of exp(30).

Chance: 1e-13 in favour of any of 71 others. In 40 clean runs any other is worse by 1.8e5
(``tests.helpers.judge_margins``).
"""
LARGEST_SMALL_TURN = 0.35
"""Turn up to which Newton's method from no turn is believed [rad].

Choice: 20°, twice what is named as a small turn.
"""
EQUAL = 12.0
"""Chi-square within which hypotheses are not told apart.

Chance: a likelihood of exp(6), one in 400.
"""


@functools.cache
def with_accelerometer_reversed() -> tuple[Hypothesis, ...]:
    """Return the hypotheses, each with the accelerometer as it is and with its other sign."""
    more = COSTS["accelerometer reversed"]
    other = [replace(hypothesis, cost=hypothesis.cost + more, accelerometer=-1.0) for hypothesis in hypotheses()]
    return (*hypotheses(), *other)


def best_axes(sums: ConventionSums, given: Scales, *, at_rest: bool = False) -> list[Hypothesis]:
    """The hypotheses that fit best and cannot be told apart, simplest first; the first is 'as it is' unless refuted.

    ``at_rest``: of static poses, where the accelerometer's sign and that of the wrench do the same.
    """
    candidates = hypotheses() if at_rest else with_accelerometer_reversed()
    tried = ConventionSums.stacked([hypothesis.applied(sums) for hypothesis in candidates])
    fits = chi_square(tried, given).tolist()
    scored = [(fit + hypothesis.cost, hypothesis) for fit, hypothesis in zip(fits, candidates, strict=True)]
    best = min(score for score, _ in scored)
    if scored[0][0] - best < DECISIVE:
        return [scored[0][1]]
    return [hypothesis for score, hypothesis in sorted(scored, key=lambda item: item[0]) if score < best + EQUAL]


CONVERGED = 1e-5
"""Step of Newton's method that is the last [rad].

Numerical: far below a printed digit.
"""
LONGEST_STEP = 0.3
"""Longest step of Newton's method [rad].

Numerical: it stays within the region of one point of the grid.
"""


def nearest_minimum(sums: ConventionSums, given: Scales, matrix: np.ndarray) -> np.ndarray:
    """The rotation of least chi-square near a first one, by Newton's method, downhill where it is not convex."""
    objective = float(chi_square(sums.turned(imu=matrix), given, admissible=False))
    for _ in range(15):
        gradient, hessian = derivatives(sums.turned(imu=matrix), given)
        values, vectors = np.linalg.eigh(hessian)
        change = -vectors @ ((vectors.T @ gradient) / np.maximum(np.abs(values), 1e-6 * np.abs(values).max() + 1e-12))
        change *= min(1.0, LONGEST_STEP / max(float(np.linalg.norm(change)), 1e-12))
        for _ in range(5):
            candidate = exponential(change) @ matrix
            new = float(chi_square(sums.turned(imu=candidate), given, admissible=False))
            if new < objective:
                break
            change = change / 2
        else:
            break
        matrix, objective = candidate, new
        if float(np.linalg.norm(change)) < CONVERGED:
            break
    return matrix


def misalignment(sums: ConventionSums, given: Scales) -> tuple[Float[np.ndarray, "3"], float, Float[np.ndarray, "3 3"]]:
    """Return the small rotation vector [rad] that turns the IMU's axes into the load cell's.

    With its chi-square (3 degrees) and covariance; zero where the sums do not determine it.
    """
    turn = rotation_vectors(nearest_minimum(sums, given, np.eye(3))[None])[0]
    turned = sums.turned(imu=exponential(turn))
    covariance = 2 * np.linalg.pinv(derivatives(turned, given)[1], hermitian=True)
    if np.linalg.eigvalsh(covariance)[0] <= 0 or np.linalg.norm(turn) >= LARGEST_SMALL_TURN:
        return np.zeros(3), 0.0, covariance
    gain = float(chi_square(sums, given, admissible=False) - chi_square(turned, given, admissible=False))
    return turn, min(gain, float(turn @ np.linalg.solve(covariance, turn))), covariance


DIFFERENCE = 2e-3
"""Turn between the points of a difference [rad].

Numerical: over it chi-square is nearly a parabola.
"""


def derivatives(sums: ConventionSums, given: Scales) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3 3"]]:
    """Gradient and Hessian of chi-square by the rotation vector, by central differences."""
    unit, pairs, step = np.eye(3), [(i, j) for i in range(3) for j in range(i)], DIFFERENCE
    turns = np.array([np.zeros(3), *unit, *(unit[i] + unit[j] for i, j in pairs)])
    both_ways = sums.turned(imu=exponential(step * np.concatenate([turns, -turns])))
    forth, back = chi_square(both_ways, given, admissible=False).reshape(2, -1)
    plus, minus, middle = forth[1:4], back[1:4], forth[0]
    single = plus + minus - 2 * middle
    hessian = np.diag(single)
    for (i, j), both in zip(pairs, forth[4:] + back[4:], strict=True):
        hessian[i, j] = hessian[j, i] = (both - 2 * middle - single[i] - single[j]) / 2
    return (plus - minus) / (2 * step), hessian / step**2
