"""Every estimator's result, judged by force and moment of its runs: causes are named, intervals widened.

In free flight nothing tells the attitude, and no cause can be judged.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from identify.exceptions import RunError
from identify.joint.joint_model import SpecificForce
from identify.joint.priors import Alignment, PriorBlock, Setting, error_blocks
from identify.judge import held_errors
from identify.judge.causes import FollowedCause, Judgement, followed, gyro_axes
from identify.judge.conventions.convention_fit import ImuSignal
from identify.judge.conventions.imu_conventions import in_free_fall
from identify.judge.conventions.removed_weight import LEAST_WEIGHT
from identify.judge.evidence import Evidence
from identify.judge.findings import MATTERS, ROUNDING, Finding, signed
from identify.judge.held_errors import GYRO, by_held_errors
from identify.judge.resonance import lines_of, resonance, saturated
from identify.judge.run_fit import (
    DIFFERENT,
    RunFit,
    fit_run,
    least_squares_cause,
    least_squares_difference,
    tensor_change,
)
from identify.methods.base import Problem
from identify.methods.joint import STILL_WITHIN, beside_alignment, specific_force_source
from identify.results.declaration import ResidualCause
from identify.results.identification_result import Identification
from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE, MOMENTS
from identify.rigid_body.rotation import cumulative_product, exponentials
from identify.signals.band_limited_run import InBand, in_band
from identify.signals.run import Run

WIDENS = 0.2
"""Part of the residuals that a cause explains from which it is worth a warning, too: the interval is wider for it.

Price: an interval 12 % wider than without the cause, ``1 / sqrt(1 - 0.2)``.
"""
UNEXPLAINED = 3.0
"""Ratio of residuals in the motion's band to those above it from which an unnamed cause is reported.

Measured: at most 1.14 in 40 clean runs, above 3 with a body that sloshes (``tests.helpers.judge_margins``).
"""
IMITATED = 1.5
"""Ratio of residuals in the motion's band to those above it from which causes that explain less than ``EXPLAINS``
imitate one that is not looked for.

Measured: 2.0 to 2.1 in five runs with a liquid of 0.03 kg at 1.5 Hz; of clean ones no cause is named.
"""
EXPLAINS = 0.5
"""Part of the residuals that the named causes must explain to come before what none explains.

Choice: half; a body that sloshes at 1.5 Hz leaves more to all causes together.
"""
EQUALLY = 1.2
"""Ratio of residuals with a point at rest to those with the accelerometer below which the base may have one.

Choice: then causes are looked for both ways, which costs time alone.
"""
LOOSE = 1.0
"""Standard uncertainty of a point at rest that is not declared [m].

Prior: wider than any rig.
"""
FORCE_ALONE = ("mass", "force_offset")
"""Unknowns that only the force tells."""
MOST_PERIODS = 5_000
"""Periods of the motion's highest frequency behind which a run is no longer judged.

Choice: half an hour of a motion up to 2.5 Hz; half a gigabyte of memory.
"""
ACCELEROMETER_CAUSES = frozenset({Finding.ACCELEROMETER_PLACE, Finding.ACCELEROMETER_SCALE})
AXES_KEPT = 10.0
"""Seconds over which a gyro keeps axes, whatever its bias.

Choice: a bias of 0.02 rad/s turns them by 0.2 rad, which leaves 98 % of a mean.
"""


def judged(result: Identification, problem: Problem) -> Identification:
    """Return a result with what force and moment of its runs say against it.

    A cause that shifts a component by half its standard uncertainty or more is a warning; the shift counts as a
    standard uncertainty, too, in the covariance, the interval and the budget (``model misfit``).

    Args:
        result: of an estimator.
        problem: that it was given.
    """
    verdicts: list[ResidualCause] = []
    declarations, exact_errors = list(result.declarations), list[list[Evidence]]()
    explained: list[str] = []
    shifts, held = np.zeros(6), None
    if result.seen is None:
        fits = [_fits(run, result, problem) for run in problem.runs]
        for run, run_fits in zip(problem.runs, fits, strict=True):
            named, shift, exact = _of_run(run, result, problem, run_fits)
            verdicts += named
            exact_errors.append(exact)
            shifts += shift / len(problem.runs)
        candidates = [_fit_of_estimator(*pair, result, problem) for pair in zip(problem.runs, fits, strict=True)]
        estimator_fits = [fit for fit in candidates if fit]
        if len(estimator_fits) == len(problem.runs):
            held = by_held_errors(result, problem, estimator_fits)
        errors = [error for error, fit in zip(exact_errors, candidates, strict=True) if fit]
        departing = held_errors.departing_declarations(problem, estimator_fits, errors)
        if result.method != "joint":
            declarations += departing
        elif any(errors):  # an exact quantity that is off has moved the other of the two in the joint estimate
            open_to = {"mass", "r_cg"} - {record.quantity for record in departing}
            explained = [record.text for record in declarations if record.quantity in open_to]
            declarations = [record for record in declarations if record.quantity not in open_to]
    declarations += (held_errors.exact_declaration(cause, problem) for causes in exact_errors for cause in causes)
    texts = [record.text for record in declarations if record not in result.declarations and not record.exact]
    unexplained = [text for text in result.warnings if text not in explained]
    with_causes = replace(
        result,
        declarations=held_errors.farthest(declarations),
        consistency=(*result.consistency, *verdicts),
        warnings=(*unexplained, *texts, *(verdict.text for verdict in verdicts)),
        by_held_errors=held,
    )
    if result.method == "joint" and held is not None:  # the others count them by their source
        with_causes = with_gyro_turns(with_causes, held[GYRO], _declared_turns(problem))
    return with_misfit(with_causes, shifts * result.determined)


def _declared_turns(problem: Problem) -> dict[str, np.ndarray]:
    """One standard uncertainty of each declared turn of the gyro about each axis [rad], in columns, by its source."""
    return {name: error.axes for name, error in problem.errors.items() if error.unknown == "rotation"}


def with_gyro_turns(
    result: Identification, by_turn: Float[np.ndarray, "10 3"], turns: Mapping[str, Float[np.ndarray, "3 q"]]
) -> Identification:
    """Return a joint result that holds declared turns of the gyro, which its model has as turns of the whole IMU.

    Args:
        result: without them.
        by_turn: derivative of the ten parameters by a turn of the gyro against the accelerometer.
        turns: one standard uncertainty of each axis [rad], in columns, by source.
    """
    budget = dict(result.budget or {})
    for name, axes in turns.items():
        changes = by_turn @ axes
        result = result.widened(changes)
        if changes.any():
            budget[name] = np.linalg.norm(changes[4:], axis=1)
    return replace(result, budget=budget or None)


def with_misfit(result: Identification, shift: np.ndarray) -> Identification:
    """Return a result with a shift of its tensor as a further standard uncertainty.

    Args:
        result: without it.
        shift: of each component [kg·m²].
    """
    if not shift.any():
        return result
    middle = result.inertia[:, None]
    reach = np.hypot(result.interval95 - middle, 2 * np.abs(shift)[:, None])
    least = np.where(np.isin(range(6), MOMENTS) & (result.admissible is not None), 0.0, -np.inf)[:, None]
    budget = None if result.budget is None else {**result.budget, "model misfit": np.abs(shift)}
    return replace(
        result, covariance=result.covariance + np.outer(shift, shift),
        interval95=np.maximum(middle + reach * [-1, 1], least), budget=budget, misfit=shift,
    )  # fmt: skip


def _of_run(
    run: Run, result: Identification, problem: Problem, fits: list[RunFit]
) -> tuple[list[ResidualCause], np.ndarray, list[Evidence]]:
    """Verdicts of one run, the sum of the shifts that they stand for, and errors of exact quantities without rival."""
    if not fits:
        return saturated(run), np.zeros(6), []
    axes = np.hstack([np.zeros((3, 0)), *_declared_turns(problem).values()])
    # the fit has a declared turn of the gyro as one of the whole IMU
    bases = [fit.base.absorbing(fit.transformed(gyro_axes(fit.prediction) @ axes)) for fit in fits]
    free = _undeclared(problem, result)
    judgements = [followed(fit, free, base) for fit, base in zip(fits, bases, strict=True)]
    named = _named_once(judgements, result)
    exact = held_errors.exact_quantities(problem)
    best = min(judgements, key=lambda judgement: judgement.unexplained)
    left_over = best.unexplained
    verdicts, total, quantity = saturated(run), np.zeros(6), fits[0].prediction.quantity
    for finding, cause in named.items():
        changes = _changes(cause, result, fits[0], exact.get(finding))
        shift = changes[4:]
        ratio = np.abs(shift) / np.nan_to_num(result.standard_uncertainty).clip(1e-300)
        worst = int(np.argmax(ratio))
        small = ratio[worst] < MATTERS and cause.evidence.share < WIDENS
        if small and left_over < UNEXPLAINED and finding not in exact:
            continue
        moves = f"; it would shift {COMPONENTS[worst]} by {signed(GRAM_METRE * shift[worst])} g·m²"
        text = f"{run.name}: {cause.sentence(quantity)}{moves if ratio[worst] > ROUNDING else ''}"
        axis = int(np.argmax((cause.evidence.explained**2).sum(axis=0)[-3:]))
        share = cause.evidence.share
        verdicts.append(
            finding.verdict(run.name, axis=f"b{axis + 1}", share=share, text=text, changes=tuple(changes.tolist()))
        )
        total = total + shift
    if not named and not verdicts:
        apart = least_squares_difference(fits[-1], bases[-1], np.nan_to_num(result.standard_uncertainty))
        if apart.chance < DIFFERENT:
            verdicts.append(least_squares_cause(apart, run.name))
            total = np.hypot(total, apart.value)
    lines = [] if result.method == "joint" else lines_of(run, result)
    imitated = bool(named) and best.explained <= EXPLAINS
    if left_over > (IMITATED if imitated else UNEXPLAINED):
        # causes that explain little imitate what is not looked for, which then comes first
        verdicts.insert(len(verdicts) if best.explained > EXPLAINS else 0, _unexplained(run, left_over, best.row))
        total = np.hypot(total, left_over * result.standard_uncertainty)
    peak = resonance(run, problem.band)
    if peak is not None:
        motion = fits[0].prediction.signals
        by_mounting = peak.added_to_tensor(motion.omega, motion.alpha, result.inertia)
        lines = lines or [peak.verdict(run, by_mounting)]
        total = np.hypot(total, by_mounting)
    alone = [cause.evidence for finding, cause in named.items() if finding in exact and not cause.rivals]
    return verdicts + lines, total, alone


def _named_once(judgements: Sequence[Judgement], result: Identification) -> dict[Finding, FollowedCause]:
    """Causes that the judgements of a run name, each by the first that does, of those that can err in the result."""
    others = ACCELEROMETER_CAUSES if result.method != "joint" else ()
    named: dict[Finding, FollowedCause] = {}
    for cause in (cause for judgement in judgements for cause in judgement.causes):
        if cause.evidence.cause.finding not in others:
            named.setdefault(cause.evidence.cause.finding, cause)
    return named


def _changes(cause: FollowedCause, result: Identification, fit: RunFit, exact: str | None) -> Float[np.ndarray, "10"]:
    """Changes of the ten parameters of a result by a cause; ``exact``: the quantity that it keeps though this errs."""
    changes = cause.changes.copy()
    if result.method != "joint":
        changes = np.append(np.zeros(4), tensor_change([fit], [1.0], [cause.evidence.added[:, :, None]]))
    if exact is not None:
        changes[{"mass": slice(0, 1), "r_cg": slice(1, 4)}[exact]] = cause.evidence.values
    return changes


def _unexplained(run: Run, left_over: float, row: int) -> ResidualCause:
    """Return the part that no cause explains: root mean square of a row, counted from the last, over its noise."""
    axis, quantity = f"b{row % 3 + 1}", "force" if row < -3 else "moment"
    return Finding.UNEXPLAINED.cause(run.name, axis=axis, share=1 - left_over**-2, quantity=quantity, ratio=left_over)


def _fits(run: Run, result: Identification, problem: Problem) -> list[RunFit]:
    """The run at its best about a point at rest, with its accelerometer, or by the moment about r_CG alone."""
    rows = rows_in_band(run, result, problem)
    if rows is None:
        return []

    def fitted(force_from: SpecificForce, still_within: float = STILL_WITHIN) -> RunFit:
        return fit_run(run, rows, declared_of(run, result, problem, force_from, still_within), start_of(result))

    by_moment = falls(run, result, problem)
    if problem.cg_motion == "still" and not by_moment:
        return [fitted("still")]
    if run.specific_force is None or by_moment:
        return [fitted("none")]
    read, about = fitted("accelerometer"), fitted("still", LOOSE)
    scale = np.repeat([read.level[:3].mean(), read.level[3:].mean()], 3)
    turns = np.linalg.norm(about.level / scale) < EQUALLY * np.linalg.norm(read.level / scale)
    return [about, read] if turns else [read]


def _fit_of_estimator(run: Run, fits: list[RunFit], result: Identification, problem: Problem) -> RunFit | None:
    """The fit whose specific force is from where the estimator has it; None: the run is too short, or falls."""
    force_from = specific_force_source(problem)
    candidates = [fit for fit in fits if fit.prediction.force_from == force_from]
    if not candidates or (force_from == "none" and falls(run, result, problem)):
        return None
    tells_mass = lasting(run, run.force) > LEAST_WEIGHT * np.sqrt(np.mean(run.force**2)) and problem.gravity > 0
    return candidates[0] if force_from != "none" or tells_mass else None


def rows_in_band(run: Run, result: Identification, problem: Problem) -> InBand | None:
    """Return the run in its band, the first :data:`MOST_PERIODS` of it; None: it is too short."""
    longest = MOST_PERIODS / problem.band
    if run.t[-1] - run.t[0] > longest:
        run = run.between(run.t[0], run.t[0] + longest)
    delay = 0.0 if result.delay is None else abs(float(result.delay.value[0]))
    declared = [error for error in problem.errors.values() if error.unknown == "delay"]
    reach = sum(abs(error.mean[0]) + 4 * np.sqrt(error.covariance[0, 0]) for error in declared)
    try:
        return in_band(run, problem.band, reach=max(delay, reach) + 0.005, accelerometer=run.specific_force is not None)
    except RunError:
        return None


def _undeclared(problem: Problem, result: Identification) -> frozenset[str]:
    """Unknowns of which so little is declared that an error of them is no news."""
    free = {"mass"} if problem.mass is None and problem.centre is None else set()
    if problem.cg_motion != "still":
        free.add("cg_from_still")
    return frozenset(free | ({"delay", "rotation"} if result.method == "joint" else set()))


def declared_of(
    run: Run,
    result: Identification,
    problem: Problem,
    force_from: SpecificForce,
    still_within: float = STILL_WITHIN,
) -> Setting:
    """Return the priors of a run's unknowns.

    Args:
        run: the run.
        result: of an estimator.
        problem: that it was given.
        force_from: source of the specific force.
        still_within: standard uncertainty of a point at rest, where the specific force is from there [m].
    """
    alignment, errors = problem.alignment or Alignment(), problem.errors
    if result.delay is None:
        alignment = replace(alignment, delay=0.0, sigma_delay=0.0, rotation=(0.0, 0.0, 0.0), sigma_rotation=0.0)
    else:
        errors = beside_alignment(errors)
    weighed = float(np.linalg.norm(run.force.mean(axis=0))) / problem.gravity if problem.gravity > 0 else 0.0
    mass = result.mass or weighed or 1.0  # which the moment about r_CG does not ask for
    mass_variance, cg_covariance = (problem.mass_uncertainty or 0.0) ** 2, np.diag(problem.sigma_r_cg**2)
    flat = ["inertia", "force_offset", "moment_offset"]
    if problem.centre is not None:
        mass_variance, cg_covariance = problem.centre.covariance[0, 0], problem.centre.covariance[1:4, 1:4]
    elif problem.mass is None:
        flat.append("mass")
        mass_variance = 1.0
    blocks = {
        ("mass",): PriorBlock(np.array([mass]), np.array([[mass_variance]])),
        ("r_cg",): PriorBlock(problem.r_cg, cg_covariance),
        ("force_offset",): PriorBlock(np.zeros(3), np.eye(3)),
        ("moment_offset",): PriorBlock(np.zeros(3), np.eye(3)),
        ("cg_from_still",): PriorBlock(np.zeros(3), still_within**2 * (force_from == "still") * np.eye(3)),
    }
    if force_from == "none":  # the moment about r_CG tells neither the mass nor the force's offset
        flat = ["inertia", "moment_offset"]
        blocks |= {(name,): PriorBlock(blocks[name,].mean, 0 * blocks[name,].covariance) for name in FORCE_ALONE}
    return Setting(
        blocks=blocks | error_blocks(errors), alignment=alignment, band=problem.band, specific_force=force_from,
        gravity=problem.gravity, flat=tuple(flat),
    )  # fmt: skip


def start_of(result: Identification) -> dict[str, np.ndarray]:
    """Return an estimate, from which the search for a run's unknowns starts."""
    aligned = {"delay": result.delay, "rotation": result.rotation}
    return {"inertia": result.inertia, "r_cg": result.r_cg} | {
        name: part.value for name, part in aligned.items() if part is not None
    }


def falls(run: Run, result: Identification, problem: Problem) -> bool:
    """Return whether a run shows no weight, or no force at all.

    An accelerometer tells it by itself: a force without the weight that it shows is an error, to be judged.
    """
    if not np.abs(run.force).max() > 0:
        return True
    read = run.specific_force
    if read is not None and lasting(run, read) < LEAST_WEIGHT * problem.gravity:
        return in_free_fall(ImuSignal(run.t, run.omega, read))  # or the gyro is wrong
    mass = problem.mass or result.mass
    needed = read is None or problem.cg_motion == "still"
    return bool(needed and mass is not None and lasting(run, run.force) < LEAST_WEIGHT * mass * problem.gravity)


def lasting(run: Run, vectors: Float[np.ndarray, "n 3"]) -> float:
    """Return the size of what stays of a vector: of its mean in B, or in axes that the gyro keeps, if that is larger.

    On a robot arm, which turns the body all ways, gravity has hardly a mean in B.
    """
    count, squares, samples = max(round(AXES_KEPT * run.rate), 1), 0.0, 0
    for segment in run.used():
        omega, values = run.omega[segment], vectors[segment]
        for first in range(0, len(values), count):
            part = slice(first, first + count)
            attitude = cumulative_product(exponentials(omega[part] / run.rate))
            mean = np.einsum("nij,nj->i", attitude, values[part]) / len(attitude)
            squares, samples = squares + len(attitude) * float(mean @ mean), samples + len(attitude)
    in_body = float(np.linalg.norm(vectors.mean(axis=0)))
    return max(in_body, float(np.sqrt(squares / samples)) if samples else 0.0)
