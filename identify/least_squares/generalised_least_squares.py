"""Generalised least squares: each frequency and axis counts by the noise that the residuals show there.

    i = (Σ Xᵀ W X)⁻¹ Σ Xᵀ W y,    W = (S + L Σ Lᵀ)⁻¹

over the lines of the cosine transform (:mod:`identify.least_squares.residual_spectrum`). Ordinary least squares (10)
takes all errors for white and equal; those of ``M - r × F`` are neither: the force's noise reaches it through r and
joins the axes; filters, drift and vibration colour it; and the error of r itself follows the force, ``L``, by as much
as is stated of it, ``Σ``. ``S`` is estimated from the residuals, less what r's error explains of them, and the fit
repeated (feasible generalised least squares; Aitken 1936, doi:10.1017/S0370164600014346). Only lines that the motion
reaches take part: beyond them rows hold nothing but the gyro's noise, which weights could only bring out. Where these
are too few to learn weights from, the run is fitted by ordinary least squares.

Moments may follow the motion though no rigid body on a rigid platform makes them, as columns of a regression: a
mounting that flexes makes the moment ``M`` grow with ``f²``, axis by axis (the IMU on the platform); a cable adds its
stiffness times the angle turned; cross-talk between the load cell's channels adds ``G F`` and ``H M``, of which the
antisymmetric part of ``G`` is an error of r_CG, and the symmetric part of ``H`` a tensor's.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from identify.choices import OffsetChoice
from identify.least_squares.declared_effects import DeclaredError, residual_changes
from identify.least_squares.offsets import Offsets, rested, resting
from identify.least_squares.residual_spectrum import BLOCK, Lines, Spectrum, reach, spectrum
from identify.least_squares.row_products import products
from identify.least_squares.run_information import (
    Information,
    alpha_noise,
    excitation,
    gain_error,
    information_of_lines,
    residuals_in_time,
    without_offsets,
)
from identify.least_squares.run_lines import FORCE, MOTION, RunLines, run_lines
from identify.rigid_body.inertia import unpack
from identify.rigid_body.pseudo_inertia import UNITS
from identify.rigid_body.regressor import ALPHA, OMEGA_R_OF_FEATURES
from identify.rigid_body.rotation import CROSS
from identify.signals.estimator_spec import EstimatorSpec
from identify.signals.power_spectrum import without_line
from identify.signals.run import Run

ROUNDS = 4
"""Fits, each with the spectrum of the one before."""
REACH = 3.0
"""Highest frequency that takes part over the motion's band: products of omega reach twice the band."""
WIDER = 3
"""Width of the weights' spectral windows over that of the uncertainty's: narrow ones follow the residuals too
closely."""
FEWEST = 24
"""Lines from which weights can be learnt, at least."""
COLLINEAR = 1e-4
"""Part of a column that is no other's, below which it counts as made up of others."""
HALF = 0.5
"""Gain of the filter on both sides down to which lines take part."""


class TensorEquations(NamedTuple):
    """Normal equations of the tensor."""

    normal: np.ndarray
    """Matrix of the normal equations, (6, 6)."""
    right: np.ndarray
    """Right-hand side of the normal equations, (6,)."""
    right_by_centre: np.ndarray
    """Derivative of ``right`` with respect to r_CG, (6, 3)."""


class Weighed(NamedTuple):
    """A run's equations with weights, and those of two other estimates that tell whether these are to be trusted."""

    weighted: Information
    plain: Information
    """The run's equations by ordinary least squares."""
    extended: TensorEquations
    """Weighted equations with unknowns for signals that follow the motion
    (:func:`motion_columns`)."""
    scores: np.ndarray
    """Covariance of the three right sides from noise, (18, 18): by what the unknowns for such moments leave."""
    by_errors: np.ndarray
    """Changes of the three right sides by one standard uncertainty of each declared error, (18, q)."""
    enough: bool
    """Whether there were lines enough for weights; otherwise all three equations are those of ordinary least
    squares."""


class WeightedFit(NamedTuple):
    """A fit on lines, its weights from its own residuals."""

    value: np.ndarray
    """Values of the estimated unknowns, (p,)."""
    inverse: np.ndarray
    """Inverse of the normal equations' matrix, the covariance of ``value``, (p, p)."""
    normal: np.ndarray
    """Matrix of the normal equations, with the prior, (p, p)."""
    weights: np.ndarray
    """``S⁻¹`` of the lines that take part, (k, 3, 3)."""
    residuals: np.ndarray
    """Residuals of the lines that are given, (m, 3)."""
    spectrum: Spectrum


def whitened(
    run: Run, estimator: EstimatorSpec, r_cg: np.ndarray, *, offsets: OffsetChoice, sigma_r_cg: np.ndarray,
    errors: Sequence[Sequence[DeclaredError]] = (),
) -> Weighed:  # fmt: skip
    """Return a run's normal equations with weights by its errors' covariance, beside those of other estimates.

    Arguments and errors are those of :func:`identify.least_squares.run_information.information`; ``sigma_r_cg`` is the
    centre of gravity's standard uncertainty on each axis [m], ``errors`` those that are declared.
    """
    record = run_lines(run, estimator)
    lines, plain = record.lines, information_of_lines(record, estimator, r_cg, offsets=offsets)
    unweighted = without_offsets(record, offsets)
    power_gain = estimator.passed(run.rate, lines.frequency) ** 2
    inside = _inside(run, lines, power_gain)
    if inside < lines.constants + FEWEST:
        return _unweighed(plain, unweighted[:], len(errors))
    used = unweighted if offsets == "still" else record
    near = slice(0, reach(inside, len(record), WIDER))
    x, y, pushes = used[near], used.about_cg(r_cg, near), used.signals_at(near)[FORCE].T
    angle = lines.transform(angle_turned(record.omega, lines.segments, run.rate))[near]
    of_motion = _of_motion(pushes, np.hstack([record.signals_at(near)[MOTION].T, angle]), lines.constant[near], inside)
    lever = _by_centre(pushes)
    constants = lines.constant[near, None, None] * np.eye(3)
    free = constants if offsets == "estimate" else constants[:, :, :0]
    columns = np.concatenate([x, free, _by_centre(of_motion) * sigma_r_cg], axis=2)
    prior = np.append(np.zeros(6 + free.shape[2]), np.ones(3))
    fit = fitted(columns, y, inside, lines.constants, power_gain[near], prior)
    inertia, shape = fit.value[:6], _shape(run, estimator, lines.frequency, inside)
    sides, sigma_alpha = (y[:inside], lever[:inside]), alpha_noise(run, estimator)
    weighed = _reduced(columns[:inside], fit)
    weighted = _equations_of(weighed, x[:inside], *sides)
    noise_of_fit = np.outer(shape, unpack(inertia) ** 2 @ sigma_alpha**2)
    moment = x[:inside] @ inertia
    follows = motion_columns(moment, of_motion[:inside], angle[:inside], lines.frequency[:inside], noise_of_fit)
    eliminated = _with_room(weighed, columns[:inside], follows, fit)
    fitted_moment = fit.value[6:9] if offsets == "estimate" else np.zeros(3)
    levelled = used.less_wrench(np.zeros(3), fitted_moment)
    remaining, freedom = levelled.residuals(inertia, r_cg - sigma_r_cg * fit.value[-3:]), np.ones((len(record), 3))
    remaining[:inside] -= eliminated.residuals
    freedom[:inside] = eliminated.free
    every = RowsSideBySide(weighed, eliminated.rows, unweighted)
    scores = spectrum(remaining, freedom, lines.constants, power_gain).scores(every)
    del remaining, freedom  # of a long run, what is not looked at again takes no memory
    weighted_scores = by_noise = fit.spectrum.scores(weighed)
    if offsets == "estimate":
        removed = Offsets(fitted_moment, fit.inverse[6:9, 6:9], record.means[FORCE])
    elif offsets == "still":
        removed = rested(resting(run), r_cg)
        by_constant = products(every[: lines.constants], constants[: lines.constants])
        constant_scores = by_constant @ removed.covariance @ by_constant.T
        scores, weighted_scores = scores + constant_scores, weighted_scores + constant_scores[:6, :6]
    else:
        removed = None
    noise = _noise(sigma_alpha, fit.weights, shape)
    spread = np.linalg.pinv(weighted.normal, hermitian=True)
    estimate = Information(
        run=run, **weighted._asdict(), noise=noise, inertia=spread @ weighted.right, scores=weighted_scores,
        excitation=excitation(weighted.normal, noise), offsets=removed, rows=len(record),
        gain_error=gain_error(run, estimator), weighed=weighed,
        degrees_of_freedom=fit.spectrum.degrees_of_freedom(weighed, spread, by_noise),
        **residuals_in_time(levelled.residuals(inertia, r_cg), record, r_cg),
    )  # fmt: skip
    extended = _equations_of(eliminated.rows, x[:inside], *sides)
    changes = residual_changes(unweighted, inertia, r_cg, errors)
    by_errors = np.sum([products(every[part], changes[part]) for part in record.parts()], axis=0)
    return Weighed(
        weighted=estimate, plain=plain, extended=extended, scores=scores, by_errors=by_errors, enough=True,
    )  # fmt: skip


def _by_centre(force: np.ndarray) -> np.ndarray:
    """Derivative of ``F × r`` with respect to r, of lines of the force (k, 3): (k, 3, 3)."""
    return np.cross(force[:, None, :], np.eye(3)[None]).swapaxes(1, 2)


def _of_motion(force: np.ndarray, motion: np.ndarray, constant: np.ndarray, inside: int) -> np.ndarray:
    """Return the part of the force's lines that motion, attitude and a constant explain, (k, 3) [N].

    The noise of the measured force stands in ``M - r × F`` too, so a column of it would draw r_CG towards zero.
    """
    columns = np.column_stack([motion, constant])
    size = np.maximum(np.linalg.norm(columns[:inside], axis=0), 1e-300)  # features differ in unit
    return columns / size @ np.linalg.lstsq(columns[:inside] / size, force[:inside], rcond=COLLINEAR)[0]


@dataclass(frozen=True, eq=False)
class RowsSideBySide:
    """The rows of three estimates side by side: weighted, unweighted, and with unknowns for what follows the motion."""

    weighed: np.ndarray
    roomy: np.ndarray
    unweighted: RunLines
    """Rows of all lines; those of the weighted estimates are of the first lines alone, and zero beyond."""

    def __len__(self) -> int:
        return len(self.unweighted)

    def __getitem__(self, part: slice) -> np.ndarray:
        unweighted = self.unweighted[part]
        few = [rows[part] for rows in (self.weighed, self.roomy)]
        first, last = (np.pad(rows, ((0, len(unweighted) - len(rows)), (0, 0), (0, 0))) for rows in few)
        return np.concatenate([first, unweighted, last], axis=2)


def _unweighed(plain: Information, rows: np.ndarray, errors: int) -> Weighed:
    """Ordinary least squares, of these transformed rows, in place of all three."""
    weight = plain.weight
    extended = TensorEquations(weight * plain.normal, weight * plain.right, weight * plain.right_by_centre)
    factors = np.array([1, 1, weight])
    return Weighed(
        weighted=replace(plain, weighed=rows), plain=plain, extended=extended,
        scores=np.kron(np.outer(factors, factors), plain.scores), by_errors=np.zeros((18, errors)), enough=False,
    )  # fmt: skip


def _equations_of(weighed: np.ndarray, x: np.ndarray, y: np.ndarray, lever: np.ndarray) -> TensorEquations:
    normal = products(weighed, x)
    return TensorEquations((normal + normal.T) / 2, products(weighed, y[:, :, None])[:, 0], products(weighed, lever))


def _reduced(columns: np.ndarray, fit: WeightedFit) -> np.ndarray:
    """Rows whose products with the values are the equations of the tensor alone, what follows it eliminated."""
    share = np.linalg.solve(fit.normal[6:, 6:], fit.normal[6:, :6])
    return fit.weights @ (columns[:, :, :6] - columns[:, :, 6:] @ share)


class Eliminated(NamedTuple):
    """Effect of further columns on a fit, of the lines that take part."""

    rows: np.ndarray
    """Rows of the fit's equations of the tensor, the columns eliminated, (k, 3, 6)."""
    residuals: np.ndarray
    """Part of the residuals that the columns explain, (k, 3)."""
    free: np.ndarray
    """Degrees of freedom that are left, (k, 3)."""


def _with_room(weighed: np.ndarray, columns: np.ndarray, more: np.ndarray, fit: WeightedFit) -> Eliminated:
    """Return the effect of further columns on a fit.

    Directions of these columns that the other columns nearly span stay out.
    """
    reduced = more - columns @ (fit.inverse @ products(fit.weights @ columns, more))
    weighed_reduced = fit.weights @ reduced
    scale = 1 / np.sqrt(np.maximum((more * (fit.weights @ more)).sum(axis=(0, 1)), 1e-300))
    scales = np.outer(scale, scale)
    information = products(weighed_reduced, more) * scales
    inverse = np.linalg.pinv((information + information.T) / 2, rcond=COLLINEAR, hermitian=True) * scales
    inside = len(more)
    taken = ((reduced @ inverse) * weighed_reduced).sum(axis=2)
    return Eliminated(
        rows=weighed - weighed_reduced @ inverse @ products(weighed, more).T,
        residuals=reduced @ inverse @ np.einsum("maz,ma->z", weighed_reduced, fit.residuals[:inside]),
        free=np.clip(fit.spectrum.free[:inside] - taken, 0, 1),
    )  # fmt: skip


def fitted(
    columns: np.ndarray, values: np.ndarray, inside: int, constants: int, gain: np.ndarray | float = 1.0,
    prior: np.ndarray | float = 0.0,
) -> WeightedFit:  # fmt: skip
    """Return the generalised fit of transformed values by transformed columns.

    Args:
        columns: of all lines, in the order of frequency, (m, 3, p).
        values: (m, 3).
        inside: how many lines, the first ones, take part.
        constants: how many lines, the first ones, are those of constants.
        gain: power gain of a filter that both have passed, at each line.
        prior: inverse of the variance of each unknown about zero.
    """
    taking, precision = columns[:inside], np.diag(np.broadcast_to(prior, columns.shape[2]))

    def solved(weighed: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Normal equations' matrix, its inverse, and the solution."""
        normal = products(weighed, taking) + precision
        inverse = np.linalg.pinv(normal, hermitian=True)
        return normal, inverse, inverse @ products(weighed, values[:inside, :, None])[:, 0]

    weights, free = np.broadcast_to(np.eye(3), (inside, 3, 3)), np.ones(values.shape)
    for _ in range(ROUNDS):
        weighed = weights @ taking
        _, inverse, value = solved(weighed)
        free[:inside] = np.clip(1 - ((taking @ inverse) * weighed).sum(axis=2), 0, 1)
        residuals = values - columns @ value
        weights = np.linalg.inv(spectrum(residuals, free, constants, gain, wider=WIDER).at(slice(0, inside)))
    normal, inverse, value = solved(weights @ taking)
    return WeightedFit(
        value=value, inverse=inverse, normal=normal, weights=weights, residuals=residuals,
        spectrum=spectrum(residuals, free, constants, gain),
    )  # fmt: skip


def _inside(run: Run, lines: Lines, power_gain: np.ndarray) -> int:
    """Return the number of lines that the motion reaches and the filter passes."""
    reached = lines.frequency <= REACH * run.band
    return int((reached & (power_gain >= HALF**2)).sum())


def _shape(run: Run, estimator: EstimatorSpec, frequency: np.ndarray, inside: int) -> np.ndarray:
    """Spectrum of the noise in the rows' alpha on the first lines, its mean over all of them 1."""
    among = frequency[:: max(len(frequency) // BLOCK, 1)]  # the response is smooth
    return _slope(run, estimator, frequency[:inside]) ** 2 / np.mean(_slope(run, estimator, among) ** 2)


def _slope(run: Run, estimator: EstimatorSpec, frequency: np.ndarray) -> np.ndarray:
    """Gain from white noise of the angular velocity to the rows' alpha, but for a factor."""
    slope = frequency * estimator.gain(run.rate, frequency) * estimator.passed(run.rate, frequency)
    return slope if run.noise is None else slope * frequency * run.noise.gain(frequency)


def _noise(sigma: np.ndarray, weights: np.ndarray, shape: np.ndarray) -> np.ndarray:
    """Return the expected contribution of alpha's noise [rad/s²] to the normal equations."""
    alpha_regressor = OMEGA_R_OF_FEATURES[ALPHA]
    return np.einsum("k,m,kai,mab,kbj->ij", sigma**2, shape, alpha_regressor, weights, alpha_regressor, optimize=True)


CLEAR = 30.0
"""Power of a line's fitted moment over that of the gyro's noise in it, from which it counts as the motion's."""
SLOW = 0.01
"""Part of the moment's power in the slowest lines, where the angle is little but drift of the integral."""


def motion_columns(
    moment: Float[np.ndarray, "k 3"],
    force: Float[np.ndarray, "k 3"],
    angle: Float[np.ndarray, "k 3"],
    frequency: Float[np.ndarray, " k"],
    noise: Float[np.ndarray, "k 3"],
) -> Float[np.ndarray, "k 3 15"]:
    """Return fifteen columns: ``f² M`` and the angle by axis, a symmetric ``G F``, an antisymmetric ``H M``.

    Args:
        moment: fitted, of lines of the cosine transform [N·m].
        force: measured [N].
        angle: that the body has turned by; see :func:`angle_turned` [rad].
        frequency: of the lines [Hz].
        noise: power of the gyro's noise in ``moment`` [(N·m)²]; ``f²`` would bring out a line that holds little else.
    """
    grown = np.where(moment**2 > CLEAR * noise, moment, 0.0) * frequency[:, None] ** 2
    power = np.cumsum((moment**2).sum(axis=1))
    turned = np.where(power[:, None] > SLOW * power[-1], angle, 0.0)
    by_axis = [signal[:, :, None] * np.eye(3) for signal in (grown, turned)]
    across = [np.einsum("nab,kb->kan", maps, signal) for maps, signal in ((UNITS, force), (CROSS, moment))]
    return np.concatenate([*by_axis, *across], axis=2)


def angle_turned(omega: Float[np.ndarray, "n 3"], segments: Sequence[slice], rate: float) -> Float[np.ndarray, "n 3"]:
    """Return the integral of the angular velocity over each segment without a gap, less its straight line [rad].

    The straight line holds the gyro's bias. Good for angles of a few tenths of a radian.
    """
    angle = np.zeros_like(omega)
    for segment in segments:
        angle[segment] = without_line(np.cumsum(omega[segment], axis=0).T / rate).T
    return angle
