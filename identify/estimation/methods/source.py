"""The paper's estimator, named ``source``: r_CG as stated, ordinary least squares; the result of any by rows."""

from collections.abc import Sequence
from functools import partial

import numpy as np

from identify.choices import OffsetChoice
from identify.display.rounding import significant
from identify.estimation.methods.base import Method, Problem
from identify.estimation.static_poses.centre_rows import centre_rows
from identify.floating_point import check_precision
from identify.least_squares.pooling import Pooled, pool
from identify.least_squares.run_information import Information, information
from identify.results.identification_result import CG, Identification
from identify.results.ledger import Ledger, Row, mass_row, type_a_rows
from identify.results.mass_and_centre import DECLARED, POSES
from identify.results.run_estimate import run_estimate
from identify.results.weak_components import within_bodies
from identify.rigid_body.inertia import COMPONENTS
from identify.signals.estimator_spec import EstimatorSpec

ALIGNED = "load cell and IMU are aligned"
NO_OFFSETS = "force and moment are free of constant offsets"


class SourceEstimator(Method):
    """Least squares on Omega_R (10), each run weighted by the inverse of its residual variance."""

    type_a = "What the runs show, residuals correlated in time and scatter between runs, is evaluated as type A."

    def fit(self, problem: Problem) -> Identification:
        """Return the tensor with its uncertainty.

        Raises:
            RunError: a run too short for the estimator, or a motion that identifies nothing.
        """
        spec = estimator_for(problem)
        runs = problem.by_run(partial(information, estimator=spec, r_cg=problem.r_cg, offsets=problem.offsets))
        return result_of(problem, spec, runs, pool(runs, problem.sigma_r_cg), "source")


def result_of(
    problem: Problem,
    spec: EstimatorSpec,
    informations: Sequence[Information],
    pooled: Pooled,
    method: str,
    warnings: Sequence[str] = (),
) -> Identification:
    """Return the tensor of pooled runs as a result.

    Args:
        problem: runs, and priors.
        spec: differentiator and filter that were used.
        informations: each run's normal equations.
        pooled: what they say together.
        method: name of the estimator.
        warnings: what the estimator has to say.
    """
    warned = check_precision("float64")
    mass = np.nan if problem.mass is None else float(problem.mass)
    result = Identification(
        value=np.concatenate([[mass], problem.r_cg, pooled.inertia]), estimator=spec,
        ledger=Ledger(_rows(problem, pooled), np.concatenate([np.zeros(4), pooled.bias])),
        runs=tuple(run_estimate(run, problem.r_cg, problem.mass) for run in informations),
        warnings=(*warned, *warnings, *_warnings(informations, pooled, spec)),
        assumptions=_assumptions(problem.offsets), centre_from=DECLARED if problem.centre is None else POSES,
        diagnostics=_diagnostics(problem, spec, pooled), offsets=problem.offsets,
        method=method, pooling=pooled.together,
        seen=None if pooled.excitation.identifiable.all() else pooled.seen,
    )  # fmt: skip
    return within_bodies(result, problem.runs)


def _rows(problem: Problem, pooled: Pooled) -> tuple[Row, ...]:
    """Rows of type A, and of mass and centre of gravity as they are stated or from static poses."""
    measured = type_a_rows(pooled.together)
    by_centre = np.vstack([np.eye(4), np.hstack([np.zeros((6, 1)), pooled.by_centre])])
    if problem.centre is not None:
        return (*measured, *centre_rows(problem.centre, by_centre))
    stated = by_centre * np.array([problem.mass_uncertainty or 0.0, *problem.sigma_r_cg])
    rows = (mass_row(stated[0, 0]), Row(error=CG, changes=stated[:, 1:]))
    return (*measured, *(row for row in rows if row.changes.any()))


def estimator_for(problem: Problem) -> EstimatorSpec:
    """Return the differentiator that is named, or that for the band of the fastest motion.

    Raises:
        RunError: a run is too short for it.
    """
    if problem.estimator is not None:
        return problem.estimator
    band = problem.band
    return EstimatorSpec(f"savitzky-golay, band {band:.3g} Hz found", "savitzky-golay", band)


def _diagnostics(problem: Problem, spec: EstimatorSpec, pooled: Pooled) -> dict[str, object]:
    verdict, by_centre = pooled.excitation, pooled.by_centre * problem.sigma_r_cg**2 @ pooled.by_centre.T
    return {
        "estimator": {"name": spec.name, "differentiator": spec.differentiator, "band": spec.band,
                      "window": 2 * len(spec.taps(problem.runs[0].rate)) + 1, "lowpass": spec.lowpass},
        "condition_number": float(np.sqrt(verdict.strength[-1] / verdict.strength[verdict.identifiable][0])),
        "excitation_over_noise": (verdict.strength / np.maximum(verdict.noise, 1e-300)).min().item(),
        "scatter_between_runs": pooled.together.excess.tolist(),
        "coverage_factor": pooled.coverage_factor.tolist(),
        "degrees_of_freedom": pooled.degrees_of_freedom.tolist(),
        "standard_uncertainty_from_residuals": np.sqrt(np.diag(pooled.residual)).tolist(),
        "standard_uncertainty_from_cg": np.sqrt(np.diag(by_centre)).tolist(),
    }  # fmt: skip


def _warnings(informations: Sequence[Information], pooled: Pooled, spec: EstimatorSpec) -> list[str]:
    warnings = [f"{used.run.name}: {text}" for used in informations for text in used.run.warnings]
    sigma = np.sqrt(np.diag(pooled.covariance))
    matched = spec.differentiator == "savitzky-golay"  # the bias is in its column and in the interval
    for name, bias, three in zip(COMPONENTS, pooled.bias, 3 * sigma, strict=True):
        if abs(bias) > 0.1 * three and not matched:
            by = f"{significant(1e3 * bias, 2)} g·m²"
            warnings.append(f"gyro noise and differentiator bias {name} by about {by}: match a smoother to the band")
    return [*warnings, *pooled.together.warnings]


def _assumptions(offsets: OffsetChoice) -> tuple[str, ...]:
    zero = (NO_OFFSETS,) if offsets == "none" else ()
    return (
        *zero,
        f"{ALIGNED} in time and in frame",
        "the gyro's noise is white",
        "the platform is rigid",
    )
