"""Effects of errors that are neither declared nor estimated, at typical figures: conventional bounds of runs and poses.

By the derivatives of the estimate that was made: of least squares those of type B
(:mod:`uq.runs.identification.systematic_errors`), of the joint estimate and for the mounting's flexibility those of
:mod:`identify.judge.held_errors`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from identify.display.rounding import exact
from identify.errors.registry import ERRORS
from identify.estimation.joint.priors import STATIC, ConstantError
from identify.estimation.methods.base import estimator_of
from identify.estimation.static_poses.centre_result import Centre
from identify.exceptions import RunError
from identify.judge.held_errors import BESIDE
from identify.results.declaration import ResidualCause
from identify.results.identification_result import Identification
from identify.results.ledger import Ledger, Row
from identify.signals.run import Run
from uq.experiment.experiment import Experiment
from uq.experiment.typical_errors import figures_of, is_common, typical_errors
from uq.runs.identification.centre_errors import ON_POSES, wrench_error
from uq.runs.identification.estimated_errors import estimated_errors
from uq.runs.identification.systematic_errors import OF_MASS_AND_CENTRE, SystematicProblem, equations, problem_of
from uq.sources.constant_errors import errors_of
from uq.sources.recorded_kinds import ErrorByAct
from uq.sources.source import Source, kind_of

NEGLIGIBLE = 1e-9
"""Part of the mass, of a metre and of the moments of inertia below which an error adds nothing: rounding."""
PRICE = 0.1
"""Part by which a cause must widen the conventional bound to be a warning.

Price: stated as such. What a result takes as exact is not widened: there the bound must hold the cause.
"""
REPLACED_BY_CAUSE = {error.label: error.name for error in ERRORS.values() if error.replaced_by_cause}
"""Errors whose value in the runs, with its uncertainty, takes the place of their typical size in the tensor.

By the finding's label; that of late gyro axes is the delay's. Not gains, cross-talk and axes of the load cell: runs
show a part of their numbers, and typical sizes hold the others. Not mass and centre of gravity, which the result keeps
as they are stated.
"""
STEP = 0.01
"""Step of the finite differences, in standard uncertainties."""
METRE = Source(name="centre_of_gravity", target="r_cg", kind="bias", group="undeclared", sigma=np.ones(3))
"""A centre of gravity that is off by 1 m on each axis: the tensor's derivative by it, since the tensor is linear."""


def with_undeclared(
    result: Identification, runs: Sequence[Run], experiment: Experiment, centre: Centre | None = None
) -> Identification:
    """Return a result with the errors that its 95 % intervals leave out, where its derivatives are known.

    The same errors of the same rig have made the static poses' mass and centre of gravity wrong: both effects of one
    error add with their signs.

    Args:
        result: of these runs, with the declared sources.
        runs: the runs, in the result's order.
        experiment: its sources, and the typical figures.
        centre: the static poses that its mass and centre of gravity are from; None: they are stated.
    """
    by_held = result.by_held_errors or {}
    if result.seen is not None or (result.method == "joint" and not by_held):
        return result
    undeclared = typical_errors(experiment, largest_wrench(runs))
    pose_rows = () if centre is None or centre.undeclared is None else centre.undeclared.rows
    if centre is not None or np.any(result.sigma_r_cg > 0):
        sources = tuple(source for source in undeclared.sources if source.perturbs != "r_cg")
        undeclared = replace(undeclared, sources=(*sources, *[METRE] * bool(pose_rows)))
    changes: dict[str, np.ndarray] = {}
    if result.method == "joint":
        changes |= _of_joint(by_held, undeclared)
    elif undeclared.sources:
        try:
            changes |= _of_least_squares(result, runs, undeclared)
        except RunError:  # too short for a delay
            return result
    declared = {(source.target, source.kind) for source in experiment.sources}
    for error, figure in figures_of(experiment):
        drawn = error.declared_as is not None and not isinstance(kind_of(*error.declared_as), ErrorByAct)
        if error in BESIDE and not drawn and error.declared_as not in declared and error.name in by_held:
            changes[error.name] = by_held[error.name] @ error.typical_numbers(figure)
    table = experiment.undeclared
    if result.mass is not None and not result.parameters.standard_uncertainty[0] > 0 and table.mass is not None:
        changes["mass"] = _of_mass(table.mass * result.mass, by_held)
    if pose_rows:
        by_centre = _of_prior(by_held) if result.method == "joint" else _by_centre(changes.pop(METRE.name))
        for row in pose_rows:
            change = by_centre @ row.changes
            if changes.get(row.error, change).shape != change.shape:
                raise RunError(f"{row.error} of the static poses has other numbers: run `inertia centre` again")
            changes[row.error] = changes.get(row.error, 0.0) + change
    size = np.repeat([result.mass or 1.0, 1.0, np.abs(result.inertia).max()], [1, 3, 6])
    typical = typical_rows(changes, size, experiment, pose_rows)
    causes = noted(result, typical)
    named = {REPLACED_BY_CAUSE.get(cause.cause) for cause in result.consistency}
    # what a named cause does to the tensor is a row already; not what it does to mass and centre of gravity
    beside_causes = [row.changed(OF_MASS_AND_CENTRE) if row.error in named else row for row in typical.rows]
    notes = {cause.text for cause in causes if cause.note}
    added = [row for row in beside_causes if row.changes.any()]
    return replace(
        result, ledger=result.ledger.in_intervals.joined(added), looked_at_undeclared=True, consistency=causes,
        warnings=tuple(text for text in result.warnings if text not in notes),
    )  # fmt: skip


def noted(result: Identification, typical: Ledger) -> tuple[ResidualCause, ...]:
    """Return a result's causes; those are notes, and no warnings, that the bound holds at typical size.

    Args:
        result: without errors of typical size.
        typical: these.
    """
    half = result.coverage_factors * result.parameters.standard_uncertainty
    bound, causes = typical.half_width(half), []
    for cause in result.consistency:
        # a shift counts as a standard uncertainty, and what it explains widens what the residuals show
        seen = np.where(np.isfinite(half), half, 0.0)
        added = 4 * np.square(cause.changes or np.inf) + cause.share * seen**2
        allowed = np.where(half > 0, (1 - (1 + PRICE) ** -2) * bound**2, 4 * bound**2)
        causes.append(cause._replace(note=not (added > allowed).any()))  # NaN: a mass that is not known
    return tuple(causes)


def typical_rows(
    changes: Mapping[str, Float[np.ndarray, "10 k"]],
    size: Float[np.ndarray, "10"],
    experiment: Experiment,
    pose_rows: Sequence[Row] = (),
) -> Ledger:
    """Return errors with their words and figures, without those that add nothing.

    Args:
        changes: of ten parameters, by the error's key in ``[undeclared]``.
        size: of the parameters.
        experiment: the typical figures.
        pose_rows: errors of static poses, whose figures count where the experiment says that there is no such error.
    """
    figures, rows = {row.error: row.figure for row in pose_rows}, []
    for name, value in experiment.undeclared.to_dict().items():
        size_of = ERRORS[name].typical
        if size_of and name in changes and np.any(np.abs(changes[name]) > NEGLIGIBLE * size[:, None]):
            figure = figures[name] if value is None else f"{exact([size_of.per_si * value])[0]} {size_of.unit}"
            rows.append(
                Row(error=name, key=f"typical {name}", text=size_of.text, figure=figure, changes=changes[name],
                    tier="typical", signed=size_of.signed)
            )  # fmt: skip
    return Ledger(tuple(rows))


def largest_wrench(runs: Sequence[Run]) -> tuple[float, float]:
    """Return the largest recorded force [N] and moment [N·m] on any axis."""
    force, moment = (max(float(np.abs(getattr(run, name)).max()) for run in runs) for name in ("force", "moment"))
    return force, moment


def numbers_of(name: str, error: ConstantError) -> Float[np.ndarray, "p k"]:
    """Return one standard uncertainty of each independent number of an undeclared error, in columns.

    In the order of the source's axes, so that effects of one error on poses and on runs can be added.
    """
    return np.sqrt(np.diag(error.covariance))[:, None] if ERRORS[name].count == 1 else error.axes


def _by_centre(tensor_by_metre: np.ndarray) -> Float[np.ndarray, "10 10"]:
    """Derivative of the ten parameters of least squares by the values of static poses."""
    by_centre = np.zeros((10, 10))
    by_centre[:4, :4] = np.eye(4)
    by_centre[4:, 1:4] = tensor_by_metre[4:]
    return by_centre


def _of_prior(by_held: Mapping[str, np.ndarray]) -> Float[np.ndarray, "10 10"]:
    """Derivative of the ten parameters of the joint estimate by the values of static poses, which are its prior.

    A prior that is off by one is a truth that is off by minus one: what the runs make of that comes off.
    """
    by_prior = -np.hstack([by_held[name] for name in STATIC])
    by_prior[:4, :4] += np.eye(4)
    return by_prior


def _of_mass(sigma: float, by_held: Mapping[str, np.ndarray]) -> Float[np.ndarray, "10 1"]:
    """Change by a mass that is larger by ``sigma`` [kg] than the stated one, which the result keeps."""
    change = np.zeros((10, 1))
    if "mass" in by_held:
        change += sigma * by_held["mass"]
    change[0] = -sigma
    return change


def _of_joint(by_held: Mapping[str, np.ndarray], undeclared: Experiment) -> dict[str, np.ndarray]:
    """Return each error's change of the ten parameters, but for a delay: it is an unknown, or declared exact."""
    changes = {
        name: by_held[error.unknown] @ numbers_of(name, error)
        for name, error in estimated_errors(undeclared, 1.0).items()
        if error.unknown in by_held
    }
    for source in undeclared.sources:
        if source.perturbs == "r_cg" and source is not METRE:  # the result keeps the stated centre
            changes[source.name] = (by_held["r_cg"] - np.eye(10)[:, 1:4]) * source.sigma
    return changes


def _of_least_squares(result: Identification, runs: Sequence[Run], undeclared: Experiment) -> dict[str, np.ndarray]:
    """Return each error's change of the tensor, and of the centre of gravity where that errs."""
    problem = problem_of(result, runs, undeclared, slopes=True)
    if not problem.sources:  # gravity alone is open, to which least squares are blind
        return {}
    estimates, changes = estimator_of(result.method).estimates, {}
    for source, change in zip(problem.sources, tensor_changes(problem).values(), strict=True):
        if source.perturbs not in estimates:
            centre = np.diag(source.sigma) if source.perturbs == "r_cg" else np.zeros((3, change.shape[1]))
            changes[source.name] = np.vstack([np.zeros((1, change.shape[1])), centre, change])
    return changes


def tensor_changes(problem: SystematicProblem) -> dict[str, Float[np.ndarray, "6 k"]]:
    """Return the tensor's change by one standard uncertainty of each independent number of each undeclared error.

    By central differences in NumPy: within 1e-8 of autodiff, and done before JAX would have traced it.

    Args:
        problem: with sources of :func:`uq.experiment.typical_errors.typical_errors`.
    """

    def tensor(source: Source, draw: np.ndarray) -> np.ndarray:
        errors = errors_of([source], {source.name: draw.reshape(np.shape(source.sigma)) * source.sigma})
        return np.linalg.solve(*equations(problem, [errors] * len(problem.sums)))

    changes = {}
    for source in problem.sources:
        count = np.size(source.sigma)
        # one number errs on all axes, or each by itself
        steps = STEP * (np.ones((1, count)) if is_common(ERRORS[source.name], source.sigma) else np.eye(count))
        changes[source.name] = np.stack([tensor(source, step) - tensor(source, -step) for step in steps], 1) / (
            2 * STEP
        )
    return changes


def centre_with_undeclared(
    centre: Centre,
    experiment: Experiment,
    *,
    wrench: Float[np.ndarray, "n 6"],
    specific_force: Float[np.ndarray, "n 3"],
    sensed: bool,
) -> Centre:
    """Return a centre with the errors that its 95 % intervals leave out.

    The load cell's axes count where ``sigma_alignment`` does not declare how far the attitude's are off from them.

    Args:
        centre: of these poses, not read from a file.
        experiment: its sources, and the typical figures.
        wrench: of each pose, whose largest force and moment are the full scale [N, N·m].
        specific_force: of each pose, opposite to gravity [m/s²].
        sensed: whether an accelerometer tells the attitude.
    """
    largest = float(np.abs(wrench[:, :3]).max()), float(np.abs(wrench[:, 3:]).max())
    weight = _wrench(centre, specific_force)
    aligned = experiment.poses is not None and experiment.poses.sigma_alignment > 0
    errors = {}
    for name, error in estimated_errors(typical_errors(experiment, largest), 0.0).items():
        if error.unknown in ON_POSES and not (aligned and name == "load_cell_axes"):
            columns = numbers_of(name, error).T
            errors[name] = [wrench_error(error.unknown, axis, weight, experiment.gravity) for axis in columns]
    scale = experiment.undeclared.accelerometer_scale
    if sensed and scale is not None:
        up = specific_force / np.linalg.norm(specific_force, axis=1, keepdims=True)
        for_axes = [scale * specific_force * axis for axis in np.eye(3)]
        across = [change - up * np.sum(up * change, axis=1, keepdims=True) for change in for_axes]
        errors["accelerometer_scale"] = [-_wrench(centre, change) for change in across]
    by_wrench = np.asarray(centre.by_wrench)
    changes = {name: np.einsum("pnc,knc->pk", by_wrench, np.array(by_axis)) for name, by_axis in errors.items()}
    size = np.repeat([centre.mass, 1.0, centre.mass * centre.gravity], [1, 3, 6])
    return replace(centre, undeclared=typical_rows(changes, size, experiment))


def _wrench(centre: Centre, specific_force: np.ndarray) -> Float[np.ndarray, "n 6"]:
    """Return the weight's wrench about Q under a specific force."""
    force = centre.mass * specific_force
    return np.hstack([force, np.cross(centre.r_cg, force)])
