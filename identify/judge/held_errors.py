"""Effects of errors of the rig that an estimate takes as zero: its derivative by each of them.

Of the joint estimate: the normal equations of its unknowns under their priors, weighed as it weighs them, with the
errors' signals on the other side. Of least squares only what no declared source can be, the mounting's flexibility; the
rest has the derivatives of type B (:mod:`uq.identification.systematic_errors`).

Quantities that the estimator takes as declared are compared with the runs.
"""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from identify.joint.joint_model import TEN
from identify.joint.joint_pooling import shared_unknowns
from identify.joint.predicted_wrench import Columns, PredictedWrench
from identify.joint.prior_departure import FAR, declaration, departures
from identify.joint.priors import STATIC, indices
from identify.judge.causes import FollowedCause, accelerometer_place, accelerometer_scale, derivative, gyro_axes
from identify.judge.findings import Cause
from identify.judge.run_fit import RunFit, tensor_change
from identify.judge.typical_sizes import TYPICAL
from identify.methods.base import Problem
from identify.results.declaration import Declaration
from identify.results.identification_result import Identification
from identify.sums.row_products import eliminated, products, solution

GYRO = "rotation"
"""Unknown of the IMU's turn, which the joint estimate finds: as an error that it takes as zero, the gyro's alone."""
HELD = ("gyro_scale", "cell_matrix", *STATIC, "gravity")
"""Unknowns of :data:`identify.joint.joint_model.SIZES` that an estimate may take as exact, or from static poses."""
FLEXIBILITY = "flexibility"
"""Unknown of the mounting's flexibility about each axis: the body's angular frequency on it, to the power −2 [s²]."""
ACCELEROMETER_ERRORS = {"accelerometer_scale": accelerometer_scale, "accelerometer_place": accelerometer_place}
"""Functions that give what relative errors of its scale factors, and a metre of its place, add to the wrench."""


def by_held_errors(result: Identification, problem: Problem, fits: Sequence[RunFit]) -> dict[str, np.ndarray]:
    """Return the derivatives of the ten parameters (mass, r_CG, tensor) by errors that count as zero, (10, p) each.

    By unknown of :data:`identify.joint.joint_model.SIZES` in SI, :data:`FLEXIBILITY`, :data:`GYRO`,
    :data:`ACCELEROMETER_ERRORS`.

    Args:
        result: of an estimator.
        problem: that it was given.
        fits: of each run, at its best under the same priors, its specific force from where the estimator has it.
    """
    if result.method != "joint":
        added, weights = [flexing(fit.prediction) for fit in fits], [run.weight for run in result.runs]
        change = tensor_change(fits, weights, added, offsets=result.offsets == "estimate")
        return {FLEXIBILITY: np.vstack([np.zeros((4, 3)), change])}
    held = [_held(fit.prediction) for fit in fits]
    added = [
        fit.transformed(np.concatenate(list(blocks.values()), axis=2)) for fit, blocks in zip(fits, held, strict=True)
    ]
    shared = _shared(problem)
    shift = pooled_change(fits, added, shared)[indices(TEN)]
    sizes = [columns.shape[2] for columns in held[0].values()]
    return dict(zip(held[0], np.split(shift, np.cumsum(sizes)[:-1], axis=1), strict=True))


def _shared(problem: Problem) -> set[str]:
    return shared_unknowns(
        problem.errors, calibrated=problem.centre is not None, drawn_by_mounting=problem.drawn_by_mounting
    )


def _held(run: PredictedWrench) -> dict[str, Columns]:
    columns = {name: run.derivative(name) for name in HELD} | {FLEXIBILITY: flexing(run), GYRO: gyro_axes(run)}
    if run.force_from == "accelerometer":
        columns |= {name: signals(run) for name, signals in ACCELEROMETER_ERRORS.items()}
    return columns


def flexing(run: PredictedWrench) -> Columns:
    """Return what the body's turning on its mounting adds to the wrench, a unit of :data:`FLEXIBILITY` about each axis.

    The moment M about Q turns the body by −M / (I_Q ω₀²) from its attitude at rest; load cell and IMU do not turn.
    """
    s, r, unit = run.signals, run.x["r_cg"], np.eye(3)
    about_q = run.x["inertia"][[0, 3, 5]] + run.x["mass"] * (r @ r - r**2)
    moment = run.wrench[:, 3:]
    turn = -(moment - moment.mean(axis=0)) / about_q
    signals = turn, derivative(run, turn, 1), derivative(run, turn, 2)
    angle, rate, acceleration = (signal[:, :, None] * unit for signal in signals)

    def crossed(columns: np.ndarray, vectors: np.ndarray) -> np.ndarray:
        return np.cross(columns, vectors[:, :, None], axis=1)

    from_q = replace(run.model, specific_force="accelerometer", imu_position=np.zeros(3))  # the lever is that from Q
    about = PredictedWrench(from_q, run.theta)
    at_q = run.specific_force - s.levers @ r
    on_body = about.changed(
        rate - crossed(angle, s.omega),
        acceleration - crossed(angle, s.alpha) - crossed(rate, s.omega),
        -crossed(angle, at_q),
    )
    turned = [crossed(angle, run.wrench[:, rows]) for rows in (slice(0, 3), slice(3, 6))]
    return np.asarray(on_body + np.concatenate(turned, axis=1))


def pooled_change(
    fits: Sequence[RunFit], added: Sequence[np.ndarray], shared: set[str]
) -> Float[np.ndarray, "count p"]:
    """Return the change of the shared unknowns by columns that are added to the lines of each run.

    Args:
        fits: of the runs, under one prior.
        added: columns of each run, (m, rows, p).
        shared: names of the unknowns that are the same in all; the others change by none.
    """
    prior = fits[0].prior
    common = prior.root[indices(shared)].any(axis=0)
    precision = np.diag(np.where(common, 0.0, prior.counted))
    reduced = [
        eliminated(
            fit.weights @ products(fit.columns, fit.columns) + precision,
            fit.weights @ products(fit.columns, columns),
            common,
        )
        for fit, columns in zip(fits, added, strict=True)
    ]
    normal = np.diag(prior.counted[common]) + np.sum([run.matrix for run in reduced], axis=0)
    right = np.sum([run.right for run in reduced], axis=0)
    return np.asarray(prior.root[:, common] @ solution(normal, right))


TYPICAL_MASS = 0.005
"""Standard uncertainty over the mass that a mass declared without one counts with.

Prior: typical gains of force and accelerometer, error of gravity and of a scale together, as `[undeclared]` has them.
"""


def exact_quantities(problem: Problem) -> dict[Cause, str]:
    """Return the unknowns that are declared without a standard uncertainty, by the finding that blames them."""
    exact = {}
    if problem.centre is None and problem.mass is not None and not problem.mass_uncertainty:
        exact[Cause.MASS] = "mass"
    if problem.centre is None and not problem.sigma_r_cg.any():
        exact[Cause.CENTRE] = "r_cg"
    return exact


def exact_declaration(cause: FollowedCause, problem: Problem) -> Declaration:
    """Return the record of the exact quantity that a cause blames."""
    name = exact_quantities(problem)[cause.candidate.finding]
    declared = problem.r_cg if name == "r_cg" else np.array([problem.mass])
    sigma = TYPICAL["centre_of_gravity"] if name == "r_cg" else TYPICAL_MASS * float(declared[0])
    change = cause.evidence.values
    worst = int(np.argmax(np.abs(change)))
    return declaration(name, worst, declared[worst] + change[worst], declared[worst], sigma, exact=True)


def departing_declarations(
    problem: Problem, fits: Sequence[RunFit], exact_errors: Sequence[FollowedCause]
) -> tuple[Declaration, ...]:
    """Return the quantities declared with an uncertainty that the runs place elsewhere, by one fit of all of them.

    Args:
        problem: runs, and what is declared.
        fits: of the runs, each at its best under the same prior.
        exact_errors: causes that blame exact quantities: what they explain counts as explained.
    """
    if not fits:
        return ()
    prior = fits[0].prior
    rows = [
        (fit.residuals + fit.columns @ fit.best)[:, :, None]
        - sum(
            fit.transformed((cause.columns[number] @ cause.evidence.coefficients)[:, :, None]) for cause in exact_errors
        )
        for number, fit in enumerate(fits)
    ]
    shared = _shared(problem)
    theta = prior.mean + pooled_change(fits, rows, shared)[:, 0]
    names = {"mass", "r_cg", *(error.unknown for error in problem.errors.values() if error.shared)}
    return departures(theta, prior, names)


def farthest(declarations: Iterable[Declaration]) -> tuple[Declaration, ...]:
    """Return of each quantity the record that is farthest from what was declared, if it is far."""
    ordered = sorted(declarations, key=lambda record: record.distance)
    return tuple({record.quantity: record for record in ordered if record.distance > FAR}.values())
