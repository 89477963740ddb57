"""The paper's estimator, named ``source``: r_CG as stated, ordinary least squares; the result of any by rows."""

from collections.abc import Sequence

import numpy as np

from identify.choices import OffsetChoice
from identify.estimators.pooling import Pooled, pool
from identify.estimators.run_information import Information, information
from identify.floating_point import check_precision
from identify.methods.base import Method, Problem
from identify.results.identification_result import Identification, intervals_of
from identify.results.run_estimate import run_estimate
from identify.results.weak_components import within_bodies
from identify.rigid_body.inertia import COMPONENTS
from identify.rigid_body.inertial_parameters import InertialParameters
from identify.rounding import significant
from identify.signals.estimator_spec import EstimatorSpec
from identify.static.centre_covariance import with_centre

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
        runs = [information(run, spec, problem.r_cg, offsets=problem.offsets) for run in problem.runs]
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
    inertia, half, seen = pooled.inertia, pooled.half_width, pooled.excitation.identifiable
    parameters = _parameters(problem, pooled)
    result = Identification(
        parameters=parameters, bias=pooled.bias, estimator=spec,
        intervals95=intervals_of(parameters, np.stack([inertia - half, inertia + half], axis=1)),
        runs=tuple(run_estimate(run, problem.r_cg, problem.mass) for run in informations),
        warnings=(*warned, *warnings, *_warnings(informations, pooled, spec)),
        assumptions=_assumptions(problem.offsets),
        diagnostics=_diagnostics(problem, spec, pooled), offsets=problem.offsets,
        method=method, pooling=pooled.together,
        seen=None if seen.all() else pooled.seen,
    )  # fmt: skip
    return within_bodies(with_centre(result, problem.centre) if problem.centre else result, problem.runs)


def _parameters(problem: Problem, pooled: Pooled) -> InertialParameters:
    """Mass and centre of gravity as they are stated, and the tensor, which is correlated with the centre by itself."""
    covariance, variance = np.zeros((10, 10)), problem.sigma_r_cg**2
    covariance[0, 0] = np.nan if problem.mass is None else (problem.mass_uncertainty or 0.0) ** 2
    covariance[1:4, 1:4], covariance[4:, 4:] = np.diag(variance), pooled.covariance
    covariance[4:, 1:4] = pooled.by_centre * variance
    covariance[1:4, 4:] = covariance[4:, 1:4].T
    mass = np.nan if problem.mass is None else float(problem.mass)
    return InertialParameters(mass, problem.r_cg, pooled.inertia, covariance)


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
