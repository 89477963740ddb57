"""Newton's and Euler's equations as least squares on the sums of a run (:mod:`rig.inspection.features`).

With the wrench (F, M) on the body at Q, specific force f and angular velocity ω at the IMU, all in one frame,

    F = m f + α × b + ω × (ω × b) + F0                b = m (r_CG − r_IMU)
    M = r × F + q × f + I α + ω × I ω + M0            q: only where weight is missing in F but not in M

Each is linear in its unknowns; a fit says what is left, and how surely each unknown is known.
"""

from dataclasses import dataclass

import numpy as np

from rig.inspection.features import (
    ALPHA,
    FORCE,
    GRAVITY,
    MOMENT,
    ONE,
    PRODUCTS,
    SPECIFIC,
    SQUARES,
    WIDTH,
    Array,
    Features,
)

LEAST_MISFIT = 0.01  # of a signal's changes: no sensor is believed to be better


@dataclass(frozen=True, eq=False)
class Fit:
    """The unknowns of an equation, their covariance, and chi-square: left over, weighted, with what the priors cost."""

    values: Array
    covariance: Array
    misfit: float

    def significance(self, which: slice) -> float:
        """How many standard deviations some unknowns are from zero (as a length)."""
        part, spread = self.values[which], self.covariance[which, which]
        return float(np.sqrt(part @ np.linalg.solve(spread, part)))


def _cross() -> Array:
    """The tensor e with (a × b)_i = Σ e_ijk a_j b_k."""
    e = np.zeros((3, 3, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        e[i, j, k], e[i, k, j] = 1.0, -1.0
    return e


CROSS = _cross()


def _crossed_with(which: slice) -> Array:
    """The columns of p × (features), p the unknowns: (3, 3, 22)."""
    columns = np.zeros((3, 3, WIDTH))
    columns[:, :, which] = CROSS.transpose(1, 0, 2)
    return columns


def _ones() -> Array:
    columns = np.zeros((3, 3, WIDTH))
    columns[range(3), range(3), ONE] = 1.0
    return columns


def _times(which: slice) -> Array:
    columns = np.zeros((1, 3, WIDTH))
    columns[0, :, which] = np.eye(3)
    return columns


def _product(i: int, j: int) -> int:
    return SQUARES.start + PRODUCTS.index((min(i, j), max(i, j)))


def _lever() -> Array:
    """The columns of α × b + ω × (ω × b) = α × b + (ω ωᵀ − ω² 1) b."""
    columns = np.zeros((3, 3, WIDTH))
    columns[:, :, ALPHA] = -CROSS.transpose(1, 0, 2)
    for k in range(3):
        for i in range(3):
            columns[k, i, _product(i, k)] += 1.0
        for j in range(3):
            columns[k, k, _product(j, j)] -= 1.0
    return columns


def _inertia() -> Array:
    """The columns of I α + ω × I ω over I11 I22 I33 I12 I13 I23."""
    columns = np.zeros((6, 3, WIDTH))
    for n, (i, j) in enumerate(PRODUCTS):
        unit = np.zeros((3, 3))
        unit[i, j] = unit[j, i] = 1.0
        columns[n, :, ALPHA] += unit
        for a in range(3):
            for b in range(3):
                for c in range(3):
                    for d in range(3):
                        columns[n, a, _product(b, d)] += CROSS[a, b, c] * unit[c, d]
    return columns


WEIGHT, LEVER, OFFSET, INERTIA = _times(SPECIFIC), _lever(), _ones(), _inertia()
MOTION = _times(SPECIFIC) - _times(GRAVITY)
ARM, COUNTERWEIGHT = _crossed_with(FORCE), _crossed_with(SPECIFIC)
FORCE_TERMS = np.concatenate([WEIGHT, LEVER, OFFSET])
MASS_AT, LEVER_AT, OFFSET_AT = slice(0, 1), slice(1, 4), slice(4, 7)
ARM_AT, INERTIA_AT = slice(0, 3), slice(3, 9)
MOMENT_TERMS = np.concatenate([ARM, INERTIA, OFFSET])
MOMENT_TERMS_WITH_WEIGHT = np.concatenate([MOMENT_TERMS, COUNTERWEIGHT])


def solve(features: Features, terms: Array, answer: slice, *, variance: float, priors: Array | None = None) -> Fit:
    """Fit ``answer`` (force or moment) by ``terms`` (p, 3, 22), each sample's components of this variance.

    ``priors`` (p,): standard deviation about zero of each unknown, inf where none is stated.
    """
    left = terms @ features.gram
    normal = np.einsum("pij,qij->pq", left, terms)
    right = np.einsum("pij,ij->p", left[:, :, answer], np.eye(3))
    total = float(np.trace(features.gram[answer, answer]))
    n, weight = features.instants, 1 / variance
    loose = np.full(len(terms), np.inf) if priors is None else priors
    scale = np.sqrt(np.maximum(np.diag(normal), 1e-300))
    matrix = n * weight * normal + np.diag(1 / loose**2)
    matrix += np.diag(1e-10 * n * weight * scale**2 + 1e-30)
    values = np.linalg.solve(matrix, n * weight * right)
    misfit = n * weight * (total - 2 * right @ values + values @ normal @ values) + ((values / loose) ** 2).sum()
    return Fit(values, np.linalg.inv(matrix), float(misfit))


def variance_left(features: Features, terms: Array, answer: slice) -> float:
    """Variance per component that a fit leaves [unit²], at least ``LEAST_MISFIT`` of its changes, squared."""
    changes = float(np.trace(features.covariance(answer))) / 3
    left = solve(features, terms, answer, variance=1.0).misfit / (3 * features.instants)
    free = max(1 - len(terms) / (3 * features.instants), 0.1)
    return max(left / free, LEAST_MISFIT**2 * changes, 1e-18)


def tensor(values: Array) -> Array:
    """The 3 × 3 matrix of I11 I22 I33 I12 I13 I23."""
    matrix = np.zeros((3, 3))
    for (i, j), value in zip(PRODUCTS, values, strict=True):
        matrix[i, j] = matrix[j, i] = value
    return matrix


def negativity(fit: Fit, inertia: slice = INERTIA_AT) -> float:
    """What it costs in chi-square to make a tensor that has a negative moment one that has not."""
    moments, axes = np.linalg.eigh(tensor(fit.values[inertia]))
    cost = 0.0
    for moment, axis in zip(moments, axes.T, strict=True):
        if moment < 0:
            form = np.array([axis[i] * axis[j] * (1 if i == j else 2) for i, j in PRODUCTS])
            cost = max(cost, moment**2 / float(form @ fit.covariance[inertia, inertia] @ form))
    return cost


@dataclass(frozen=True, eq=False)
class Arm:
    """The centre of gravity from the point where the moment is taken, by r × F.

    ``r`` [m], its covariance [m²], and the projector onto the directions along which it is not known.
    """

    r: Array
    covariance: Array
    blind: Array


LEAST_SIGNAL = 0.5  # part of the force's changes that must be more than its noise, for a direction of r to count


def arm(features: Features, *, force: Array, moment: float, offset: float) -> Arm:
    """Fit the moment by r × F, I α + ω × I ω and an offset with a prior; the noise in F taken out of the sums.

    ``force``: variance of the noise left in F, by axis [N²]; ``moment``: of that in M [(N·m)²]; ``offset``: prior
    [N·m]. Directions of r that only noise, or a change like that of the motion's own moment tells of come back with a
    variance of 1 m².
    """
    n = features.instants
    left = MOMENT_TERMS @ features.gram
    normal = np.einsum("pij,qij->pq", left, MOMENT_TERMS)
    right = np.einsum("pij,ij->p", left[:, :, MOMENT], np.eye(3))
    others = normal[3:, 3:] + np.diag([1e-12 * normal[3:9, 3:9].trace()] * 6 + [moment / n / offset**2] * 3)
    carried = np.linalg.solve(others, np.column_stack([normal[3:, :3], right[3:]]))
    seen = normal[:3, :3] - normal[:3, 3:] @ carried[:, :3]
    answer = right[:3] - normal[:3, 3:] @ carried[:, 3]
    noise = force.sum() * np.eye(3) - np.diag(force)
    scale = np.linalg.cholesky(seen + 1e-12 * seen.trace() * np.eye(3))
    whitened = np.linalg.solve(scale, np.linalg.solve(scale, noise).T)
    share, axes = np.linalg.eigh(np.eye(3) - whitened)
    basis = np.linalg.solve(scale.T, axes)
    known = share > LEAST_SIGNAL
    r = basis[:, known] @ ((basis[:, known].T @ answer) / share[known])
    spread = (moment + float(r @ noise @ r)) / n
    covariance = basis[:, known] * (spread / share[known] ** 2) @ basis[:, known].T
    blind = np.eye(3)
    if known.any():
        directions = np.linalg.qr(scale @ axes[:, known])[0]
        blind = blind - directions @ directions.T
    return Arm(r, covariance + blind, blind)


def force_noise(features: Features) -> Array:
    """The variance that the best fit leaves in the force, by axis [N²]."""
    fit = solve(features, FORCE_TERMS, FORCE, variance=1.0)
    rows = np.einsum("p,pij->ij", fit.values, FORCE_TERMS)
    rows[:, FORCE] -= np.eye(3)
    return np.maximum(np.einsum("ij,jk,ik->i", rows, features.gram, rows), 0.0)
