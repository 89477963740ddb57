"""Generalised least squares: each frequency and axis counts by the noise that the residuals show there.

    i = (Σ Xᵀ S⁻¹ X)⁻¹ Σ Xᵀ S⁻¹ y        over the lines of the cosine transform (:mod:`identify.signals.spectrum`)

Ordinary least squares (10) takes all errors for white and equal; those of ``M - r × F`` are neither: the force's noise
reaches it through r and joins the axes; filters, drift and vibration colour it. ``S`` is estimated from the residuals
and the fit repeated (feasible generalised least squares; Aitken 1936, doi:10.1017/S0370164600014346). Only lines that
the motion reaches take part: beyond them rows hold nothing but the gyro's noise, which weights could only bring out.
"""

from typing import NamedTuple

import numpy as np

from identify.choices import OffsetChoice
from identify.estimators.least_squares import excitation
from identify.estimators.offsets import Offsets, rested, resting
from identify.estimators.regressor_rows import rows_of
from identify.estimators.residual_trace import trace
from identify.estimators.run_information import Information, alpha_noise, gain_error, longest
from identify.rigid_body.regressor import ALPHA, OMEGA, OMEGA_R_OF_FEATURES
from identify.signals.correlation_time import correlation_time
from identify.signals.differentiate import gain
from identify.signals.estimator_spec import EstimatorSpec
from identify.signals.filters import motion_band, response
from identify.signals.run import Run
from identify.signals.spectrum import Lines, Spectrum, spectrum

ROUNDS = 4
"""Fits, each with the spectrum of the one before."""
REACH = 3.0
"""Highest frequency that takes part over the motion's band: products of omega reach twice the band."""
WIDER = 3
"""Windows of the weights over those of the uncertainty: weights that follow their own residuals promise too much."""
FEWEST = 24
"""Lines that take part, at least."""
HALF = 0.5
"""Gain of the filter on both sides down to which lines take part."""


class Fit(NamedTuple):
    """A fit on lines, its weights from its own residuals."""

    value: np.ndarray
    """(p,)."""
    inverse: np.ndarray
    """Of the normal equations: the covariance of ``value``, (p, p)."""
    weights: np.ndarray
    """``S⁻¹`` of the lines that take part, (k, 3, 3)."""
    spectrum: Spectrum


def whitened(run: Run, estimator: EstimatorSpec, r_cg: np.ndarray, *, offsets: OffsetChoice) -> Information:
    """Return a run's normal equations with weights by its errors' spectrum.

    Arguments and errors are those of :func:`identify.estimators.run_information.information`.
    """
    rows = rows_of(run, estimator)
    lines, matrix = Lines.of(rows.segments, run.rate), rows.matrix
    force, moment, motion = np.asarray(rows.force).T, np.asarray(rows.moment).T, np.asarray(rows.phi)
    mean_force = force.mean(axis=0)
    if offsets == "still":
        force, moment = force - resting(run).force, moment - resting(run).moment
    passed = response(estimator.filter_taps(run.rate), run.rate, lines.frequency)
    x, y = lines.transform(matrix), lines.transform(moment - np.cross(r_cg, force))
    constants = lines.constant[:, None, None] * np.eye(3)
    columns = np.concatenate([x, constants], axis=2) if offsets == "estimate" else x
    inside = _inside(run, lines, passed)
    fit = fitted(columns, y, inside, lines.constants, passed**2)
    lever = np.cross(lines.transform(force)[:, None, :], np.eye(3)[None]).swapaxes(1, 2)  # F × r, by r
    sides = np.concatenate([y[:, :, None], lever], axis=2)[:inside]
    normal, right = _without_constants(*_equations(columns[:inside], fit.weights, sides))
    spread = np.linalg.pinv(normal, hermitian=True)
    about_cg = moment - np.cross(r_cg, force)
    residuals = about_cg - matrix @ fit.value[:6]
    weighed = np.einsum("mab,mbp->map", fit.weights, x[:inside])
    scores, removed = fit.spectrum.scores(weighed), None
    if offsets == "estimate":
        removed = Offsets(fit.value[6:], fit.inverse[6:, 6:], mean_force)
        residuals, about_cg = residuals - removed.moment, about_cg - removed.moment
    elif offsets == "still":
        removed = rested(resting(run), r_cg)
        by_constant = _equations(x[:inside], fit.weights, constants[:inside])[1]
        scores = scores + by_constant @ removed.covariance @ by_constant.T
    noise = _noise(alpha_noise(run, estimator), fit.weights, _shape(run, estimator, lines.frequency)[:inside])
    return Information(
        run, normal, right[:, 0], right[:, 1:], noise, spread @ right[:, 0], scores, excitation(normal, noise), removed,
        residuals.std(axis=0), correlation_time(residuals), len(residuals), gain_error(run, estimator),
        fit.spectrum.degrees_of_freedom(weighed @ spread),
        trace(run.t[rows.instants], residuals, about_cg, motion[OMEGA].T, motion[ALPHA].T),
    )  # fmt: skip


def fitted(columns: np.ndarray, values: np.ndarray, inside: int, constants: int, gain: np.ndarray | float = 1.0) -> Fit:
    """Return the generalised fit of transformed values by transformed columns.

    Args:
        columns: of all lines, in the order of frequency, (m, 3, p).
        values: (m, 3).
        inside: how many lines, the first ones, take part.
        constants: how many lines, the first ones, are those of constants.
        gain: power gain of a filter that both have passed, at each line.
    """
    taking = columns[:inside]
    weights = np.broadcast_to(np.eye(3), (inside, 3, 3))
    for _ in range(ROUNDS):
        normal, right = _equations(taking, weights, values[:inside, :, None])
        inverse = np.linalg.pinv(normal, hermitian=True)
        value = inverse @ right[:, 0]
        free = np.ones(values.shape)
        taken = np.einsum("map,pq,mbq,mba->ma", taking, inverse, taking, weights, optimize=True)
        free[:inside] = np.clip(1 - taken, 0, 1)
        left = values - columns @ value
        weights = np.linalg.inv(spectrum(left, free, constants, gain, wider=WIDER).values[:inside])
    normal, right = _equations(taking, weights, values[:inside, :, None])
    inverse = np.linalg.pinv(normal, hermitian=True)
    return Fit(inverse @ right[:, 0], inverse, weights, spectrum(left, free, constants, gain))


def _equations(columns: np.ndarray, weights: np.ndarray, sides: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """``Σ Xᵀ W X`` and ``Σ Xᵀ W`` times the other sides."""
    weighed = np.einsum("mab,mbp->map", weights, columns)
    return np.tensordot(weighed, columns, axes=((0, 1), (0, 1))), np.tensordot(weighed, sides, axes=((0, 1), (0, 1)))


def _without_constants(normal: np.ndarray, right: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """The equations of the tensor alone, what follows it eliminated."""
    if len(normal) == 6:
        return normal, right
    solved = np.linalg.solve(normal[6:, 6:], np.concatenate([normal[6:, :6], right[6:]], axis=1))
    return normal[:6, :6] - normal[:6, 6:] @ solved[:, :6], right[:6] - normal[:6, 6:] @ solved[:, 6:]


def _inside(run: Run, lines: Lines, passed: np.ndarray) -> int:
    """How many lines the motion reaches, and the filter lets through."""
    reached = lines.frequency <= REACH * motion_band(longest(run), run.rate)
    count = int((reached & (passed >= HALF)).sum())
    return min(max(count, lines.constants + FEWEST), len(lines.frequency))


def _shape(run: Run, estimator: EstimatorSpec, frequency: np.ndarray) -> np.ndarray:
    """Spectrum of the noise in the rows' alpha, its mean 1."""
    slope = frequency * gain(estimator.taps(run.rate), run.rate, frequency)
    slope = slope * response(estimator.filter_taps(run.rate), run.rate, frequency)
    if run.noise is not None:
        slope = slope * frequency * gain(run.noise.taps, run.noise.rate, frequency)
    return slope**2 / np.mean(slope**2)


def _noise(sigma: np.ndarray, weights: np.ndarray, shape: np.ndarray) -> np.ndarray:
    """What noise of alpha [rad/s²] adds to the normal equations, expected."""
    of_alpha = OMEGA_R_OF_FEATURES[ALPHA]
    return np.einsum("k,m,kai,mab,kbj->ij", sigma**2, shape, of_alpha, weights, of_alpha, optimize=True)
