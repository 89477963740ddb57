"""From runs to the tensor with its standard uncertainty."""

from collections.abc import Sequence
from typing import get_args

import numpy as np

from identify.choices import CgMotion, Method, OffsetChoice
from identify.estimators.generalised_least_squares import whitened
from identify.estimators.pooling import Pooled, pool
from identify.estimators.run_information import Information, information, longest
from identify.joint.alignment_prior import Alignment
from identify.joint.joint_estimator import joint, specific_force_of, static_knowledge
from identify.precision import check_precision
from identify.results.identification_result import Identification
from identify.results.run_estimate import run_estimate
from identify.results.weak_components import within_bodies
from identify.rigid_body.inertia import COMPONENTS
from identify.signals.estimator_spec import EstimatorSpec
from identify.signals.filters import motion_band
from identify.signals.run import Run, RunError
from identify.static.centre_covariance import with_centre
from identify.static.centre_result import Centre

SHORTEST = 64
"""Samples from which the motion's band can be found."""


ROWS = {"source": information, "gls": whitened}
"""What a run's rows say, by method."""


def identify(
    runs: Run | Sequence[Run],
    *,
    r_cg: Sequence[float | int] | np.ndarray | None = None,
    sigma_r_cg: Sequence[float | int] | np.ndarray = (0.0, 0.0, 0.0),
    estimator: EstimatorSpec | None = None,
    offsets: OffsetChoice = "estimate",
    mass: float | None = None,
    centre: Centre | None = None,
    method: Method = "source",
    alignment: Alignment | None = None,
    cg_motion: CgMotion | None = None,
    gravity: float = 9.80665,
    mass_uncertainty: float | None = None,
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
        method: ``source``: r_CG as given, ordinary least squares; ``gls``: r_CG as given, generalised least squares by
            the residuals' covariance across axes and in time; ``joint``: tensor, mass, r_CG, offsets, delay and
            rotation together, most probable given all that is known before.
        alignment: what is known beforehand of delay, rotation and slow errors (``joint``); None: little.
        cg_motion: ``still`` where the motion keeps the centre of gravity still (``joint``); None: not declared, then an
            accelerometer tells the specific force, or nothing does.
        gravity: local gravity [m/s²] (``joint``).
        mass_uncertainty: standard uncertainty of ``mass`` [kg] (``joint``); None: it counts as exact.

    Raises:
        RunError: no run, a run too short for the estimator, or a motion that identifies nothing.
    """
    for name, given, choices in (("method", method, Method), ("offsets", offsets, OffsetChoice)):
        if given not in get_args(choices):
            raise ValueError(f"Argument `{name}` must be one of {', '.join(get_args(choices))}, but is {given!r}.")
    if method == "joint":
        return _joint(
            runs, r_cg=r_cg, sigma_r_cg=sigma_r_cg, band=None if estimator is None else estimator.band, offsets=offsets,
            mass=mass, mass_uncertainty=mass_uncertainty, centre=centre, alignment=alignment, cg_motion=cg_motion,
            gravity=gravity,
        )  # fmt: skip
    if centre is not None:
        sigma = centre.standard_uncertainty[1:4]
        result = _plug_in(
            runs, r_cg=centre.r_cg, sigma_r_cg=sigma, estimator=estimator, offsets=offsets, mass=centre.mass,
            method=method,
        )  # fmt: skip
        return within_bodies(with_centre(result, centre), runs)
    result = _plug_in(
        runs, r_cg=r_cg, sigma_r_cg=sigma_r_cg, estimator=estimator, offsets=offsets, mass=mass, method=method
    )
    return within_bodies(result, runs)


def _plug_in(
    runs: Run | Sequence[Run],
    *,
    r_cg: Sequence[float | int] | np.ndarray | None,
    sigma_r_cg: Sequence[float | int] | np.ndarray,
    estimator: EstimatorSpec | None,
    offsets: OffsetChoice,
    mass: float | None,
    method: Method,
) -> Identification:
    """Estimators by rows: r_CG as it is given, ordinary or generalised least squares."""
    runs, centre, sigma = _checked(runs, r_cg, sigma_r_cg)
    warned = check_precision("float64")
    if estimator is None:
        band = _common_band(runs)
        estimator = EstimatorSpec(f"savitzky-golay, band {band:.3g} Hz found", "savitzky-golay", band)
    of_runs = [ROWS[method](run, estimator, centre, offsets=offsets) for run in runs]
    pooled = pool(of_runs, sigma)
    inertia, covariance, verdict = pooled.inertia, pooled.covariance, pooled.excitation
    half = pooled.half_width
    warnings = [*warned, *_warnings(of_runs, pooled)]
    diagnostics = {
        "estimator": {"name": estimator.name, "differentiator": estimator.differentiator, "band": estimator.band,
                      "window": 2 * len(estimator.taps(runs[0].rate)) + 1, "lowpass": estimator.lowpass},
        "condition_number": float(np.sqrt(verdict.strength[-1] / verdict.strength[verdict.identifiable][0])),
        "excitation_over_noise": (verdict.strength / np.maximum(verdict.noise, 1e-300)).min().item(),
        "scatter_between_runs": pooled.together.excess.tolist(),
        "coverage_factor": pooled.coverage_factor.tolist(),
        "degrees_of_freedom": pooled.degrees_of_freedom.tolist(),
        "standard_uncertainty_from_residuals": np.sqrt(np.diag(pooled.residual)).tolist(),
        "standard_uncertainty_from_cg": np.sqrt(np.diag(pooled.by_centre * sigma**2 @ pooled.by_centre.T)).tolist(),
    }  # fmt: skip
    return Identification(
        inertia, pooled.bias, covariance, np.stack([inertia - half, inertia + half], axis=1), centre, sigma, mass,
        estimator,
        tuple(run_estimate(of_run, centre, mass) for of_run in of_runs), tuple(warnings), _assumptions(offsets),
        diagnostics,
        offsets=offsets, cg_inertia_covariance=(pooled.by_centre * sigma**2).T, method=method,
        pooling=pooled.together, seen=None if verdict.identifiable.all() else pooled.seen,
    )  # fmt: skip


def _joint(
    runs: Run | Sequence[Run],
    *,
    r_cg: Sequence[float | int] | np.ndarray | None,
    sigma_r_cg: Sequence[float | int] | np.ndarray,
    band: float | None,
    offsets: OffsetChoice,
    mass: float | None,
    mass_uncertainty: float | None,
    centre: Centre | None,
    alignment: Alignment | None,
    cg_motion: CgMotion | None,
    gravity: float,
) -> Identification:
    """Everything together; see :mod:`identify.joint.joint_estimator`."""
    runs, r_cg, sigma_r_cg = _checked(runs, r_cg if centre is None else centre.r_cg, sigma_r_cg)
    warned = check_precision("float64")
    if warned:
        raise RunError("the joint estimate needs float64: run jax.config.update('jax_enable_x64', True) first")
    if offsets == "still":
        raise RunError('the joint estimate finds offsets itself: write offsets = "estimate", or use the method source')
    blocks = static_knowledge(
        runs, r_cg=r_cg, sigma_r_cg=sigma_r_cg, mass=mass, mass_uncertainty=mass_uncertainty, gravity=gravity,
        offsets=offsets, centre=centre,
    )  # fmt: skip
    return joint(
        runs, band=_common_band(runs) if band is None else band, blocks=blocks, alignment=alignment or Alignment(),
        specific_force=specific_force_of(runs, cg_motion), gravity=gravity, offsets=offsets,
    )  # fmt: skip


def _checked(
    runs: Run | Sequence[Run],
    r_cg: Sequence[float | int] | np.ndarray | None,
    sigma_r_cg: Sequence[float | int] | np.ndarray,
) -> tuple[list[Run], np.ndarray, np.ndarray]:
    """The runs as a list, r_CG and its standard uncertainty as arrays."""
    runs = [runs] if isinstance(runs, Run) else list(runs)
    if not runs:
        raise RunError("no runs: give one or more")
    centre, sigma = np.asarray(r_cg, float), np.asarray(sigma_r_cg, float)
    if centre.shape != (3,) or not np.isfinite(centre).all():
        raise RunError(f"r_cg is {r_cg!r}: give three finite components [m]")
    if sigma.shape != (3,) or not (np.isfinite(sigma) & (sigma >= 0)).all():
        raise RunError(f"sigma_r_cg is {sigma_r_cg!r}: give three standard uncertainties [m], zero or more")
    return runs, centre, sigma


def _common_band(runs: Sequence[Run]) -> float:
    """The band of the fastest motion [Hz]."""
    for run in runs:
        samples = len(longest(run))
        if samples < SHORTEST:
            raise RunError(
                f"{run.name} has {samples} samples, fewer than the {SHORTEST} from which a motion's band is found: "
                "record for longer, or name an estimator"
            )
    return max(motion_band(longest(run), run.rate) for run in runs)


def _warnings(of_runs: list[Information], pooled: Pooled) -> list[str]:
    warnings = [f"{of_run.run.name}: {text}" for of_run in of_runs for text in of_run.run.warnings]
    sigma = np.sqrt(np.diag(pooled.covariance))
    for name, bias, three in zip(COMPONENTS, pooled.bias, 3 * sigma, strict=True):
        if abs(bias) > 0.1 * three:
            by = f"{1e3 * bias:.3g} g·m²"
            warnings.append(f"gyro noise and differentiator bias {name} by about {by}: match a smoother to the band")
    for name, ratio in zip(COMPONENTS, pooled.together.excess, strict=True):
        if ratio > 2:
            warnings.append(
                f"{name} scatters {ratio:.1f} times more between the runs than within them: something changes"
            )
    return warnings


def _assumptions(offsets: OffsetChoice) -> tuple[str, ...]:
    zero = ("force and moment are free of constant offsets",) if offsets == "none" else ()
    return (
        *zero,
        "load cell and IMU are aligned in time and in frame",
        "the gyro's noise is white",
        "the platform is rigid",
    )
