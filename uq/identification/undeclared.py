"""Effects on a result of errors that are neither declared nor estimated, at typical figures: its second interval.

By the derivatives of the estimate that was made: of least squares those of type B
(:mod:`uq.identification.systematic_errors`), of the joint estimate and for the mounting's flexibility those of
:mod:`identify.judge.held_errors`.
"""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from identify.exceptions import RunError
from identify.joint.priors import root_of
from identify.judge.held_errors import ACCELEROMETER_SCALE, FLEXIBILITY
from identify.methods.base import estimator_of
from identify.results.identification_result import Identification
from identify.results.undeclared import Effect, Undeclared
from identify.rounding import exact
from identify.signals.run import Run
from uq.experiment.experiment import Experiment
from uq.experiment.typical_errors import KINDS, Kind, typical_errors
from uq.identification.estimated_errors import estimated_errors
from uq.identification.systematic_errors import SystematicProblem, equations, problem_of
from uq.sources.constant_errors import errors_of
from uq.sources.source import Source

NEGLIGIBLE = 1e-9
"""Part of the mass, of a metre and of the moments of inertia below which an error adds nothing: rounding."""
STEP = 0.01
"""Step of the finite differences, in standard uncertainties."""


def with_undeclared(result: Identification, runs: Sequence[Run], experiment: Experiment) -> Identification:
    """Return a result with the errors that its first intervals leave out, where its derivatives are known.

    Args:
        result: of these runs, with the declared sources.
        runs: the runs, in the result's order.
        experiment: its sources, and the typical figures.
    """
    by_held = result.by_held_errors or {}
    if result.seen is not None or (result.method == "joint" and not by_held):
        return result
    undeclared = typical_errors(experiment, largest_wrench(runs))
    if np.any(result.sigma_r_cg > 0):
        sources = tuple(source for source in undeclared.sources if source.perturbs != "r_cg")
        undeclared = replace(undeclared, sources=sources)
    changes: dict[str, np.ndarray] = {}
    if result.method == "joint":
        changes |= _of_joint(by_held, undeclared)
    elif undeclared.sources:
        try:
            changes |= _of_least_squares(result, runs, undeclared)
        except RunError:  # too short for a delay
            return result
    table = experiment.undeclared
    if FLEXIBILITY in by_held and table.mounting_frequency is not None:
        natural = 2 * np.pi * table.mounting_frequency
        changes["mounting_frequency"] = by_held[FLEXIBILITY].sum(axis=1, keepdims=True) / natural**2
    if ACCELEROMETER_SCALE in by_held and table.accelerometer_scale is not None:
        changes["accelerometer_scale"] = table.accelerometer_scale * by_held[ACCELEROMETER_SCALE]
    if result.mass is not None and not result.parameters.standard_uncertainty[0] > 0 and table.mass is not None:
        changes["mass"] = _of_mass(table.mass * result.mass, by_held)
    size = np.repeat([result.mass or 1.0, 1.0, np.abs(result.inertia).max()], [1, 3, 6])
    effects = tuple(
        Effect(
            name=name, text=kind.text, figure=_figure(kind, getattr(table, name)), changes=changes[name],
            signed=name == "mounting_frequency",
        )
        for name, kind in KINDS.items()
        if name in changes and np.any(np.abs(changes[name]) > NEGLIGIBLE * size[:, None])
    )  # fmt: skip
    return replace(result, undeclared=Undeclared(effects))


def largest_wrench(runs: Sequence[Run]) -> tuple[float, float]:
    """Return the largest recorded force [N] and moment [N·m] on any axis."""
    force, moment = (max(float(np.abs(getattr(run, name)).max()) for run in runs) for name in ("force", "moment"))
    return force, moment


def _figure(kind: Kind, value: float) -> str:
    return f"{exact([kind.per_si * value])[0]} {kind.unit}"


def _of_mass(sigma: float, by_held: Mapping[str, np.ndarray]) -> Float[np.ndarray, "10 1"]:
    """Change by a mass that is larger by ``sigma`` [kg] than the stated one, which the result keeps."""
    change = np.zeros((10, 1))
    if "mass" in by_held:
        change += sigma * by_held["mass"]
    change[0] = -sigma
    return change


def _of_joint(by_held: Mapping[str, np.ndarray], undeclared: Experiment) -> dict[str, np.ndarray]:
    """Return each error's change of the ten parameters, but for delay and gyro axes: unknowns, or declared exact."""
    changes = {
        name: by_held[error.unknown] @ root_of(error.covariance)
        for name, error in estimated_errors(undeclared, 1.0).items()
        if error.unknown in by_held
    }
    for source in undeclared.sources:
        if source.perturbs == "r_cg":  # the result keeps the stated one
            changes[source.name] = (by_held["r_cg"] - np.eye(10)[:, 1:4]) * source.sigma
    return changes


def _of_least_squares(result: Identification, runs: Sequence[Run], undeclared: Experiment) -> dict[str, np.ndarray]:
    """Return each error's change of the tensor, and of the centre of gravity where that errs."""
    as_stated = replace(result, sigma_r_cg=undeclared.sigma_r_cg, cg_covariance=None)
    problem = problem_of(as_stated, runs, undeclared, slopes=True)
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
        steps = STEP * (np.ones((1, count)) if KINDS[source.name].common else np.eye(count))
        changes[source.name] = np.stack([tensor(source, step) - tensor(source, -step) for step in steps], 1) / (
            2 * STEP
        )
    return changes
