"""The joint estimate of tensor, mass, centre of gravity, offsets, delay and rotation from one or more runs."""

from collections.abc import Mapping, Sequence

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import scipy
from jaxtyping import Array, Float

from identify.choices import CgMotion, OffsetChoice
from identify.estimators.offsets import Offsets
from identify.estimators.residual_trace import Trace, trace
from identify.joint.alignment_prior import Alignment
from identify.joint.joint_model import SLICES, Model, SpecificForce, kinematics, residuals, unknowns
from identify.joint.joint_pooling import ALIGNED, CALIBRATED, Pooled, pool
from identify.joint.priors import STATIC, Known
from identify.joint.single_run import JointRun, Setting, joint_run, noise_in_alpha
from identify.results.alignment import Aligned, alignment_warnings
from identify.results.identification_result import Identification
from identify.results.run_estimate import RunEstimate
from identify.rigid_body.dynamics import moment_about_cg
from identify.rigid_body.inertia import COMPONENTS
from identify.rigid_body.regressor import cross_matrix
from identify.signals.estimator_spec import EstimatorSpec
from identify.signals.run import Run
from identify.static.centre_result import Centre

OF_FORCE = {
    "still": "the centre of gravity stays where it is: the specific force is gravity's, through the gyro's attitude",
    "accelerometer": "the specific force at the centre of gravity is the accelerometer's, carried there",
    "none": "neither is the centre of gravity declared still nor is there an accelerometer: the force is as measured",
}
LEAST_SCATTER = 2.0
"""Scatter between runs, over their own noise, that is worth a warning."""


def joint(
    runs: Sequence[Run],
    *,
    band: float,
    blocks: Mapping[tuple[str, ...], Known],
    alignment: Alignment,
    specific_force: SpecificForce,
    gravity: float,
    offsets: OffsetChoice,
) -> Identification:
    """Estimate everything that is unknown from all runs together.

    Args:
        runs: one or more runs of one body on one rig.
        band: highest frequency of the motion [Hz].
        blocks: what is known of mass, r_CG and offsets; see :func:`static_knowledge`.
        alignment: what is known of delay, rotation and the sensors' slow errors.
        specific_force: where the specific force at the centre of gravity comes from.
        gravity: local gravity [m/s²].
        offsets: what the result says of the offsets' origin.

    Raises:
        RunError: a run is too short or has no solution, or the motion does not identify the tensor.
    """
    setting = Setting(blocks, alignment, band, specific_force, gravity, _tensor_scale(runs, band))
    joint_runs = [joint_run(run, setting) for run in runs]
    pooled = pool(joint_runs, ALIGNED + (CALIBRATED if STATIC in blocks else ()))
    factor = float(scipy.stats.t.ppf(0.975, pooled.degrees_of_freedom if pooled.scatter > 1 else _freedom(joint_runs)))
    tensor, cg, mass = SLICES["inertia"], SLICES["r_cg"], SLICES["mass"].start
    value, covariance = pooled.theta[0], pooled.covariance
    inertia = value[tensor]
    half = factor * np.sqrt(np.diag(covariance)[tensor])
    bias = _bias(joint_runs, inertia, covariance[tensor, tensor])
    delay, rotation = (_aligned(pooled, name, factor) for name in ("delay", "rotation"))
    warnings = [f"{fitted_run.run.name}: {text}" for fitted_run in joint_runs for text in fitted_run.run.warnings]
    warnings += alignment_warnings(delay, rotation)
    warnings += _warnings(pooled, bias, half / factor)
    return Identification(
        inertia, bias, covariance[tensor, tensor], np.stack([inertia - half, inertia + half], axis=1),
        value[cg], np.sqrt(np.diag(covariance)[cg]), float(value[mass]),
        EstimatorSpec(f"joint, band {band:.3g} Hz", "savitzky-golay", band),
        tuple(map(_run_estimate, joint_runs, pooled.theta)), tuple(warnings),
        _assumptions(specific_force, len(joint_runs)), _diagnostics(joint_runs, pooled, factor), offsets=offsets,
        mass_uncertainty=float(np.sqrt(covariance[mass, mass])), cg_inertia_covariance=covariance[cg, tensor],
        cg_covariance=covariance[cg, cg], method="joint", delay=delay, rotation=rotation,
    )  # fmt: skip


def static_knowledge(
    runs: Sequence[Run],
    *,
    r_cg: np.ndarray,
    sigma_r_cg: np.ndarray,
    mass: float | None,
    mass_uncertainty: float | None,
    gravity: float,
    offsets: OffsetChoice,
    centre: Centre | None,
) -> dict[tuple[str, ...], Known]:
    """Return what is known of mass, r_CG and offsets: a static calibration, or the figures that are stated.

    What is not stated gets a standard uncertainty as large as the signals: the run's own data tell it.

    Args:
        runs: for the size of their signals.
        r_cg: centre of gravity from Q, in B [m].
        sigma_r_cg: its standard uncertainty [m].
        mass: mass [kg]; None: not stated.
        mass_uncertainty: its standard uncertainty [kg]; None: the mass counts as exact, where it is stated.
        gravity: local gravity [m/s²].
        offsets: ``none`` where there are none.
        centre: the static calibration, instead of all these.
    """
    if centre is not None:
        return {STATIC: Known(centre.values, centre.covariance)}
    force, moment = (
        np.sqrt(np.mean([(getattr(run, name) ** 2).mean() for run in runs])) for name in ("force", "moment")
    )
    weight = np.sqrt(3) * force / gravity
    known_mass = Known(np.array([weight]), np.array([[weight**2]])) if mass is None else Known(
        np.array([mass]), np.array([[(mass_uncertainty or 0.0) ** 2]])
    )  # fmt: skip
    free = 0.0 if offsets == "none" else 1.0
    return {
        ("mass",): known_mass,
        ("r_cg",): Known(r_cg, np.diag(sigma_r_cg**2)),
        ("force_offset",): Known(np.zeros(3), free * force**2 * np.eye(3)),
        ("moment_offset",): Known(np.zeros(3), free * moment**2 * np.eye(3)),
    }


def specific_force_of(runs: Sequence[Run], cg_motion: CgMotion | None) -> SpecificForce:
    """Return where the specific force at the centre of gravity comes from."""
    if cg_motion == "still":
        return "still"
    return "accelerometer" if all(run.specific_force is not None for run in runs) else "none"


def _aligned(pooled: Pooled, name: str, factor: float) -> Aligned:
    where = SLICES[name]
    value, covariance = pooled.theta[0][where], pooled.covariance[where, where]
    half = factor * np.sqrt(np.diag(covariance))
    return Aligned(value, covariance, np.stack([value - half, value + half], axis=1), _share(pooled, where))


def _tensor_scale(runs: Sequence[Run], band: float) -> float:
    """Order of magnitude of the tensor [kg·m²]: the moment over the angular acceleration at the highest frequency."""
    moment, omega = (max(float(np.square(getattr(run, name)).mean()) for run in runs) for name in ("moment", "omega"))
    return float(np.sqrt(moment) / max(np.sqrt(omega) * 2 * np.pi * band, 1e-12)) or 1.0


def _share(pooled: Pooled, where: slice) -> np.ndarray:
    total = np.diag(pooled.covariance)[where]
    return np.where(total > 0, np.diag(pooled.of_prior)[where] / np.where(total > 0, total, 1.0), 1.0)


def _freedom(runs: Sequence[JointRun]) -> float:
    """Independent residuals in the band less the unknowns."""
    bins = sum(len(run.noise) * run.run.t.size / run.model.rows.factor for run in runs)
    return max(bins / 2 - sum(len(run.fit.z) for run in runs), 1.0)


def _bias(runs: Sequence[JointRun], inertia: np.ndarray, covariance: np.ndarray) -> np.ndarray:
    """Expected mean error from the gyro's noise in alpha, which dilutes the tensor to first order."""
    noise = np.sum([_of_gyro(run) for run in runs], axis=0)
    return -covariance @ noise @ inertia


def _of_gyro(run: JointRun) -> np.ndarray:
    """What the gyro's noise alone adds to the information on the tensor, (6, 6)."""
    rows = run.model.rows
    weight = np.linalg.inv(run.noise[-3:, -3:] / rows.factor)
    return float(rows.used.sum()) * noise_in_alpha(run.run.rate, rows, run.gyro_noise, weight)


def _warnings(pooled: Pooled, bias: np.ndarray, sigma: np.ndarray) -> list[str]:
    warnings = [
        f"gyro noise biases {name} by about {1e3 * error:.3g} g·m²: record with a better gyro, or slower"
        for name, error, three in zip(COMPONENTS, bias, 3 * sigma, strict=True)
        if abs(error) > 0.1 * three
    ]
    if pooled.scatter > LEAST_SCATTER:
        warnings.append(
            f"the runs scatter {pooled.scatter:.1f} times more than their own noise says: something changes"
        )
    return warnings


def _assumptions(specific_force: SpecificForce, runs: int) -> tuple[str, ...]:
    shared = ("delay and rotation are the same in all runs",) if runs > 1 else ()
    return (
        OF_FORCE[specific_force],
        *shared,
        "the load cell's noise is white over the motion's band",
        "the gyro's noise is white",
        "the platform is rigid",
    )


def _diagnostics(runs: Sequence[JointRun], pooled: Pooled, factor: float) -> dict[str, object]:
    names = ("inertia", "mass", "r_cg", "delay", "rotation", "force_offset", "moment_offset", "gyro_bias")
    return {
        "prior_share": {name: _share(pooled, SLICES[name]).tolist() for name in names},
        "scatter_between_runs": pooled.scatter,
        "coverage_factor": factor,
        "gyro_bias": [theta[SLICES["gyro_bias"]].tolist() for theta in pooled.theta],
        "tilt": [theta[SLICES["tilt"]].tolist() for theta in pooled.theta],
        "noise": [np.sqrt(np.diag(run.noise)).tolist() for run in runs],
        "steps": [int(run.fit.steps) for run in runs],
    }


def _run_estimate(fitted_run: JointRun, theta: np.ndarray) -> RunEstimate:
    """The run by itself, with the offsets of the pooled estimate."""
    covariance, _ = fitted_run.posterior()
    tensor, run, rows = SLICES["inertia"], fitted_run.run, fitted_run.model.rows
    return RunEstimate(
        run.name, run.sha256, fitted_run.theta[tensor], np.sqrt(np.diag(covariance)[tensor]),
        int(rows.used.sum()) * rows.factor, run.rate, np.sqrt(np.diag(fitted_run.noise)[-3:]), 1 / run.rate,
        _offsets(theta, covariance), True, run.segments, run.detected, run.left_out, run.overview,
        theta[SLICES["force_offset"]], trace=_trace(fitted_run, theta),
    )  # fmt: skip


def _trace(fitted_run: JointRun, theta: np.ndarray) -> Trace:
    """Residuals and motion of the rows that count, in the motion's band."""
    used = np.asarray(fitted_run.model.rows.used) > 0
    signals = [np.asarray(signal).T[used] for signal in _fitted(fitted_run.model, jnp.asarray(theta))]
    left, fitted, omega, alpha = signals
    t = float(fitted_run.run.t[0]) + np.asarray(fitted_run.model.rows.t)[used]
    return trace(t, left, fitted + left, omega, alpha)


@eqx.filter_jit
def _fitted(model: Model, theta: Float[Array, " count"]) -> tuple[Array, Array, Array, Array]:
    """Residual moment, the moment that motion and tensor ask for, angular velocity and acceleration."""
    x = unknowns(theta)
    motion = kinematics(model, x)
    needed = moment_about_cg(x.inertia, motion.omega, motion.alpha)
    return residuals(model, x, motion)[-3:], needed, motion.omega, motion.alpha


def _offsets(theta: np.ndarray, covariance: np.ndarray) -> Offsets:
    """The constant part of ``M - r × F``, with all of its uncertainty."""
    r, force = theta[SLICES["r_cg"]], theta[SLICES["force_offset"]]
    by = np.zeros((3, len(theta)))
    by[:, SLICES["moment_offset"]] = np.eye(3)
    by[:, SLICES["force_offset"]], by[:, SLICES["r_cg"]] = -cross_matrix(r), cross_matrix(force)
    return Offsets(theta[SLICES["moment_offset"]] - np.cross(r, force), by @ covariance @ by.T, np.zeros(3))
