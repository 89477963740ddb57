"""Effects on a result of errors that are neither declared nor estimated, at typical figures: its second interval.

By the derivatives of the estimate that was made: of least squares those of type B
(:mod:`uq.identification.systematic_errors`), of the joint estimate and for the mounting's flexibility those of
:mod:`identify.judge.held_errors`.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

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
from uq.identification.estimated_errors import estimated_errors
from uq.identification.systematic_errors import SystematicProblem, equations, problem_of
from uq.sources.constant_errors import errors_of
from uq.sources.draws import Mixing
from uq.sources.source import Source, kind_of

NEGLIGIBLE = 1e-9
"""Part of the mass, of a metre and of the moments of inertia below which an error adds nothing: rounding."""
STEP = 0.01
"""Step of the finite differences, in standard uncertainties."""


class Kind(NamedTuple):
    """An error as it is said, and as the source that it would be declared as."""

    text: str
    unit: str
    per_si: float
    """Factor from SI to the unit."""
    target: str = ""
    kind: str = ""
    common: bool = False
    """Whether one number errs on all axes."""


KINDS: Mapping[str, Kind] = {
    "force_gain": Kind("common gain of the force", "%", 100, "F", "scale", common=True),
    "force_gain_by_axis": Kind("gain of each force", "%", 100, "F", "scale"),
    "moment_gain": Kind("common gain of the moment", "%", 100, "M", "scale", common=True),
    "moment_gain_by_axis": Kind("gain of each moment", "%", 100, "M", "scale"),
    "cross_talk": Kind("cross-talk of the load cell", "%", 100, "wrench", "cross_talk"),
    "load_cell_axes": Kind("misalignment of the load cell", "mrad", 1e3, "wrench", "misalignment"),
    "gyro_scale": Kind("scale of the gyro", "%", 100, "omega", "scale"),
    "gyro_axes": Kind("misalignment of the gyro", "mrad", 1e3, "omega", "misalignment"),
    "delay": Kind("delay of the gyro", "ms", 1e3, "omega", "delay"),
    "mass": Kind("error of the mass", "%", 100),
    "centre_of_gravity": Kind("error of r_CG", "mm", 1e3, "r_cg", "bias"),
    "gravity": Kind("error of gravity", "m/s²", 1, "gravity", "bias"),
    "mounting_frequency": Kind("flexibility of the mounting", "Hz", 1),
    "accelerometer_scale": Kind("scale of the accelerometer", "%", 100),
}
"""Description of each error by its key in ``[undeclared]``."""


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
    typical = typical_errors(experiment, largest_wrench(runs))
    sources = tuple(source for source in typical.sources if _is_open(source, result, experiment))
    undeclared = replace(typical, sources=sources)
    changes: dict[str, np.ndarray] = {}
    if result.method == "joint":
        changes |= _of_joint(by_held, undeclared)
    elif sources:
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


def typical_errors(experiment: Experiment, largest: tuple[float, float]) -> Experiment:
    """Return the experiment whose sources are the errors of ``[undeclared]`` at their typical size, and no others.

    Args:
        experiment: the typical figures.
        largest: full scale of force [N] and moment [N·m], of which cross-talk is a part; zero: no cross-talk.
    """
    sources, mixing = [], []
    for name, error in KINDS.items():
        figure = getattr(experiment.undeclared, name)
        if figure is None or not error.kind:
            continue
        kind = kind_of(error.target, error.kind)
        is_fraction = len(kind.wholes(error.target, None)) < math.prod(kind.shape)
        if is_fraction and not all(largest):
            continue
        stated = np.array(figure) if is_fraction else np.full(kind.shape, figure)
        sigma = kind.placed(stated, np.repeat(largest, 3))
        sources.append(Source(name=name, target=error.target, kind=error.kind, group="undeclared", sigma=sigma))
        if error.common:
            mixing.append(Mixing(names=(name,), axes=(3,), correlation=np.ones((3, 3))))
    return replace(experiment, sources=tuple(sources), mixing=tuple(mixing))


def _figure(kind: Kind, value: float) -> str:
    return f"{exact([kind.per_si * value])[0]} {kind.unit}"


def _is_open(source: Source, result: Identification, experiment: Experiment) -> bool:
    """Whether an error is neither declared nor estimated."""
    if source.perturbs == "r_cg":
        return not np.any(result.sigma_r_cg > 0)
    return not any((s.perturbs, s.signal) == (source.perturbs, source.signal) for s in experiment.sources if s.perturbs)


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
    estimates = estimator_of(result.method).estimates
    slopes = _slopes(problem)
    ends = np.cumsum([np.size(source.sigma) for source in problem.sources])[:-1]
    changes = {}
    for source, part in zip(problem.sources, np.split(slopes, ends, axis=1), strict=True):
        if source.perturbs not in estimates:
            # one number errs on all axes, or each by itself
            apart = np.ones((part.shape[1], 1)) if KINDS[source.name].common else np.eye(part.shape[1])
            centre = np.diag(source.sigma) if source.perturbs == "r_cg" else np.zeros((3, part.shape[1]))
            changes[source.name] = np.vstack([np.zeros((1, part.shape[1])), centre, part]) @ apart
    return changes


def _slopes(problem: SystematicProblem) -> Float[np.ndarray, "6 count"]:
    """Derivative of the tensor by each number of each source, in units of its standard uncertainty.

    By central differences in NumPy: within 1e-8 of autodiff, and done before JAX would have traced it.
    """

    def tensor(source: Source, draw: np.ndarray) -> np.ndarray:
        errors = errors_of([source], {source.name: draw.reshape(np.shape(source.sigma)) * source.sigma})
        return np.linalg.solve(*equations(problem, [errors] * len(problem.sums)))

    steps = [(source, step) for source in problem.sources for step in STEP * np.eye(np.size(source.sigma))]
    return np.stack([tensor(source, step) - tensor(source, -step) for source, step in steps], axis=1) / (2 * STEP)
