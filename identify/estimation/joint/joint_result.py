"""The joint estimate of one or more runs as a result: tensor, mass, centre of gravity, offsets, delay, rotation."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
import scipy
from jaxtyping import Float

from identify.choices import OffsetChoice
from identify.display.rounding import significant
from identify.estimation.joint.joint_model import SLICES, TEN, Model, SpecificForce
from identify.estimation.joint.joint_pooling import PooledJoint, pool, shared_unknowns
from identify.estimation.joint.predicted_wrench import PredictedWrench
from identify.estimation.joint.prior_departure import departures
from identify.estimation.joint.priors import STATIC, Alignment, Setting, axes_of, calibrated, correlated, indices
from identify.estimation.joint.single_run import JointRun, alpha_noise_gain
from identify.least_squares.covariance_matrices import root_of
from identify.least_squares.offsets import Offsets
from identify.least_squares.pooling import LEAST_EXCESS, scatter_warning
from identify.least_squares.residual_spectrum import Trace, longest_segment, thinned, trace
from identify.results.alignment import Aligned, alignment_warnings, turn_warnings
from identify.results.identification_result import RESIDUALS, Identification
from identify.results.ledger import Ledger, Row
from identify.results.mass_and_centre import ESTIMATED
from identify.results.run_estimate import RunEstimate
from identify.results.weak_components import contradicts_bodies
from identify.rigid_body.inertia import COMPONENTS
from identify.rigid_body.regressor import cross_matrix
from identify.signals.estimator_spec import EstimatorSpec

FORCE_ASSUMPTION = {
    "still": "the centre of gravity stays where it is: the specific force is gravity's, through the gyro's attitude",
    "accelerometer": "the specific force at the centre of gravity is the accelerometer's, carried there",
    "none": "the centre of gravity is not declared still and there is no accelerometer: the force is used as measured, "
    "and does not determine the mass (weigh the body, or record static poses)",
}
WEIGHED = 0.9
"""Standard uncertainty over the mass from which no mass is stated where nothing tells it: that of its prior is one."""


def joint_result(joint_runs: Sequence[JointRun], setting: Setting, offsets: OffsetChoice) -> Identification:
    """Return the tensor with its uncertainty from all runs together.

    Args:
        joint_runs: one or more runs of one body on one rig, each by itself.
        setting: that they were estimated with.
        offsets: where they come from, for the result.
    """
    prior = joint_runs[0].prior
    drawn = setting.drawn_by_mounting
    is_calibrated = calibrated(setting.blocks)
    shared = shared_unknowns(setting.errors, calibrated=is_calibrated, drawn_by_mounting=drawn)
    by_mounting = {*drawn, *(error.unknown for error in setting.errors.values() if not error.shared)} - shared
    pooled = pool([fitted_run.solved for fitted_run in joint_runs], shared, by_mounting)
    by_residuals = float(np.sum([fitted_run.degrees_of_freedom for fitted_run in joint_runs]))
    freedom = pooled.degrees_of_freedom if pooled.scatter > 1 else by_residuals
    factor = float(scipy.special.stdtrit(freedom, 0.975))
    tensor, mass = SLICES["inertia"], SLICES["mass"].start
    value, covariance = pooled.theta[0], pooled.covariance
    inertia, effects = value[tensor], _effects_of_axes(pooled, setting)
    half = factor * np.sqrt(np.diag(covariance)[tensor])
    bias = _bias(joint_runs, pooled)[tensor]
    delay, rotation = (_aligned(pooled, name, factor) for name in ("delay", "rotation"))
    warnings = contradicts_bodies(inertia, covariance[tensor, tensor])
    declarations = departures(value, prior)
    warnings += [declaration.text for declaration in declarations]
    warnings += [f"{fitted_run.run.name}: {text}" for fitted_run in joint_runs for text in fitted_run.run.warnings]
    # nothing weighs the body where the force is as measured: what is left of its mass is then the prior
    weighed = setting.specific_force != "none" or covariance[mass, mass] < (WEIGHED * value[mass]) ** 2
    cell_may_turn = _cell_may_turn(setting)
    # what a calibration has found is not for the motion to tell
    calibrated_unknowns = {error.unknown for error in setting.errors.values() if error.correlated_as}
    warnings += alignment_warnings(
        None if "delay" in calibrated_unknowns else delay,
        None if cell_may_turn or "rotation" in calibrated_unknowns else rotation,
    )
    if not cell_may_turn and setting.alignment.sigma_rotation == Alignment().sigma_rotation:
        warnings += turn_warnings(rotation, inertia, half)
    warnings += _warnings(pooled, bias, half / factor, len({fitted_run.run.mounting for fitted_run in joint_runs}))
    rows = _rows(pooled, setting, prior.covariance, effects)
    ten = value[indices(TEN)]
    if not weighed:
        ten[0], without_mass = np.nan, (np.arange(10) > 0)[:, None].astype(float)
        rows = [row.changed(without_mass) for row in rows]
    return Identification(
        value=ten,
        ledger=Ledger(
            tuple(replace(row, degrees_of_freedom=freedom) for row in rows), np.concatenate([np.zeros(4), bias])
        ),
        estimator=EstimatorSpec(f"joint, band {setting.band:.3g} Hz", "savitzky-golay", setting.band),
        runs=tuple(map(_run_estimate, joint_runs, pooled.theta)), warnings=tuple(warnings),
        assumptions=_assumptions(setting.specific_force, len(joint_runs)),
        diagnostics=_diagnostics(joint_runs, pooled, factor),
        method="joint", delay=delay, rotation=rotation, offsets=offsets,
        centre_from=ESTIMATED, declarations=declarations,
    )  # fmt: skip


def _cell_may_turn(setting: Setting) -> bool:
    """Whether a declared error may turn the load cell's axes: then its turn and the IMU's share one."""
    off_diagonal = ~np.eye(6, dtype=bool).ravel()
    cell_covariances = [error.covariance for error in setting.errors.values() if error.unknown == "cell_matrix"]
    return any(np.diag(covariance)[off_diagonal].any() for covariance in cell_covariances)


GROUPS = {
    "mass": ("mass",), "centre of gravity": ("r_cg",), "offsets": ("force_offset", "moment_offset"),
    "alignment": ("delay", "rotation", "accelerometer_bias"), "still centre of gravity": ("cg_from_still",),
}  # fmt: skip
"""Unknowns of each prior that a budget names, beside the priors of declared errors."""


def _rows(
    pooled: PooledJoint, setting: Setting, prior_covariance: np.ndarray, effects: Mapping[str, np.ndarray]
) -> list[Row]:
    """Rows of priors and declared errors, and of what the residuals show beside them."""
    declared = {error.unknown for error in setting.errors.values()}
    grouped = dict.fromkeys(("mass", "centre of gravity", "offsets"), ()) | {"static poses": STATIC}
    named = GROUPS | (grouped if calibrated(setting.blocks) else {})
    rows = _lasting_rows(pooled, setting, effects)
    in_poses = sum((effect[:, None] * effect for effect in setting.lasting.values()), np.zeros((10, 10)))
    for name, members in named.items():
        group = [unknown for unknown in members if unknown not in declared]
        if group:
            block = prior_covariance[np.ix_(indices(group), indices(group))]
            root = root_of(block - in_poses, block) if name == "static poses" else root_of(block)
            rows.append(Row(error=name, changes=pooled.by_prior[np.ix_(indices(TEN), indices(group))] @ root))
    shared = {name: error for name, error in setting.errors.items() if error.shared}
    for name, (error, *_) in correlated(shared).items():
        if name not in {row.key for row in rows}:
            columns = [effects[f"{name} {k + 1}"] for k in range(error.axes.shape[1])]
            rows.append(Row(error=name, changes=np.transpose(columns), key=name if error.correlated_as else ""))
    from_mountings = pooled.from_mountings[np.ix_(indices(TEN), indices(TEN))]
    rows.append(Row(error="drawn by mounting", changes=root_of(from_mountings)))
    rows = [row for row in rows if row.changes.any()]
    total = pooled.covariance[np.ix_(indices(TEN), indices(TEN))]
    # what the priors do not make of the posterior is the residuals': so the rows add up to the whole
    remaining = root_of(total - Ledger(tuple(rows)).covariance, total)
    residuals = Row(error=RESIDUALS, changes=remaining, tier="measured", evaluation="A")
    return [residuals, *rows]


def _lasting_rows(pooled: PooledJoint, setting: Setting, effects: Mapping[str, np.ndarray]) -> list[Row]:
    """Rows of errors that act in the static poses as well, and are the same in another body's result."""
    by_static = pooled.by_prior[np.ix_(indices(TEN), indices(STATIC))]
    columns: dict[str, list[np.ndarray]] = {}
    for label, effect in setting.lasting.items():
        columns.setdefault(label.rpartition(" ")[0], []).append(effects.get(label, by_static @ effect))
    return [
        Row(error="static poses" if " " in key else key, changes=np.transpose(parts), key=key)
        for key, parts in columns.items()
    ]


def _effects_of_axes(pooled: PooledJoint, setting: Setting) -> dict[str, np.ndarray]:
    """Errors of the ten parameters by one standard uncertainty of each axis of declared errors, (10,) each.

    The prior mean of such an error is off by minus itself, that of a static calibration by what it did there.
    """
    by_prior = pooled.by_prior[indices(TEN)]
    by_static = by_prior[:, indices(STATIC)]
    shared = {name: error for name, error in setting.errors.items() if error.shared}
    return {
        name: by_static @ setting.lasting.get(name, np.zeros(10))
        - sum((by_prior[:, indices([part.unknown])] @ part.numbers for part in parts), np.zeros(10))
        for name, parts in axes_of(shared).items()
    }


def _aligned(pooled: PooledJoint, name: str, factor: float) -> Aligned:
    where = SLICES[name]
    value, covariance = pooled.theta[0][where], pooled.covariance[where, where]
    half = factor * np.sqrt(np.diag(covariance))
    return Aligned(value, covariance, np.stack([value - half, value + half], axis=1), _share(pooled, where))


def _share(pooled: PooledJoint, where: slice) -> np.ndarray:
    total = np.diag(pooled.covariance)[where]
    return np.where(total > 0, np.diag(pooled.from_prior)[where] / np.where(total > 0, total, 1.0), 1.0)


def _bias(runs: Sequence[JointRun], pooled: PooledJoint) -> np.ndarray:
    """Expected error of the first run's unknowns from the gyro's noise in alpha, to first order, (count,).

    What is predicted is ``A(theta) alpha``. Noise n of alpha adds ``-A n`` to the residuals and ``dA/dtheta n`` to
    their derivatives, so that their product has an expectation: errors in variables.
    """
    prior = runs[0].prior
    score = np.sum([_noise_score(run, theta) for run, theta in zip(runs, pooled.theta, strict=True)], axis=0)
    # one step of Newton from the mean gradient, which without noise of alpha is zero, by equations as in white noise.
    # Weights belong to gradients of residuals: in directions that the motion hardly tells, as those of calibrated
    # errors, they would enlarge this one many times. The price: with coloured noise and declared gains it is too small,
    # by up to a half. Unknowns of single runs err alike in all, as if they were shared
    normal = np.sum([run.fit.normal for run in runs], axis=0) + np.diag(prior.counted)
    return np.asarray(-prior.root @ np.linalg.solve(normal, prior.root.T @ score))


def _noise_score(run: JointRun, theta: np.ndarray) -> np.ndarray:
    """Expectation of what alpha's noise adds to the gradient of half the weighted squares, (count,)."""
    rows = run.model.rows
    variance = run.gyro_noise**2 * alpha_noise_gain(run.run.rate, rows)
    weight = np.linalg.inv(run.noise / rows.factor)
    matrix = _by_alpha(run.model, theta)
    # Σ_a Var(α_a) (∂A/∂θ)_aᵀ W A_a: derivative and residual hold the same noise
    slope = np.stack([(_by_alpha(run.model, theta + step) - _by_alpha(run.model, theta - step)) / (2 * STEP)
                      for step in STEP * np.eye(len(theta))], axis=-1)  # fmt: skip
    return np.asarray(float(rows.used.sum()) * np.einsum("rat,rs,sa,a->t", slope, weight, matrix, variance))


STEP = 1e-5
"""Step of central differences, in SI: the prediction is nearly a cubic in each unknown."""


def _by_alpha(model: Model, theta: np.ndarray) -> Float[np.ndarray, "rows 3"]:
    """Return the derivative of the predicted rows by the angular acceleration that the IMU measures."""
    at = PredictedWrench(replace(model, used=np.arange(len(model.used)) == 0), theta)
    by_axis = (at.signals.turn / at.signals.scale)[None]
    return at.counted(at.sensitivity @ at.changed(0 * by_axis, by_axis, 0 * by_axis))[0]


def _warnings(pooled: PooledJoint, bias: np.ndarray, sigma: np.ndarray, mountings: int) -> list[str]:
    warnings = [
        f"gyro noise biases {name} by about {significant(1e3 * error, 2)} g·m²: record with a better gyro, or slower"
        for name, error, three in zip(COMPONENTS, bias, 3 * sigma, strict=True)
        if abs(error) > 0.1 * three
    ]
    return [*warnings, *([scatter_warning(pooled.scatter, mountings)] if pooled.scatter > LEAST_EXCESS else [])]


def _assumptions(specific_force: SpecificForce, runs: int) -> tuple[str, ...]:
    shared = ("delay and rotation are the same in all runs",) if runs > 1 else ()
    return (
        FORCE_ASSUMPTION[specific_force],
        *shared,
        "the load cell's noise is the same over a run",
        "the gyro's noise is white",
        "the platform is rigid",
    )


def _diagnostics(runs: Sequence[JointRun], pooled: PooledJoint, factor: float) -> dict[str, object]:
    names = ("inertia", "mass", "r_cg", "delay", "rotation", "force_offset", "moment_offset", "gyro_bias")
    return {
        "prior_share": {name: _share(pooled, SLICES[name]).tolist() for name in names},
        "scatter_between_runs": pooled.scatter,
        "coverage_factor": factor,
        "gyro_bias": [theta[SLICES["gyro_bias"]].tolist() for theta in pooled.theta],
        "tilt": [theta[SLICES["tilt"]].tolist() for theta in pooled.theta],
        "noise": [np.sqrt(np.diag(run.noise)).tolist() for run in runs],
        "steps": [run.fit.steps for run in runs],
    }


def _run_estimate(fitted_run: JointRun, theta: np.ndarray) -> RunEstimate:
    """The run by itself, with the offsets of the pooled estimate."""
    run, rows, covariance = fitted_run.run, fitted_run.model.rows, fitted_run.covariance
    tensor, centre = SLICES["inertia"], SLICES["r_cg"]
    return RunEstimate(
        file=run.name, sha256=run.sha256, inertia=fitted_run.theta[tensor],
        standard_uncertainty=np.sqrt(np.diag(covariance)[tensor]), samples=int(rows.used.sum()) * rows.factor,
        rate=run.rate, residual=np.sqrt(np.diag(fitted_run.noise)[-3:]), correlation_time=1 / run.rate,
        offsets=_offsets(theta, covariance), alone=True, segments=run.segments, detected=run.detected,
        left_out=run.left_out, overview=run.overview, force_offset=theta[SLICES["force_offset"]],
        mounting=run.mounting, r_cg=fitted_run.theta[centre], sigma_r_cg=np.sqrt(np.diag(covariance)[centre]),
        trace=_trace(fitted_run, theta),
    )  # fmt: skip


def _trace(fitted_run: JointRun, theta: np.ndarray) -> Trace:
    """Residuals and motion of the rows that count, in the motion's band."""
    at = PredictedWrench(fitted_run.model, theta)
    residuals = at.counted(at.residuals[:, :, None])[:, -3:, 0]
    signals, needed = at.signals, at.regressor @ at.x["inertia"]
    motion = thinned(np.hstack([signals.omega, signals.alpha]))
    moment = (needed + residuals)[longest_segment(signals.t)]
    return trace(float(fitted_run.run.t[0]) + signals.t, residuals, moment, motion)


def _offsets(theta: np.ndarray, covariance: np.ndarray) -> Offsets:
    """The constant part of ``M - r × F``, with all of its uncertainty."""
    r, force = theta[SLICES["r_cg"]], theta[SLICES["force_offset"]]
    by = np.zeros((3, len(theta)))
    by[:, SLICES["moment_offset"]] = np.eye(3)
    by[:, SLICES["force_offset"]], by[:, SLICES["r_cg"]] = -cross_matrix(r), cross_matrix(force)
    return Offsets(theta[SLICES["moment_offset"]] - np.cross(r, force), by @ covariance @ by.T, np.zeros(3))
