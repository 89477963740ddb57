"""Fits of runs for the judge: band, priors and start by the result that is judged, source of the specific force."""

from collections.abc import Collection, Mapping
from dataclasses import replace
from typing import NamedTuple, get_args

import numpy as np
from jaxtyping import Float

from identify.estimation.joint.joint_model import SpecificForce
from identify.estimation.joint.priors import Alignment, PriorBlock, Setting, error_blocks
from identify.estimation.methods.base import Problem
from identify.estimation.methods.joint import STILL_WITHIN, beside_alignment, specific_force_source
from identify.exceptions import RunError
from identify.judge.causes import unit_lines
from identify.judge.conventions.convention_fit import ImuSignal
from identify.judge.conventions.imu_conventions import in_free_fall
from identify.judge.conventions.removed_weight import LEAST_WEIGHT
from identify.judge.held_errors import sums_beside
from identify.judge.judged_part import judged_part
from identify.judge.run_fit import RunFit, fit_run
from identify.results.identification_result import Identification
from identify.rigid_body.rotation import cumulative_product, exponential
from identify.signals.band_limited_run import InBand, in_band
from identify.signals.run import Run

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
AXES_KEPT = 10.0
"""Seconds over which a gyro keeps axes, whatever its bias.

Choice: a bias of 0.02 rad/s turns them by 0.2 rad, which leaves 98 % of a mean.
"""


class JudgedWays(NamedTuple):
    """Settings that the fits of all runs share, by a result and what its estimator was given."""

    band: float
    """Highest frequency of the motion [Hz]."""
    reach: float
    """The largest delay that the ends of a run leave room for [s]."""
    mass: float | None
    """Mass that is stated, or else estimated [kg]."""
    gravity: float
    """Local gravity that is stated [m/s²]."""
    still: bool
    """Whether the centre of gravity is declared still."""
    start: Mapping[str, np.ndarray]
    """Unknowns from which each search starts."""
    settings: Mapping[SpecificForce, Setting]
    """Priors by the source of the specific force."""
    beside: bool | None
    """Whether least squares estimate offsets along; None: the estimate is the joint one."""

    def falls(self, run: Run) -> bool:
        """Return whether a run shows no weight, or no force at all.

        An accelerometer tells it by itself: a force without the weight that it shows is an error, to be judged.
        """
        if not np.abs(run.force).max() > 0:
            return True
        read = run.specific_force
        if read is not None and lasting(run, read) < LEAST_WEIGHT * self.gravity:
            return in_free_fall(ImuSignal(run.t, run.omega, read))  # or the gyro is wrong
        needed, mass = read is None or self.still, self.mass
        return bool(needed and mass is not None and lasting(run, run.force) < LEAST_WEIGHT * mass * self.gravity)


def judged_ways(result: Identification, problem: Problem) -> JudgedWays:
    """Return the settings that the fits of all runs share."""
    delay = 0.0 if result.delay is None else abs(float(result.delay.value[0]))
    declared = [error for error in problem.errors.values() if error.unknown == "delay"]
    reach = sum(abs(error.mean[0]) + 4 * np.sqrt(error.covariance[0, 0]) for error in declared)
    still = problem.cg_motion == "still"
    within: dict[SpecificForce, float] = {"accelerometer": STILL_WITHIN, "still": STILL_WITHIN if still else LOOSE}
    settings = {
        way: declared_of(result, problem, way, within.get(way, STILL_WITHIN)) for way in get_args(SpecificForce)
    }
    return JudgedWays(
        band=problem.band, reach=max(delay, reach) + 0.005, mass=problem.mass or result.mass, gravity=problem.gravity,
        still=still, start=start_of(result), settings=settings,
        beside=None if result.method == "joint" else result.offsets == "estimate",
    )  # fmt: skip


def fits_of(run: Run, ways: JudgedWays, excluded: Collection[str]) -> list[RunFit]:
    """Return the run at its best about a point at rest, with its accelerometer, or by the moment about r_CG alone.

    With what the errors that are looked for make in it, but for those of the names that are excluded; the last fit,
    which is that of :func:`fit_of_estimator`, has the sums of least squares.
    """
    rows = rows_in_band(run, ways)
    if rows is None:
        return []
    fits = [replace(fit, errors=unit_lines(fit, excluded)) for fit in _ways_of(run, rows, ways)]
    if ways.beside is not None:
        fits[-1] = replace(fits[-1], beside=sums_beside(fits[-1], offsets=ways.beside))
    return fits


def _ways_of(run: Run, rows: InBand, ways: JudgedWays) -> list[RunFit]:
    def fitted(force_from: SpecificForce) -> RunFit:
        return fit_run(run, rows, ways.settings[force_from], ways.start)

    by_moment = ways.falls(run)
    if ways.still and not by_moment:
        return [fitted("still")]
    if run.specific_force is None or by_moment:
        return [fitted("none")]
    read, about = fitted("accelerometer"), fitted("still")
    scale = np.repeat([read.level[:3].mean(), read.level[3:].mean()], 3)
    turns = np.linalg.norm(about.level / scale) < EQUALLY * np.linalg.norm(read.level / scale)
    return [about, read] if turns else [read]


def fit_of_estimator(run: Run, fits: list[RunFit], result: Identification, problem: Problem) -> RunFit | None:
    """Return the fit whose specific force is from where the estimator has it; None: the run is too short, or falls."""
    force_from = specific_force_source(problem)
    candidates = [fit for fit in fits if fit.prediction.force_from == force_from]
    if not candidates or (force_from == "none" and judged_ways(result, problem).falls(run)):
        return None
    if force_from != "none":
        return candidates[0]
    tells_mass = lasting(run, run.force) > LEAST_WEIGHT * np.sqrt(np.mean(run.force**2)) and problem.gravity > 0
    return candidates[0] if tells_mass else None


def rows_in_band(run: Run, ways: JudgedWays) -> InBand | None:
    """Return the judged part of a run in its band; None: it is too short."""
    run = judged_part(run, ways.band)
    try:
        return in_band(run, ways.band, reach=ways.reach, accelerometer=run.specific_force is not None)
    except RunError:
        return None


def declared_of(
    result: Identification,
    problem: Problem,
    force_from: SpecificForce,
    still_within: float = STILL_WITHIN,
) -> Setting:
    """Return the priors of a run's unknowns.

    Args:
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
    weight = float(np.mean([np.linalg.norm(run.force.mean(axis=0)) for run in problem.runs]))
    weighed = weight / problem.gravity if problem.gravity > 0 else 0.0
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


def lasting(run: Run, vectors: Float[np.ndarray, "n 3"]) -> float:
    """Return the size of a vector's mean: in B, or in axes that the gyro keeps, whichever is larger.

    On a robot arm, which turns the body all ways, gravity has hardly a mean in B.
    """
    count, squares, samples = max(round(AXES_KEPT * run.rate), 1), 0.0, 0
    for segment in run.used():
        omega, values = run.omega[segment], vectors[segment]
        for first in range(0, len(values), count):
            part = slice(first, first + count)
            attitude = cumulative_product(exponential(omega[part] / run.rate))
            mean = np.einsum("nij,nj->i", attitude, values[part]) / len(attitude)
            squares, samples = squares + len(attitude) * float(mean @ mean), samples + len(attitude)
    in_body = float(np.linalg.norm(vectors.mean(axis=0)))
    return max(in_body, float(np.sqrt(squares / samples)) if samples else 0.0)
