"""Identification of the tensor, with its standard uncertainty, from runs."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import get_args

import numpy as np

from identify.choices import CgMotion, OffsetChoice
from identify.estimation.joint.priors import Alignment, ConstantError
from identify.estimation.methods import names
from identify.estimation.methods.base import Problem, RunMap, estimator_of
from identify.estimation.static_poses.centre_result import Centre
from identify.exceptions import RunError, explains_names
from identify.judge.held_out import held_out
from identify.judge.judged_result import judged
from identify.least_squares.pooling import RUNS_SCATTER
from identify.results.covariances import check_covariances
from identify.results.discordance import misnamed_mountings
from identify.results.identification_result import Identification
from identify.rigid_body.gravity import STANDARD_GRAVITY
from identify.signals.estimator_spec import EstimatorSpec
from identify.signals.run import Run, numbers

FARTHEST = 10.0
"""Distance of a centre of gravity from the load cell [m] beyond which it is no body's: it is in millimetres."""
SLOWEST = 1.0
"""Rate [Hz] below which no motion is seen: the times are in milliseconds."""
RESTS = 1e-9
"""Change of the angular velocity over its size below which it is a constant, and its derivatives are rounding."""
LIGHTEST = 0.1
"""Mass, or weight in the mean force over gravity [kg], below which nothing is said of a body's size."""
DENSEST = 22.6e3
"""Density of osmium [kg/m³]: a sphere of it has the least trace of all bodies of its mass."""
WIDEST = 3.0
"""Radius of gyration [m] beyond which moments are in N·mm or forces in kN: no load cell carries such a body."""

MANY = 1e9
"""Degrees of freedom of standard uncertainties that count as known."""


@explains_names
def identify(
    runs: Run | Sequence[Run],
    *,
    r_cg: Sequence[float | int] | np.ndarray | None = None,
    sigma_r_cg: Sequence[float | int] | np.ndarray = (0.0, 0.0, 0.0),
    estimator: EstimatorSpec | None = None,
    offsets: OffsetChoice = "estimate",
    mass: float | None = None,
    centre: Centre | None = None,
    method: str = "source",
    alignment: Alignment | None = None,
    cg_motion: CgMotion | None = None,
    gravity: float = 9.80665,
    mass_uncertainty: float | None = None,
    errors: Mapping[str, ConstantError] | None = None,
    drawn_by_mounting: Collection[str] = (),
    validate: bool = False,
    map_runs: RunMap = map,
) -> Identification:
    """Identify the inertia tensor about the centre of gravity from one or more runs of one body (10).

    Args:
        runs: the runs.
        r_cg: centre of gravity from the load cell's centre Q, in B [m]; None: that of ``centre``.
        sigma_r_cg: its standard uncertainty on each axis [m].
        estimator: differentiator and filter; None: Savitzky–Golay matched to the band found in the runs.
        offsets: whether constant offsets of force and moment are estimated in each run along with the tensor, taken
            from its rest, or left in. A force's offset acts only through its moment about the centre of gravity.
        mass: mass of the body [kg]; with an accelerometer it tells the force's offset.
        centre: mass and centre of gravity from static poses, with their covariance, instead of the three above; the
            joint estimate takes its offsets along.
        method: the estimator, by the name of its file in :mod:`identify.estimation.methods`. ``source``: r_CG as given,
            ordinary least squares; ``gls``: r_CG as given, generalised least squares by the residuals' covariance
            across axes and in time; ``joint``: tensor, mass, r_CG, offsets, delay and rotation together, most probable
            given all that is known before.
        alignment: what is known beforehand of delay, rotation and slow errors (``joint``); None: little.
        cg_motion: ``still`` where the motion keeps the centre of gravity still (``joint``); None: not declared, then an
            accelerometer tells the specific force, or nothing does.
        gravity: local gravity [m/s²] (``joint``).
        mass_uncertainty: standard uncertainty of ``mass`` [kg]; None: it counts as exact.
        errors: declared constant errors of load cell, gyro and rig, by the name of their source (``joint``); see
            :class:`identify.estimation.joint.priors.ConstantError`. None: none.
        drawn_by_mounting: unknowns of :data:`identify.estimation.joint.joint_model.SIZES` that are others in each
            mounting, as ``r_cg`` may be, where the runs name two or more (``joint``).
        validate: whether each run, or each half of a single one, is also predicted by the others (``validation``).
        map_runs: does what is done run by run, as the builtin ``map``; functions and runs can be pickled.

    Raises:
        RunError: no run, a run too short for the estimator, a motion that identifies nothing, or a covariance that is
            none.
        TypeError: r_CG is traced by JAX; :func:`identify.ordinary_least_squares` may be.
    """
    for name, given, choices in (("method", method, names()), ("offsets", offsets, get_args(OffsetChoice))):
        if given not in choices:
            raise ValueError(f"Argument `{name}` must be one of {', '.join(choices)}, but is {given!r}.")
    if not isinstance(estimator, EstimatorSpec | None):
        raise TypeError(
            f"Argument `estimator` must be an EstimatorSpec, but is {estimator!r}; an experiment has its own by name: "
            "experiment.estimator(name)."
        )
    if centre is not None:
        r_cg, sigma_r_cg, mass = centre.r_cg, centre.standard_uncertainty[1:4], centre.mass
    problem = Problem(
        *_checked(runs, r_cg, sigma_r_cg), estimator=estimator, offsets=offsets, mass=mass,
        mass_uncertainty=mass_uncertainty, centre=centre, alignment=alignment, cg_motion=cg_motion, gravity=gravity,
        errors=errors or {}, drawn_by_mounting=frozenset(drawn_by_mounting), map_runs=map_runs,
    )  # fmt: skip
    if len({run.mounting for run in problem.runs}) < 2:
        problem = replace(problem, drawn_by_mounting=frozenset())
    result = estimator_of(method).fit(problem)
    freedom = MANY if result.pooling is None else float(result.pooling.residual_degrees_of_freedom.min())
    if misnamed := misnamed_mountings(result.runs, freedom):
        problem = problem.without_mountings
        result = estimator_of(method).fit(problem)
        others = [text for text in result.warnings if not text.startswith(RUNS_SCATTER)]  # no news beside this
        result = replace(result, warnings=(misnamed, *others))
    judgement = judged(result, problem)
    result = result.joined(
        judgement.rows,
        consistency=(*result.consistency, *judgement.causes),
        declarations=judgement.declarations,
        warnings=(*_unit_warnings(result, problem.runs), *judgement.warnings),
        by_held_errors=judgement.by_held_errors,
    )
    if validate:
        validation = held_out(problem, result)
        failed = () if validation.explained else (validation.text,)
        result = result.joined(validation=validation, warnings=(*result.warnings, *failed))
    check_covariances(result)
    return result


def _unit_warnings(result: Identification, runs: Sequence[Run]) -> tuple[str, ...]:
    """Return whether a tensor from arrays is that of no body of the mass, or of the weight that the force shows.

    A recording's units are declared and judged by themselves.
    """
    weight = float(np.mean([np.linalg.norm(run.force, axis=1).mean() for run in runs]))
    mass, trace = result.mass or weight / STANDARD_GRAVITY, float(result.inertia[[0, 3, 5]].sum())
    if mass < LIGHTEST or any(run.sha256 for run in runs):
        return ()
    if trace < 1.2 * mass * (0.75 * mass / (np.pi * DENSEST)) ** (2 / 3):
        cause = "denser than osmium: is omega in deg/s, or has the force a large offset?"
        return (f"the tensor is too small for {mass:.3g} kg, {cause}",)
    if trace > 2 * mass * WIDEST**2:
        cause = f"over {WIDEST:g} m wide: is the moment in N·mm, or was the cell zeroed with the body on it?"
        return (f"the tensor is too large for {mass:.3g} kg, {cause}",)
    return ()


def _same(run: Run, other: Run) -> bool:
    """Whether two runs have the same samples."""
    return np.array_equal(run.moment[:1], other.moment[:1]) and np.array_equal(run.moment, other.moment)


def _checked(
    runs: Run | Sequence[Run],
    r_cg: Sequence[float | int] | np.ndarray | None,
    sigma_r_cg: Sequence[float | int] | np.ndarray,
) -> tuple[tuple[Run, ...], np.ndarray, np.ndarray]:
    """The runs as a tuple, r_CG and its standard uncertainty as arrays."""
    runs = (runs,) if isinstance(runs, Run) or not isinstance(runs, Iterable) else tuple(runs)
    if not runs:
        raise RunError("no runs: give one or more")
    for other in (run for run in runs if not isinstance(run, Run)):
        cure = "give its .run" if isinstance(getattr(other, "run", None), Run) else "make one by Run.from_arrays"
        raise TypeError(f"Argument `runs` must be one Run or several, but has a {type(other).__name__}: {cure}.")
    centre, sigma = numbers("r_cg", r_cg), numbers("sigma_r_cg", sigma_r_cg)
    if centre.shape != (3,) or not np.isfinite(centre).all():
        raise RunError(f"r_cg is {r_cg!r}: give three finite components [m]")
    if np.abs(centre).max() > FARTHEST:
        raise RunError(f"r_cg is {r_cg!r}: give it in metres")
    for number, run in enumerate(runs):
        if any(run is other or _same(run, other) for other in runs[:number]):
            raise RunError(f"{run.name} is given twice: give each run once, or its interval is too narrow")
        if max(map(np.ptp, run.omega.T)) <= RESTS * max(np.abs(column).max() for column in run.omega.T):
            raise RunError(f"the angular velocity in {run.name} never changes: record a body that turns to and fro")
        if run.rate < SLOWEST:
            raise RunError(f"{run.name} has {run.rate:.3g} samples a second: give its times in seconds")
    if sigma.shape != (3,) or not (np.isfinite(sigma) & (sigma >= 0)).all():
        raise RunError(f"sigma_r_cg is {sigma_r_cg!r}: give three standard uncertainties [m], zero or more")
    return runs, centre, sigma
