"""Effects of errors of the rig that an estimate takes as zero: its derivative by each of them.

Of the joint estimate: the normal equations of its unknowns under their priors, weighed as it weighs them, with the
errors' signals on the other side. Of least squares only what no declared source can be, as the mounting's flexibility;
the rest has the derivatives of type B (:mod:`uq.runs.identification.systematic_errors`).

Quantities that the estimator takes as declared are compared with the runs.
"""

from collections.abc import Iterable, Sequence

import numpy as np
from jaxtyping import Float

from identify.errors.body import centre_of_gravity
from identify.errors.body.centre_of_gravity import CENTRE_OF_GRAVITY
from identify.errors.body.mass import MASS
from identify.errors.error_model import CELL_MATRIX, ErrorModel
from identify.errors.registry import ERRORS
from identify.estimation.joint.error_columns import ErrorColumns
from identify.estimation.joint.joint_model import TEN
from identify.estimation.joint.joint_pooling import shared_unknowns
from identify.estimation.joint.predicted_wrench import Columns, PredictedWrench
from identify.estimation.joint.prior_departure import FAR, declaration, departures
from identify.estimation.joint.priors import STATIC, indices
from identify.estimation.methods.base import Problem
from identify.judge.causes import FollowedCause
from identify.judge.run_fit import RunFit, TensorSums, pooled_tensor, tensor_sums
from identify.least_squares.row_products import eliminated, products, solution
from identify.results.declaration import Declaration
from identify.results.identification_result import Identification

HELD = ("gyro_scale", "cell_matrix", *STATIC, "gravity")
"""Unknowns of the joint model that an estimate may take as exact, or from static poses."""
BESIDE = [error for error in ERRORS.values() if error.typical and not error.by_hand and error.unknowns != CELL_MATRIX]
"""Errors of a typical size that are no unknown of the joint model, or not as it has them."""
OF_LEAST_SQUARES = [error for error in BESIDE if error.part != "accelerometer"]
"""Errors of these that least squares know."""


def held_name(error: ErrorModel) -> str:
    """Return the name of an error's derivatives: of the unknown by which the joint estimate has it, or its own."""
    return error.unknowns[0] if error.unknowns else error.name


def by_held_errors(result: Identification, problem: Problem, fits: Sequence[RunFit]) -> dict[str, np.ndarray]:
    """Return the derivatives of the ten parameters (mass, r_CG, tensor) by errors that count as zero, (10, p) each.

    By unknown of :data:`identify.estimation.joint.joint_model.SIZES` in SI, and by :func:`held_name` of errors beside
    them.

    Args:
        result: of an estimator.
        problem: that it was given.
        fits: of each run, at its best under the same priors, its specific force from where the estimator has it.
    """
    if result.method != "joint":
        sums = [fit.beside or sums_beside(fit, offsets=result.offsets == "estimate") for fit in fits]
        change = pooled_tensor(sums, [run.weight for run in result.runs])
        ends = np.cumsum([error.count for error in OF_LEAST_SQUARES])[:-1]
        return {
            error.name: np.vstack([np.zeros((4, error.count)), part])
            for error, part in zip(OF_LEAST_SQUARES, np.split(change, ends, axis=1), strict=True)
        }
    held = [_held(fit.prediction) for fit in fits]
    added = [
        fit.transformed(np.concatenate(list(blocks.values()), axis=2)) for fit, blocks in zip(fits, held, strict=True)
    ]
    shared = _shared(problem)
    shift = pooled_change(fits, added, shared)[indices(TEN)]
    sizes = [columns.shape[2] for columns in held[0].values()]
    return dict(zip(held[0], np.split(shift, np.cumsum(sizes)[:-1], axis=1), strict=True))


def sums_beside(fit: RunFit, *, offsets: bool) -> TensorSums:
    """Return a run's sums of least squares with the errors that are no unknowns, one after another.

    Args:
        fit: of the run.
        offsets: whether constant offsets are estimated along.
    """
    run = ErrorColumns(fit.prediction)
    columns = np.concatenate([run.columns(error) for error in OF_LEAST_SQUARES], axis=2)
    return tensor_sums(fit, columns, offsets=offsets)


def _shared(problem: Problem) -> set[str]:
    return shared_unknowns(
        problem.errors, calibrated=problem.centre is not None, drawn_by_mounting=problem.drawn_by_mounting
    )


def _held(run: PredictedWrench) -> dict[str, Columns]:
    columns_by_act, reads = ErrorColumns(run), run.force_from == "accelerometer"
    columns = {name: run.derivative(name) for name in HELD}
    return columns | {
        held_name(error): columns_by_act.columns(error) for error in BESIDE if reads or error.part != "accelerometer"
    }


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
    # Schur complement of each run's own unknowns; then the normal equations of what all share add up
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


TYPICAL_CENTRE = centre_of_gravity.TYPICAL.figure
MASS_DECLARED_EXACT = 0.005
"""Standard uncertainty over the mass that a mass declared without one counts with.

Prior: typical gains of force and accelerometer, error of gravity and of a scale together, as `[undeclared]` has them.
"""


def exact_quantities(problem: Problem) -> dict[ErrorModel, str]:
    """Return the unknowns that are declared without a standard uncertainty, by the finding that blames them."""
    exact = {}
    if problem.centre is None and problem.mass is not None and not problem.mass_uncertainty:
        exact[MASS] = "mass"
    if problem.centre is None and not problem.sigma_r_cg.any():
        exact[CENTRE_OF_GRAVITY] = "r_cg"
    return exact


def exact_declaration(cause: FollowedCause, problem: Problem) -> Declaration:
    """Return the record of the exact quantity that a cause blames."""
    name = exact_quantities(problem)[cause.candidate.error]
    declared = problem.r_cg if name == "r_cg" else np.array([problem.mass])
    sigma = TYPICAL_CENTRE if name == "r_cg" else MASS_DECLARED_EXACT * float(declared[0])
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
    prior, explained = fits[0].prior, [(cause, cause.columns(fits)) for cause in exact_errors]
    rows = [
        (fit.residuals + fit.columns @ fit.best)[:, :, None]
        - sum(
            fit.transformed((columns[number] @ cause.evidence.coefficients)[:, :, None]) for cause, columns in explained
        )
        for number, fit in enumerate(fits)
    ]
    shared = _shared(problem)
    theta = prior.mean + pooled_change(fits, rows, shared)[:, 0]
    names = {"mass", "r_cg", *(error.unknown for error in problem.errors.values() if error.shared)}
    return departures(theta, prior, names)


def farthest(declarations: Iterable[Declaration]) -> tuple[Declaration, ...]:
    """Return the record of each quantity that is farthest from what was declared, if it is far."""
    ordered = sorted(declarations, key=lambda record: record.distance)
    return tuple({record.quantity: record for record in ordered if record.distance > FAR}.values())
