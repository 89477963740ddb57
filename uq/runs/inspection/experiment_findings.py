"""Findings on a recorded run that contradicts mechanics or the experiment, of which ``identify`` warns."""

from dataclasses import replace
from typing import Any

import numpy as np

from identify.estimation.static_poses.centre_result import Centre
from identify.judge.conventions.attitude_findings import attitude_findings
from identify.judge.conventions.convention_fit import (
    MOST_SAMPLES,
    DeclaredRig,
    ImuSignal,
    WrenchSignal,
    reduced,
    samples_per_mean,
)
from identify.judge.conventions.findings.clock import clock_findings
from identify.judge.conventions.findings.filter import LateSensor, filter_findings, late_sensor
from identify.judge.conventions.gravity_findings import AttitudeSignal, Source, run_gravity
from identify.judge.conventions.wrench_findings import imu_findings, wrench_findings
from identify.judge.findings import Finding
from identify.judge.judged_part import judged_samples
from identify.signals.run import Run
from rig.inspection.channel_health import TopicFinding
from uq.experiment.experiment import Experiment
from uq.files.units import scale
from uq.runs.inspection.topic_finding import topic_finding

LEAST_LAG = 5e-3
"""Lag beyond what ``sigma_delay`` lets expect, from which it is named [s].

Choice: that of a low-pass of 30 Hz; at 1 Hz it changes a moment by 0.05 %.
"""


def experiment_findings(
    run: Run, experiment: Experiment, *, undone: bool = False, turn_free: bool = False
) -> list[TopicFinding]:
    """Judge the longest whole segment of a run that was read as the experiment declares.

    Args:
        run: wrench on the body about Q and motion, in B; without an accelerometer there is no finding.
        experiment: mass and centre of gravity, where stated, and what was declared already.
        undone: whether weight that a driver removed was put back.
        turn_free: whether the estimate finds a small turn of the IMU by itself: no news within ``sigma_rotation``. A
            turn within a declared misalignment is none anyway.
    """
    findings = _contradictions(run, experiment, undone=undone, turn_free=turn_free)
    return [topic_finding(finding, imported=bool(run.about.get("imported"))) for finding in findings]


def _contradictions(run: Run, experiment: Experiment, *, undone: bool, turn_free: bool) -> list[Finding]:
    longest = run.longest_segment
    if longest.stop - longest.start < 10:
        return []
    most = min(MOST_SAMPLES, judged_samples(run.band, run.rate))
    usable = slice(longest.start, min(longest.stop, longest.start + most))
    time = run.t[usable]
    specific = np.zeros_like(run.omega) if run.specific_force is None else run.specific_force
    recording = experiment.recording
    delay = recording.delay or 0.0 if recording.method == "joint" else 0.0
    imu = ImuSignal(time - delay, run.omega[usable], specific[usable])
    wrench = WrenchSignal(time, run.force[usable], run.moment[usable])
    if clocks := clock_findings(wrench, imu, run.stamps_early + delay, run.name, delay):
        return clocks
    imu, wrench, count = reduced(imu), reduced(wrench), samples_per_mean(time)
    attitude = _attitude(run, experiment, np.arange(usable.start, usable.stop)[count // 2 :: count][: len(imu.time)])
    rig = declared_rig(experiment, measured=run.gravity is None, undone=undone, turn_free=turn_free)
    rig = replace(rig, imu_position=run.imu_position)
    if attitude is not None and (contradicted := attitude_findings(imu, attitude.to_rest, rig, run.name)):
        return contradicted
    if run.specific_force is None:
        has_gravity = attitude is not None and attitude.gravity is not None
        return run_gravity(wrench, imu, attitude, rig, run.name).findings if has_gravity else []
    from_imu = imu_findings(imu, run.name, wrench)
    if any(finding.label in ("axes", "linear acceleration") for finding in from_imu):
        return from_imu
    if filtered := list(filter_findings(wrench, imu, run.name)):
        return [*from_imu, *filtered]
    together = wrench_findings(wrench, imu, rig, wrench_topic=run.name, imu_topic=run.name, attitude=attitude)
    # a zero along axes at rest moves in B as a lag would move the weight
    shows_lags = recording.method == "joint" and not run.zero_at_rest
    if not together and shows_lags and (lagging := late_sensor(wrench, imu, run.name)):
        together = [lagging] * (abs(lagging.lag) > LEAST_LAG + 3 * recording.alignment.sigma_delay)
    late_too = [replace(part, declared=delay) if isinstance(part, LateSensor) else part for part in together]
    return [*from_imu, *late_too]


def _attitude(run: Run, experiment: Experiment, instants: np.ndarray) -> AttitudeSignal | None:
    """Return the attitudes recorded at some instants, and what is declared of them; None: there are none."""
    if run.attitude is None:
        return None
    recording = experiment.recording
    gravity = recording.gravity_of_poses(experiment.gravity)
    source: Source = "quaternion" if run.gravity is None else "poses" if recording.urdf is None else "joints"
    return AttitudeSignal(
        to_rest=run.attitude[instants], gravity=run.gravity, source=source, accelerates=run.specific_force is not None,
        turned_back=recording.turns_back, zero_at_rest=run.zero_at_rest, up=-gravity / np.linalg.norm(gravity),
    )  # fmt: skip


def declared_rig(
    experiment: Experiment, *, measured: bool, undone: bool = True, turn_free: bool = False
) -> DeclaredRig:
    """Return the experiment's declarations on the body and on the recording.

    Args:
        experiment: the declarations.
        measured: whether the specific force is an accelerometer's.
        undone: whether weight that a driver removed was put back.
        turn_free: whether the estimate finds a small turn of the IMU by itself.
    """
    recording = experiment.recording
    removed = recording.removes_weight and not undone
    payload = experiment.mass if recording.payload_mass is None else recording.payload_mass
    sensors: dict[str, Any] = {
        "wrench_point": recording.wrench_point,
        "wrench_rotation": recording.wrench_rotation_to_body,
        "imu_rotation": recording.imu_rotation_to_body,
        "quaternion": recording.quaternion,
        "calibration": recording.calibration,
    }
    return DeclaredRig(
        mass=experiment.mass,
        measured=measured,
        removed=(payload or 0.0) if recording.removes_weight else 0.0,
        r_cg=experiment.r_cg_from_q,
        sigma_r_cg=np.asarray(experiment.sigma_r_cg),
        weighed=recording.zero != "loaded" and not removed,
        units=(_in_si(recording.force_unit, "N"), _in_si(recording.moment_unit, "N*m")),
        rate_unit=_in_si(recording.angular_velocity_unit, "rad/s"),
        turn=_sigma_turn(experiment, turn_free=turn_free),
        **{name: value for name, value in sensors.items() if value is not None},
    )


def _in_si(name: str | None, unit: str) -> float:
    return 1.0 if name is None else scale(name, unit)


def _sigma_turn(experiment: Experiment, *, turn_free: bool) -> np.ndarray:
    """Root mean square of the turn between IMU and load cell that is declared, each axis [rad]."""
    turns = [source for source in experiment.sources if source.perturbs in ("gyro_misalignment", "cell_misalignment")]
    sigmas = [np.hypot(source.standard_deviation, np.broadcast_to(source.mean, 3)) for source in turns]
    if turn_free and experiment.recording.sigma_rotation is not None:
        sigmas.append(np.broadcast_to(experiment.recording.sigma_rotation, 3))
    return np.sqrt(sum((sigma**2 for sigma in sigmas), np.zeros(3)))


def convention_warnings(
    run: Run, experiment: Experiment, *, turn_free: bool = False, zero: Centre | None = None
) -> tuple[str, ...]:
    """The findings as warnings of a result; ``turn_free`` as in :func:`experiment_findings`.

    What the load cell's zero explains, where static poses tell it, is no finding. The cell may have been zeroed since:
    so it must be one without that zero, too.
    """
    findings = experiment_findings(run, experiment, undone=True, turn_free=turn_free)
    if findings and zero is not None:
        rid = replace(run, force=run.force - zero.force_offset, moment=run.moment - zero.moment_offset)
        still = {finding.kind for finding in experiment_findings(rid, experiment, undone=True, turn_free=turn_free)}
        findings = [finding for finding in findings if {finding.kind} & still]
    return tuple(f"suspicious {replace(finding, topic=run.name)}" for finding in findings)
