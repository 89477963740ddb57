"""Force and moment of a run that the estimate has not seen: predicted, with the covariance that the errors should have.

Each run in turn, or each half of a single one, is predicted by the estimate of the others. In the lines of the cosine
transform up to the motion's band, measured less predicted wrench is

    y = J δ + L l + n,    δ ~ N(0, C),    l ~ N(0, Λ⁻¹),    n ~ N(0, S)

with the estimate's error δ of mass, r_CG and tensor; what each run has of its own, l: its offsets, of which nothing is
known, its gyro's slow errors and declared errors of the rig; and the noise S that the other runs' residuals show. What
l takes up is removed. What is left is compared with its covariance, row by row (Satterthwaite's F), and along δ:
whether the run by itself asks for another body. An error that all runs share is not seen.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import scipy
from jaxtyping import Float

from identify.estimation.joint.gauss_newton import linearised
from identify.estimation.joint.joint_model import SLICES, TEN, SpecificForce
from identify.estimation.joint.priors import PriorBlock, Setting, means_of, without
from identify.estimation.methods.base import Problem, estimator_of
from identify.estimation.methods.joint import specific_force_source
from identify.exceptions import RunError
from identify.judge.judged_fits import declared_of, judged_ways, rows_in_band, start_of
from identify.judge.run_fit import OVER_BAND, RunFit, fit_run, tensor_change
from identify.least_squares.covariance_matrices import root_of
from identify.least_squares.residual_spectrum import spectrum
from identify.least_squares.row_products import inverse, products
from identify.results.held_out_result import HeldOut, HeldOutRun
from identify.results.identification_result import Identification
from identify.signals.band_limited_run import InBand
from identify.signals.run import Run

WIDER = 3
"""Width of the noise spectrum's windows over that of the estimators' windows.

Choice: a short run has few lines.
"""
FEWEST = 16
"""Lines from which a run is judged.

Choice: fewer have no spectrum of their noise.
"""
STRETCH = 8.0
"""Periods of the motion's highest frequency that the figure shows.

Choice: of drawing alone.
"""


def held_out(problem: Problem, result: Identification) -> HeldOut:
    """Return how well each run, or each half of a single one, is predicted by the others.

    Args:
        problem: the runs, and what is declared.
        result: of all of them, for its method.

    Raises:
        RunError: a run is too short, or what is left of the runs does not determine the tensor.
    """
    halves = len(problem.runs) == 1
    runs = _halves(problem.runs[0]) if halves else problem.runs
    split = replace(problem, runs=runs)
    force_from = _force_from(split, result)
    reduced = [_in_band(run, result, problem, halves) for run in runs]
    fits = [
        fit_run(run, rows, declared_of(result, problem, force_from), start_of(result))
        for run, rows in zip(runs, reduced, strict=True)
    ]
    predicted = []
    for k, (run, rows) in enumerate(zip(runs, reduced, strict=True)):
        others = [index for index in range(len(runs)) if index != k]
        estimate = _estimate(replace(split, runs=tuple(runs[index] for index in others)), result.method, run, halves)
        other_fits = [fits[index] for index in others]
        predicted.append(_predicted(run, rows, estimate, problem, force_from, other_fits))
    return HeldOut(tuple(predicted), halves)


def _halves(run: Run) -> tuple[Run, ...]:
    """Two runs of equal numbers of samples that may be used: the joint model is compiled once for both."""
    usable = np.flatnonzero(run.usable)
    middle, count = usable[len(usable) // 2], len(usable) // 2
    ends = (usable[0], middle - 1), (middle, usable[2 * count - 1])
    names = "first half", "second half"
    return tuple(
        replace(run.between(run.t[start], run.t[stop]), name=f"{run.name}, {name}")
        for (start, stop), name in zip(ends, names, strict=True)
    )


def _too_short(name: str, halves: bool) -> str:
    cure = "record for longer, or give several runs" if halves else "record for longer, or leave it out"
    return f"{name} is too short to be held out: {cure}"


def _in_band(run: Run, result: Identification, problem: Problem, halves: bool) -> InBand:
    rows = rows_in_band(run, judged_ways(result, problem))
    if rows is None or 2 * OVER_BAND * problem.band * rows.interval * rows.used.sum() < FEWEST:
        raise RunError(_too_short(run.name, halves))
    return rows


def _force_from(problem: Problem, result: Identification) -> SpecificForce:
    """Return the source of the specific force; "none" where no force follows, so that only moments are predicted."""
    source = specific_force_source(problem)
    if result.mass is None or any(map(judged_ways(result, problem).falls, problem.runs)):
        return "none"
    return source


def _estimate(problem: Problem, method: str, without: Run, halves: bool) -> Identification:
    """The plain estimate of some runs, not held to what bodies can have."""
    try:
        result = estimator_of(method).fit(problem)
    except RunError as error:
        raise RunError(f"without {without.name}: {error}") from None
    if result.seen is not None:
        others = "the other half does" if halves else "the other runs do"
        cure = "record for longer, or give several runs" if halves else "add runs that do"
        raise RunError(f"{without.name}: {others} not determine the tensor, so that nothing predicts it: {cure}")
    if result.admissible is None:
        return result
    return replace(result, value=np.concatenate([result.value[:4], result.admissible.plain]))


class ResidualNoise(NamedTuple):
    """Covariance of the rows' noise by frequency, from the residuals of runs at their best."""

    frequency: Float[np.ndarray, " m"]
    values: Float[np.ndarray, "m rows rows"]
    freedom: Float[np.ndarray, " rows"]
    """Degrees of freedom that it is from."""
    window: Float[np.ndarray, " m"]
    """Lines that each value is an average of."""

    def at(self, frequency: Float[np.ndarray, " k"]) -> Float[np.ndarray, "k rows rows"]:
        """Return it at other frequencies."""
        places = np.searchsorted(self.frequency, frequency).clip(0, len(self.frequency) - 1)
        return self.values[places]


def noise_of(fits: Sequence[RunFit]) -> ResidualNoise:
    """Return the noise that the residuals of some runs show, each at its best."""
    residuals, free, frequency = [], [], []
    for fit in fits:
        residuals.append((fit.residuals @ np.linalg.inv(fit.lines.whitener).T)[1:])
        free.append(1 - fit.base.leverage[0][1:])
        frequency.append(fit.frequency[1:])
    order = np.argsort(np.concatenate(frequency), kind="stable")
    rows, freedom = np.concatenate(residuals)[order], np.concatenate(free)[order]
    size = np.maximum(np.sqrt((rows**2).mean(axis=0)), 1e-300)
    shown = spectrum(rows / size, freedom, 0, wider=WIDER)
    values = shown.values * np.outer(size, size)
    first, last = shown.windows(slice(None))
    return ResidualNoise(np.concatenate(frequency)[order], values, freedom.sum(axis=0), (last - first).astype(float))


def _predicted(
    run: Run,
    rows: InBand,
    estimate: Identification,
    problem: Problem,
    force_from: SpecificForce,
    others: list[RunFit],
) -> HeldOutRun:
    """The prediction of a run by the estimate of the others, beside what was measured."""
    followed = _followed(estimate, others, problem)
    declared = _held(declared_of(estimate, problem, force_from), estimate, followed)
    fit = fit_run(run, rows, declared, {})
    fit = replace(fit, lines=replace(fit.lines, whitener=np.eye(len(fit.lines.whitener))))
    at = fit.prediction
    ten = fit.transformed(np.concatenate([at.derivative(name) for name in TEN], axis=2))
    local = linearised(at.model, fit.prior, fit.z, fit.lines).columns
    y = fit.transformed(at.residuals[:, :, None])[:, :, 0] + local @ fit.z
    covariance = _covariance(estimate, problem)
    shared = {error.unknown for error in problem.errors.values() if error.shared}
    for name, by_error in followed.items():
        made = by_error @ fit.prior.root[SLICES[name]]
        if name in shared:  # the others' tensor has the same error in it
            local = local - ten[:, :, 4:] @ made
        else:
            covariance[4:, 4:] += made @ made.T
    freedom = np.inf if estimate.pooling is None else float(estimate.pooling.residual_degrees_of_freedom.min())
    return _compared(
        run=run, fit=fit, y=y, local=local, by_estimate=ten @ root_of(covariance), noise=noise_of(others),
        freedom_of_estimate=freedom,
    )  # fmt: skip


def _followed(estimate: Identification, fits: Sequence[RunFit], problem: Problem) -> dict[str, np.ndarray]:
    """Return each declared error's effect on a tensor by least squares, (6, p), where it counts as zero."""
    if estimate.method == "joint":
        return {}
    weights, offsets = [run.weight for run in estimate.runs], estimate.offsets == "estimate"
    names = dict.fromkeys(error.unknown for error in problem.errors.values())
    added = {name: [fit.prediction.derivative(name) for fit in fits] for name in names}
    return {name: tensor_change(fits, weights, columns, offsets=offsets) for name, columns in added.items()}


def _held(declared: Setting, estimate: Identification, followed: dict[str, np.ndarray]) -> Setting:
    """Return the unknowns of a run alone, with the body and the alignment that the others gave."""
    means = means_of(declared.blocks)
    by_errors = (by_error @ means[name] for name, by_error in followed.items())
    body = {"inertia": estimate.inertia - sum(by_errors, np.zeros(6)), "r_cg": estimate.r_cg}
    if estimate.mass is not None:
        body["mass"] = np.array([estimate.mass])
    held = {(name,): PriorBlock(value, np.zeros((len(value), len(value)))) for name, value in body.items()}
    for name, aligned in (("delay", estimate.delay), ("rotation", estimate.rotation)):
        if aligned is not None:
            held[name,] = PriorBlock(aligned.value, aligned.covariance)
    blocks = without(declared.blocks, sum(held, ())) | held
    return replace(declared, blocks=blocks, flat=("force_offset", "moment_offset"))


def _covariance(estimate: Identification, problem: Problem) -> Float[np.ndarray, "10 10"]:
    """Return the covariance of mass, r_CG and tensor."""
    covariance = np.array(estimate.parameters.covariance)
    if not covariance[0, 0] > 0:
        covariance[0, 0] = (problem.mass_uncertainty or 0.0) ** 2
    covariance[4:, 4:] += np.outer(estimate.bias, estimate.bias)
    return covariance


def _compared(
    run: Run,
    fit: RunFit,
    y: np.ndarray,
    local: np.ndarray,
    by_estimate: np.ndarray,
    noise: ResidualNoise,
    freedom_of_estimate: float,
) -> HeldOutRun:
    """Return the errors beside their expected values.

    Args:
        run: that is held out.
        fit: with the body held, its lines in SI.
        y: measured less predicted, the run's own unknowns at their means, (m, rows).
        local: their columns, (m, rows, q).
        by_estimate: columns of the estimate's error, its covariance one, (m, rows, k).
        noise: that the others show.
        freedom_of_estimate: degrees of freedom of the estimate's covariance.
    """
    at = noise.at(fit.frequency)
    weighed = np.linalg.solve(at, np.concatenate([local, by_estimate, y[:, :, None]], axis=2))
    q = local.shape[2]
    # generalised least squares of the run's own unknowns, which are then projected out of what is compared
    covariance = inverse(products(local, weighed[:, :, :q]) + np.diag(fit.prior.counted))
    reduced = np.concatenate([by_estimate, y[:, :, None]], axis=2)
    reduced = reduced - local @ (covariance @ products(local, weighed[:, :, q:]))
    moved, errors = reduced[:, :, :-1], reduced[:, :, -1]
    taken = np.einsum("map,pq,maq->ma", local, covariance, local, optimize=True)
    power = np.maximum(np.einsum("maa->ma", at) - taken, 0.0)
    spread = np.einsum("map,maq->apq", moved, moved)
    variance = power.sum(axis=0) + np.einsum("app->a", spread)
    squares = (power**2).sum(axis=0) + 2 * np.einsum("ma,map->a", power, moved**2) + (spread**2).sum(axis=(1, 2))
    # Satterthwaite: (Σ λ)²/Σ λ² degrees of freedom of a sum of squares of variances λ
    freedom, count = variance**2 / np.maximum(squares, 1e-300), len(fit.prediction.signals.t)
    total = (errors**2).sum(axis=0)
    body, chance = _of_body(moved, errors, at, noise, freedom_of_estimate)
    measured = np.hstack([fit.prediction.signals.force, fit.prediction.signals.moment])
    in_band = fit.transformed(measured[:, :, None])[:, :, 0]
    middle, reach = count // 2, max(int(STRETCH / 2 / fit.lines.band / fit.lines.interval), 10)
    shown = slice(max(middle - reach, 0), middle + reach)
    in_time, errors_in_time = (_samples(signal, count)[shown] for signal in (in_band, errors))
    return HeldOutRun(
        file=run.name, rms=np.sqrt(total / count), noise=np.sqrt(power.sum(axis=0) / count),
        of_estimate=np.sqrt(np.einsum("app->a", spread) / count),
        measured_rms=np.sqrt((in_band[1:] ** 2).sum(axis=0) / count), degrees_of_freedom=freedom,
        noise_degrees_of_freedom=np.maximum(noise.freedom, 1.0),
        probability=scipy.special.fdtrc(freedom, noise.freedom, total / variance), body_ratio=body,
        body_probability=chance, t=fit.prediction.signals.t[shown], measured=in_time,
        predicted=in_time - errors_in_time,
    )  # fmt: skip


def _of_body(
    moved: np.ndarray, errors: np.ndarray, at: np.ndarray, noise: ResidualNoise, freedom_of_estimate: float
) -> tuple[float, float]:
    """Return the ratio of the error to its expected size (rms) along the estimate's errors, and its chance.

    With the information ``A`` of the run, the scores ``g = movedᵀ S⁻¹ errors`` have the covariance ``A + A²``. That
    weights come from an estimate of the noise makes the first larger, as it does Hotelling's T² (Anderson 2003, 5.2).
    """
    weighed = np.linalg.solve(at, moved)
    strength, vectors = np.linalg.eigh(products(moved, weighed))
    clear = strength > 1e-9 * max(strength[-1], 1e-300)
    along, strength = vectors[:, clear].T @ products(weighed, errors[:, :, None])[:, 0], strength[clear]
    window, rows = noise.window.mean(), errors.shape[1]
    by_noise = strength * window / max(window - rows - 1, 1.0)
    ratio = float(np.mean(along**2 / (by_noise + strength**2)))
    share = float(np.mean(by_noise / (by_noise + strength**2)))
    freedom = 1 / (share**2 / noise.freedom.sum() + (1 - share) ** 2 / freedom_of_estimate)
    return float(np.sqrt(ratio)), float(scipy.special.fdtrc(len(strength), freedom, ratio))


def _samples(transformed: np.ndarray, count: int) -> np.ndarray:
    """The samples of some lines, the others zero."""
    lines = np.zeros((count, transformed.shape[1]))
    lines[: len(transformed)] = transformed
    return np.asarray(scipy.fft.idct(lines, axis=0, norm="ortho"))
