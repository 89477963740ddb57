"""The joint maximum-a-posteriori estimate of tensor, mass, r_CG, offsets, delay and rotation."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from identify.estimation.joint.joint_model import SLICES, SpecificForce
from identify.estimation.joint.joint_result import joint_result
from identify.estimation.joint.priors import STATIC, Alignment, ConstantError, PriorBlock, Setting, error_blocks, linked
from identify.estimation.joint.single_run import JointRun, joint_run
from identify.estimation.methods.base import Method, Problem
from identify.exceptions import RunError
from identify.floating_point import check_precision
from identify.results.identification_result import Identification
from identify.signals.run import Run

STILL_WITHIN = 0.003
"""Standard uncertainty of the point that is at rest, from the centre of gravity, where none is declared [m]."""


class JointEstimator(Method):
    """All unknowns of all channels together; see :mod:`identify.estimation.joint`."""

    type_a = (
        "Tensor, mass, centre of gravity, offsets, delay and rotation are joint maximum-a-posteriori estimates. What "
        "the runs show, residuals and scatter between runs, is evaluated as type A."
    )
    estimates = frozenset(
        {"mass", "cell_bias", "cell_scale", "cell_cross_talk", "cell_misalignment", "cell_drift",
         "gyro_bias", "gyro_drift", "gyro_scale", "gyro_misalignment", "gyro_delay"}
    )  # fmt: skip

    def fit(self, problem: Problem) -> Identification:
        """Return the tensor with its uncertainty.

        Raises:
            RunError: no float64, offsets that are taken from rest, a run that is too short or has no solution, a motion
                that does not identify the tensor.
        """
        if check_precision("float64"):
            raise RunError("the joint estimate needs float64: run jax.config.update('jax_enable_x64', True) first")
        if problem.offsets == "still":
            raise RunError(
                'the joint estimate finds offsets itself: write offsets = "estimate", or use the method source'
            )
        declared = problem.estimator
        declared_band = None if declared is None else declared.band or declared.lowpass
        band = problem.band if declared_band is None else declared_band
        specific_force = specific_force_source(problem)
        problem = replace(problem, errors=beside_alignment(problem.errors))
        setting = Setting(
            blocks=prior_blocks(problem, specific_force), alignment=problem.alignment or Alignment(), band=band,
            specific_force=specific_force, gravity=problem.gravity, scale=tensor_scale(problem.runs, band),
            errors=problem.errors, drawn_by_mounting=problem.drawn_by_mounting,
            lasting={} if problem.centre is None else problem.centre.lasting_errors,
        )  # fmt: skip
        fitted = problem.by_run(partial(checked_run, setting=setting))
        return joint_result(fitted, setting, problem.offsets)


def checked_run(run: Run, setting: Setting) -> JointRun:
    """Return a run's joint estimate, its centre of gravity still where it is declared so.

    Raises:
        RunError: see :func:`identify.estimation.joint.single_run.joint_run` and :func:`check_still`.
    """
    fitted = joint_run(run, setting)
    if setting.specific_force == "still":
        check_still(fitted)
    return fitted


def beside_alignment(errors: Mapping[str, ConstantError]) -> dict[str, ConstantError]:
    """Return declared errors without delay and rotation of the IMU, whose prior is the alignment's.

    Those that are correlated with other errors stay: a calibration has found them together.
    """
    aligned = ("delay", "rotation")
    return {name: error for name, error in errors.items() if error.correlated_as or error.unknown not in aligned}


def prior_blocks(problem: Problem, specific_force: SpecificForce) -> dict[tuple[str, ...], PriorBlock]:
    """Return the prior of body, offsets and declared errors."""
    still = PriorBlock(np.zeros(3), STILL_WITHIN**2 * np.eye(3))
    assumed = {("cg_from_still",): still} if specific_force == "still" else {}
    blocks = static_prior(problem) | assumed | error_blocks(problem.errors)
    shared = {name: error for name, error in problem.errors.items() if error.shared}
    return linked(blocks, shared, {} if problem.centre is None else problem.centre.lasting_errors)


def static_prior(problem: Problem) -> dict[tuple[str, ...], PriorBlock]:
    """Return the prior of mass, r_CG and offsets: a static calibration, or the figures that are stated.

    What is not stated gets a standard uncertainty as large as the signals, so that the runs determine it.
    """
    if problem.centre is not None:
        return {STATIC: PriorBlock(problem.centre.values, problem.centre.covariance)}
    force, moment = (
        np.sqrt(np.mean([(getattr(run, name) ** 2).mean() for run in problem.runs])) for name in ("force", "moment")
    )
    if problem.mass is None:
        mass = sigma = np.sqrt(3) * force / problem.gravity
    else:
        mass, sigma = problem.mass, problem.mass_uncertainty or 0.0
    free = 0.0 if problem.offsets == "none" else 1.0
    return {
        ("mass",): PriorBlock(np.array([mass]), np.array([[sigma**2]])),
        ("r_cg",): PriorBlock(problem.r_cg, np.diag(problem.sigma_r_cg**2)),
        ("force_offset",): PriorBlock(np.zeros(3), free * force**2 * np.eye(3)),
        ("moment_offset",): PriorBlock(np.zeros(3), free * moment**2 * np.eye(3)),
    }


def specific_force_source(problem: Problem) -> SpecificForce:
    """Return where the specific force at the centre of gravity comes from."""
    if problem.cg_motion == "still":
        return "still"
    return "accelerometer" if all(run.specific_force is not None for run in problem.runs) else "none"


def tensor_scale(runs: Sequence[Run], band: float) -> float:
    """Return the tensor's order of magnitude [kg·m²]: moment over angular acceleration at the highest frequency."""
    moment, omega = (max(float(np.square(getattr(run, name)).mean()) for run in runs) for name in ("moment", "omega"))
    return float(np.sqrt(moment) / max(np.sqrt(omega) * 2 * np.pi * band, 1e-12)) or 1.0


PLACED_WITHIN = 0.01
"""Distance of an accelerometer from its declared position [m] that does not count as a contradiction."""


def check_still(fitted: JointRun) -> None:
    """Refuse a run whose accelerometer shows that the centre of gravity is not still.

    What it reads, less gravity, is the acceleration of the point where it stands. If the centre of gravity is still,
    that is ``alpha × d + omega × (omega × d)`` with d the declared distance; least squares gives the true one.

    Args:
        fitted: a run with its joint estimate, its centre of gravity declared still.

    Raises:
        RunError: the two distances differ by more than the declared miss and the accelerometer's place explain.
    """
    run, at = fitted.run, fitted.fit.prediction
    if run.specific_force is None or run.imu_position is None:
        return
    levers = at.signals.levers
    columns = np.concatenate([levers, np.broadcast_to(np.eye(3), levers.shape)], axis=2).reshape(-1, 6)
    measured = (at.signals.accelerometer - at.at_known_point).reshape(-1)
    inverse = np.linalg.inv(columns.T @ columns)
    solution = inverse @ columns.T @ measured
    level = float(np.mean((measured - columns @ solution) ** 2))
    # the accelerometer from the point at rest, less the same from the centre of gravity: that of the latter from rest
    miss = solution[:3] - (run.imu_position - at.x["r_cg"])
    spread = np.sqrt(level * np.diag(inverse)[:3])
    beyond = np.abs(miss) - PLACED_WITHIN - 5 * spread
    declared = np.sqrt(np.diag(fitted.prior.covariance)[SLICES["cg_from_still"]])
    if (beyond > 3 * declared).any():
        raise RunError(
            f'the accelerometer in {run.name} contradicts cg_motion = "still": the CG moves as if '
            f"{1e3 * float(np.linalg.norm(miss)):.0f} mm from the point at rest; remove it, or correct imu_position"
        )
