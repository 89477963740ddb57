"""Effects on a result of errors that are neither declared nor estimated, at typical figures.

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
from identify.results.contributions import Effect, NotIncluded
from identify.results.identification_result import Identification
from identify.rounding import exact
from identify.signals.run import Run
from uq.experiment.experiment import Experiment
from uq.identification.estimated_errors import estimated_errors
from uq.identification.systematic_errors import SystematicProblem, equations, problem_of
from uq.sources.constant_errors import errors_of
from uq.sources.source import Source, kind_of

NEGLIGIBLE = 1e-9
"""Part of the moments of inertia below which an error adds nothing: rounding."""


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


KINDS: Mapping[str, Kind] = {
    "force_gain": Kind(text="gain of the force", unit="%", per_si=100, target="F", kind="scale"),
    "moment_gain": Kind(text="gain of the moment", unit="%", per_si=100, target="M", kind="scale"),
    "cross_talk": Kind(text="cross-talk of the load cell", unit="%", per_si=100, target="wrench", kind="cross_talk"),
    "load_cell_axes": Kind(
        text="misalignment of the load cell", unit="mrad", per_si=1e3, target="wrench", kind="misalignment"
    ),
    "gyro_scale": Kind(text="scale of the gyro", unit="%", per_si=100, target="omega", kind="scale"),
    "gyro_axes": Kind(text="misalignment of the gyro", unit="mrad", per_si=1e3, target="omega", kind="misalignment"),
    "delay": Kind(text="delay of the gyro", unit="ms", per_si=1e3, target="omega", kind="delay"),
    "centre_of_gravity": Kind(text="error of r_CG", unit="mm", per_si=1e3, target="r_cg", kind="bias"),
    "gravity": Kind(text="error of gravity", unit="m/s²", per_si=1, target="gravity", kind="bias"),
    "mounting_frequency": Kind("flexibility of the mounting", "Hz", 1),
    "accelerometer_scale": Kind("scale of the accelerometer", "%", 100),
}
"""Description of each error by its key in ``[not_included]``."""


def with_not_included(result: Identification, runs: Sequence[Run], experiment: Experiment) -> Identification:
    """Return a result with the errors that its intervals do not hold, where its derivatives are known; else unchanged.

    Args:
        result: of these runs, with the declared sources.
        runs: the runs, in the result's order.
        experiment: its sources, and the typical figures.
    """
    sources = [source for source in _typical(experiment, runs) if _open(source, result, experiment)]
    by_held = result.by_held_errors or {}
    if result.seen is not None or (result.method == "joint" and not by_held):
        return result
    added: dict[str, np.ndarray] = {}
    if result.method == "joint":
        added |= _of_joint(by_held, sources, experiment)
    elif sources:
        try:
            added |= _of_least_squares(result, runs, experiment, sources)
        except RunError:  # too short for a delay
            return result
    table = experiment.not_included
    if FLEXIBILITY in by_held and table.mounting_frequency is not None:
        natural = 2 * np.pi * table.mounting_frequency
        added["mounting_frequency"] = by_held[FLEXIBILITY].sum(axis=1) / natural**2
    if ACCELEROMETER_SCALE in by_held and table.accelerometer_scale is not None:
        added["accelerometer_scale"] = table.accelerometer_scale * np.linalg.norm(by_held[ACCELEROMETER_SCALE], axis=1)
    least = NEGLIGIBLE * np.abs(result.inertia).max()
    effects = tuple(
        Effect(
            name=name, text=kind.text, figure=_figure(kind, getattr(table, name)), parameters=added[name],
            signed=name == "mounting_frequency",
        )
        for name, kind in KINDS.items() if name in added and np.abs(added[name]).max() > least
    )  # fmt: skip
    return replace(result, not_included=NotIncluded(effects))


def _figure(kind: Kind, value: float) -> str:
    return f"{exact([kind.per_si * value])[0]} {kind.unit}"


def _typical(experiment: Experiment, runs: Sequence[Run]) -> list[Source]:
    """Errors at their typical figures, as sources that could be declared; those that are silenced left out."""
    size = [max(float(np.abs(getattr(run, name)).max()) for run in runs) for name in ("force", "moment")]
    sources = []
    for name, error in KINDS.items():
        figure = getattr(experiment.not_included, name)
        if figure is None or not error.kind:
            continue
        kind = kind_of(error.target, error.kind)
        is_fraction = len(kind.wholes(error.target, None)) < math.prod(kind.shape)
        if is_fraction and not all(size):
            continue
        stated = np.array(figure) if is_fraction else np.full(kind.shape, figure)
        sigma = kind.placed(stated, np.repeat(size, 3))
        sources.append(Source(name=name, target=error.target, kind=error.kind, group="not included", sigma=sigma))
    return sources


def _open(source: Source, result: Identification, experiment: Experiment) -> bool:
    """Whether an error is neither declared nor estimated."""
    if source.perturbs == "r_cg":
        return not np.any(result.sigma_r_cg > 0)
    return not any((s.perturbs, s.signal) == (source.perturbs, source.signal) for s in experiment.sources if s.perturbs)


def _of_joint(
    by_held: Mapping[str, np.ndarray], sources: Sequence[Source], experiment: Experiment
) -> dict[str, np.ndarray]:
    """Return each error's change of the ten parameters, but for delay and gyro axes: unknowns, or declared exact."""
    errors = estimated_errors(replace(experiment, sources=tuple(sources), mixing=()), 1.0)
    added = {
        name: np.linalg.norm(by_held[error.unknown] @ root_of(error.covariance), axis=1)
        for name, error in errors.items()
        if error.unknown in by_held
    }
    for source in sources:
        if source.perturbs == "r_cg":
            added[source.name] = np.linalg.norm(by_held["r_cg"] * source.sigma, axis=1)
    return added


def _of_least_squares(
    result: Identification, runs: Sequence[Run], experiment: Experiment, sources: Sequence[Source]
) -> dict[str, np.ndarray]:
    """Return each error's change of the tensor: root sum of squares over its independent numbers."""
    open_to = replace(experiment, sources=tuple(sources), mixing=())
    as_stated = replace(result, sigma_r_cg=open_to.sigma_r_cg, cg_covariance=None)
    problem = problem_of(as_stated, runs, open_to, slopes=True)
    if not problem.sources:  # gravity alone is open, to which least squares are blind
        return {}
    estimates = estimator_of(result.method).estimates
    slopes = _slopes(problem)
    ends = np.cumsum([np.size(source.sigma) for source in problem.sources])[:-1]
    parts = zip(problem.sources, np.split(slopes, ends, axis=1), strict=True)
    return {
        source.name: np.concatenate([np.zeros(4), np.linalg.norm(part, axis=1)])
        for source, part in parts if source.perturbs not in estimates
    }  # fmt: skip


def _slopes(problem: SystematicProblem) -> Float[np.ndarray, "6 count"]:
    """Derivative of the tensor by each number of each source, in units of its standard uncertainty.

    By central differences in NumPy: within 1e-8 of autodiff, and done before JAX would have traced it.
    """

    def tensor(source: Source, draw: np.ndarray) -> np.ndarray:
        errors = errors_of([source], {source.name: draw.reshape(np.shape(source.sigma)) * source.sigma})
        return np.linalg.solve(*equations(problem, [errors] * len(problem.sums)))

    steps = [(source, step) for source in problem.sources for step in STEP * np.eye(np.size(source.sigma))]
    return np.stack([tensor(source, step) - tensor(source, -step) for source, step in steps], axis=1) / (2 * STEP)
