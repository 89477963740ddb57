"""Newton's and Euler's equations as least squares on the sums of a run.

:mod:`identify.judge.conventions.convention_sums` has these sums.
With the wrench (F, M) on the body at Q, specific force f and angular velocity ω at the IMU, all in one frame,

    F = m f + α × b + ω × (ω × b) + F0                b = m (r_CG − r_IMU)
    M = r × F + q × f + I α + ω × I ω + M0            q: only where weight is missing in F but not in M

whose columns are those of the regressor. Each is linear in its unknowns; a fit has them with covariance and misfit.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from identify.judge.conventions.convention_sums import (
    CONSTANT,
    FORCE,
    GRAVITY,
    MOMENT,
    MOTION,
    SPECIFIC,
    WIDTH,
    ConventionSums,
)
from identify.rigid_body.inertia import unpack
from identify.rigid_body.regressor import FIRST_MOMENT_OF_FEATURES, OMEGA_R_OF_FEATURES, PI_OF_FORCE

LEAST_MISFIT = 0.01
"""Part of a signal's changes that a fit leaves at least.

Choice: no sensor is believed to be better than 1 %.
"""
NOT_RIGID = 0.15
"""Part of force's or moment's changes above which what is left over is due to no rigid body.

Choice: hands on the body are not judged. In 40 clean runs 0.01, the least that a fit may leave
(``tests.helpers.judge_margins``).
"""
ROWS, COLUMNS = np.triu_indices(3)
UNPACKED = unpack(np.arange(6.0)).astype(int)  # where the entries of a tensor stand among its packed ones

Terms = Float[np.ndarray, "p 3 25"]
"""Coefficients of the three components of an equation in p unknowns, over the columns of the sums."""


def _terms(columns: slice, table: Float[np.ndarray, "k 3 p"]) -> Terms:
    """The terms of p unknowns from a table over some of the columns."""
    terms = np.zeros((table.shape[2], 3, WIDTH))
    terms[:, :, columns] = table.transpose(2, 1, 0)
    return terms


WEIGHT = _terms(SPECIFIC, np.eye(3)[:, :, None])
ACCELERATION = WEIGHT - _terms(GRAVITY, np.eye(3)[:, :, None])
LEVER = _terms(MOTION, FIRST_MOMENT_OF_FEATURES)
OFFSET = _terms(slice(CONSTANT, CONSTANT + 1), np.eye(3)[None])
ARM, COUNTERWEIGHT = _terms(FORCE, PI_OF_FORCE), _terms(SPECIFIC, PI_OF_FORCE)
INERTIA = _terms(MOTION, OMEGA_R_OF_FEATURES)
FORCE_TERMS = np.concatenate([WEIGHT, LEVER, OFFSET])
MASS_AT, OFFSET_AT = slice(0, 1), slice(4, 7)
MOMENT_TERMS = np.concatenate([ARM, INERTIA, OFFSET])
INERTIA_AT = slice(3, 9)
MOMENT_TERMS_WITH_WEIGHT = np.concatenate([MOMENT_TERMS, COUNTERWEIGHT])
COUNTERWEIGHT_AT = slice(len(MOMENT_TERMS), len(MOMENT_TERMS_WITH_WEIGHT))


@dataclass(frozen=True, eq=False)
class ConventionFit:
    """The unknowns of an equation, their covariance, and chi-square: left over, weighted, with what the priors cost.

    Of several sums side by side, one each.
    """

    values: Float[np.ndarray, "*m p"]
    covariance: Float[np.ndarray, "*m p p"]
    misfit: Float[np.ndarray, "*m"]

    def significance(self, unknowns: slice) -> Float[np.ndarray, "*m"]:
        """Return the distance of some unknowns from zero (as a length), in standard deviations."""
        values, spread = self.values[..., unknowns], self.covariance[..., unknowns, unknowns]
        return np.asarray(np.sqrt((values * np.linalg.solve(spread, values[..., None])[..., 0]).sum(axis=-1)))

    @property
    def trace(self) -> tuple[float, float]:
        """Trace of the tensor in a fit of the moment, and its standard uncertainty [kg·m²]."""
        moments = np.arange(INERTIA_AT.start, INERTIA_AT.stop)[ROWS == COLUMNS]
        variance = float(self.covariance[np.ix_(moments, moments)].sum())
        return float(self.values[moments].sum()), float(np.sqrt(max(variance, 0.0)))


def _normal_equations(sums: ConventionSums, terms: Terms, answer: slice) -> tuple[np.ndarray, np.ndarray]:
    """Normal matrix (p, p) and right side (p,) of fitting ``answer`` by ``terms``, as means over the instants."""
    count = len(terms)
    products = (terms.reshape(-1, WIDTH) @ sums.gram).reshape(*sums.gram.shape[:-2], count, 3, WIDTH)
    flat = products.reshape(*products.shape[:-2], 3 * WIDTH)
    return flat @ terms.reshape(count, -1).T, np.trace(products[..., answer], axis1=-2, axis2=-1)


def solve(
    sums: ConventionSums,
    terms: Terms,
    answer: slice,
    *,
    variance: float,
    priors: Float[np.ndarray, " p"] | None = None,
) -> ConventionFit:
    """Fit ``answer`` (force or moment) by ``terms``, each sample's components of this variance.

    ``priors`` (p,): standard deviation about zero of each unknown, inf where none is stated.
    """
    normal, right = _normal_equations(sums, terms, answer)
    total = np.trace(sums.gram[..., answer, answer], axis1=-2, axis2=-1)
    weight = sums.instants / variance
    loose = np.full(len(terms), np.inf) if priors is None else priors
    scale = np.maximum(np.diagonal(normal, axis1=-2, axis2=-1), 1e-300)
    matrix = weight * normal + (1 / loose**2 + 1e-10 * weight * scale + 1e-30)[..., None] * np.eye(len(terms))
    values = np.linalg.solve(matrix, weight * right[..., None])[..., 0]
    squared = (values * (normal @ values[..., None])[..., 0]).sum(axis=-1)
    misfit = weight * (total - 2 * (right * values).sum(axis=-1) + squared) + ((values / loose) ** 2).sum(axis=-1)
    return ConventionFit(values, np.linalg.inv(matrix), np.asarray(misfit))


def variance_left(sums: ConventionSums, terms: Terms, answer: slice) -> float:
    """Variance per component that a fit leaves [unit²], at least ``LEAST_MISFIT`` of its changes, squared.

    The least of several sums.
    """
    misfit = solve(sums, terms, answer, variance=1.0).misfit / (3 * sums.instants)
    free = max(1 - len(terms) / (3 * sums.instants), 0.1)
    return max(float(np.maximum(misfit / free, LEAST_MISFIT**2 * sums.changes(answer)).min()), 1e-18)


def negativity(fit: ConventionFit) -> Float[np.ndarray, "*m"]:
    """Increase of chi-square when a tensor's negative moments are raised to zero."""
    moments, axes = np.linalg.eigh(fit.values[..., INERTIA_AT][..., UNPACKED])
    forms = axes[..., ROWS, :] * axes[..., COLUMNS, :] * np.where(ROWS == COLUMNS, 1, 2)[:, None]
    spread = (forms * (fit.covariance[..., INERTIA_AT, INERTIA_AT] @ forms)).sum(axis=-2)
    return np.asarray(np.where(moments < 0, moments**2 / spread, 0.0).max(axis=-1))


@dataclass(frozen=True, eq=False)
class CentreFit:
    """The centre of gravity from the point where the moment is taken, by r × F."""

    r: Float[np.ndarray, "3"]
    """Centre of gravity from the point where the moment is taken [m]."""
    covariance: Float[np.ndarray, "3 3"]
    """Covariance matrix of ``r`` [m²]."""
    undetermined: Float[np.ndarray, "3 3"]
    """The projector onto the directions of r that the run does not determine."""


LEAST_SIGNAL = 0.5
"""Part of the force's changes that must be more than its noise, for a direction of r to count.

Choice: half, where the correction for noise doubles the variance.
"""


def fit_centre(sums: ConventionSums, *, force: Float[np.ndarray, "3"], moment: float, offset: float) -> CentreFit:
    """Fit the moment by r × F, I α + ω × I ω and an offset with a prior; the noise in F taken out of the sums.

    Directions of r that only noise, or a change like that of the motion's own moment tells of come back with a
    variance of 1 m².

    Args:
        sums: of the run.
        force: variance of the noise left in F, by axis [N²].
        moment: variance of the noise left in M [(N·m)²].
        offset: standard deviation of the moment's offset about zero [N·m].
    """
    normal, right = _normal_equations(sums, MOMENT_TERMS, MOMENT)
    loose = [1e-12 * normal[INERTIA_AT, INERTIA_AT].trace()] * 6 + [moment / sums.instants / offset**2] * 3
    others = np.linalg.solve(normal[3:, 3:] + np.diag(loose), np.column_stack([normal[3:, :3], right[3:]]))
    seen = normal[:3, :3] - normal[:3, 3:] @ others[:, :3]
    answer = right[:3] - normal[:3, 3:] @ others[:, 3]
    noise = force.sum() * np.eye(3) - np.diag(force)
    scale = np.linalg.cholesky(seen + 1e-12 * seen.trace() * np.eye(3))
    whitened = np.linalg.solve(scale, np.linalg.solve(scale, noise).T)
    share, axes = np.linalg.eigh(np.eye(3) - whitened)
    basis = np.linalg.solve(scale.T, axes)
    determined = share > LEAST_SIGNAL
    basis, share = basis[:, determined], share[determined]
    r = basis @ ((basis.T @ answer) / share)
    spread = (moment + float(r @ noise @ r)) / sums.instants
    undetermined = np.eye(3)
    if determined.any():
        directions = np.linalg.qr(scale @ axes[:, determined])[0]
        undetermined = undetermined - directions @ directions.T
    return CentreFit(r, basis * (spread / share**2) @ basis.T + undetermined, undetermined)


def force_noise(sums: ConventionSums) -> Float[np.ndarray, "3"]:
    """The variance that the best fit leaves in the force, by axis [N²]."""
    rows = np.einsum("p,pij->ij", solve(sums, FORCE_TERMS, FORCE, variance=1.0).values, FORCE_TERMS)
    rows[:, FORCE] -= np.eye(3)
    return np.maximum(np.einsum("ij,jk,ik->i", rows, sums.gram, rows), 0.0)
