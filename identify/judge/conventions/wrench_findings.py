"""Contradictions of a run with mechanics, each a finding with its cure, and the order in which they are looked for.

Reversed signs, turned or mirrored axes, weight that is missing, units, a moment taken elsewhere: each is a hypothesis
that must explain the run better than 'as declared' by a factor of exp(30) in likelihood before it is named. What no
sensor tells is compared with what the experiment declares: mass, centre of gravity.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from identify.judge.conventions.axis_hypotheses import Hypothesis, best_axes, scales
from identify.judge.conventions.convention_fit import (
    ALPHA,
    FORCE,
    MOMENT,
    MOMENT_TERMS,
    SPECIFIC,
    ConventionSums,
    DeclaredRig,
    ImuSignal,
    WrenchSignal,
    convention_sums,
)
from identify.judge.conventions.examined_run import LEAST_GRAVITY, ExaminedRun
from identify.judge.conventions.findings.axes import accelerometer_finding, other_axes
from identify.judge.conventions.findings.euler_rates import euler_rates_finding
from identify.judge.conventions.findings.filter import late_sensor
from identify.judge.conventions.findings.linear_acceleration import gravity_removed
from identify.judge.conventions.findings.mirror import ImuMirrored, mirrored_wrench
from identify.judge.conventions.findings.point import other_point
from identify.judge.conventions.findings.sign import SignReading, sign_finding
from identify.judge.conventions.findings.turned import TurnedALittle, rotation_finding, small_turn_findings
from identify.judge.conventions.findings.unit import imu_unit_findings, unit_findings_of_run
from identify.judge.conventions.findings.weight import weight_missing, weight_partly_missing
from identify.judge.conventions.free_rotation import explains, oblique_rotation, other_sign
from identify.judge.conventions.gravity_findings import AttitudeSignal, run_gravity
from identify.judge.conventions.imu_conventions import in_free_fall, in_si
from identify.judge.conventions.removed_weight import apparent_mass
from identify.judge.findings import Finding


def imu_findings(imu: ImuSignal, topic: str, wrench: WrenchSignal | None = None) -> list[Finding]:
    """Judge an IMU's units, axes and gravity by its signals; ``wrench``: of the load cell, where there is one."""
    return [*imu_unit_findings(imu, topic), *accelerometer_finding(imu, topic), *gravity_removed(imu, topic, wrench)]


def wrench_findings(
    wrench: WrenchSignal,
    imu: ImuSignal,
    declared: DeclaredRig,
    *,
    wrench_topic: str,
    imu_topic: str,
    attitude: AttitudeSignal | None = None,
) -> list[Finding]:
    """Judge a run's wrench on the body and motion together, both in the body frame and SI as far as declared.

    ``attitude``: at the IMU's instants; None: that of its gyro.
    """
    if min(len(wrench.time), len(imu.time)) < 10 or not all((np.diff(s.time) > 0).all() for s in (wrench, imu)):
        return []
    imu = in_si(imu)
    sums = convention_sums(wrench, imu)
    if sums is None or sums.size(SPECIFIC) < LEAST_GRAVITY or in_free_fall(imu):
        return []
    if min(float(sums.changes(columns)) for columns in (FORCE, MOMENT, ALPHA)) < 1e-20:
        return []
    if declared.measured and (rates := euler_rates_finding(wrench, imu, imu_topic)):
        return rates
    verdict = run_gravity(wrench, imu, attitude, declared, wrench_topic)
    if verdict.final:
        return verdict.findings
    if verdict.gravity is not None and attitude is not None and attitude.gravity is not None:
        change = np.einsum("nji,j->ni", attitude.to_rest, attitude.gravity - verdict.gravity)
        imu = imu._replace(specific_force=imu.specific_force + change)
        sums = convention_sums(wrench, imu) or sums
    upward = 0.0 if attitude is None or attitude.source == "gyro" else attitude.upward(imu.specific_force)
    examined = ExaminedRun(sums, declared, wrench_topic, imu_topic, upward=upward)
    findings = list(findings_of_run(examined))
    if any(isinstance(finding, TurnedALittle) for finding in findings):
        findings = _late_in_place_of_turned(wrench, imu, examined) or findings
    return [*verdict.findings, *findings]


def _late_in_place_of_turned(wrench: WrenchSignal, imu: ImuSignal, run: ExaminedRun) -> list[Finding]:
    """Return the findings with a sensor that is late, where without its lag no small turn is left; none: one is."""
    lagging = late_sensor(wrench, imu, run.wrench)
    sums = None if lagging is None else convention_sums(wrench._replace(time=wrench.time - lagging.lag), imu)
    if lagging is None or sums is None:
        return []
    findings = list(findings_of_run(ExaminedRun(sums, run.declared, run.wrench, run.imu, upward=run.upward)))
    return [] if any(isinstance(finding, TurnedALittle) for finding in findings) else [lagging, *findings]


def findings_of_run(run: ExaminedRun) -> Iterator[Finding]:
    """Yield all findings by force, moment and motion, the gravest first.

    Each step corrects the sums for its finding before the next looks at them.
    """
    weight = apparent_mass(run.sums, run.declared.mass)
    weighed = run.declared.weighed and not weight.missing
    given = scales(run.sums, weight=weighed)
    rotation = oblique_rotation(run.sums, given, weighed=weighed)
    if rotation is not None:
        yield rotation_finding(run, rotation)
        given = rotation.given
    force, moment = explains(run.sums, FORCE, given.force), explains(run.sums, MOMENT, given.moment)
    if rotation is None and (force or moment):
        yield from _axes_and_signs(run, best_axes(run.sums, given))
    if not run.declared.weighed or not (force and moment):
        return
    if weight.missing:
        yield weight_missing(run, weight, given)
        return
    yield from unit_findings_of_run(run, weight, given)
    yield from weight_partly_missing(run, given)
    yield from small_turn_findings(run, scales(run.sums, weight=True, terms=MOMENT_TERMS))
    yield from other_point(run)


def findings_at_rest(run: ExaminedRun, upside_down: SignReading) -> Iterator[Finding]:
    """Yield the findings on static poses, whose force alone tells axes and signs.

    Args:
        run: the poses.
        upside_down: words and cure where the attitude has the other sign.
    """
    by_force = _without_moment(run.sums)
    given = scales(by_force, weight=False)
    rotation = oblique_rotation(by_force, given, weighed=False)
    if rotation is not None:
        other = other_sign(by_force, rotation)
        others = [] if other is None else [run.wrench_cure(other.reversed.matrix @ other.matrix.T)]
        yield rotation_finding(run, rotation, others)
    elif explains(by_force, FORCE, given.force):
        yield from _axes_and_signs(run, best_axes(by_force, given, at_rest=True), upside_down)


def _without_moment(sums: ConventionSums) -> ConventionSums:
    """The sums of static poses with a moment that any axes explain: nought, and a noise above the arithmetic's."""
    return replace(sums.scaled(MOMENT, 0.0), noise=(0.0, 1e-6), white=1.0)


def _axes_and_signs(
    run: ExaminedRun, fits: Sequence[Hypothesis], upside_down: SignReading | None = None
) -> Iterator[Finding]:
    best, matrix = fits[0], fits[0].matrix
    run.sums = best.applied(run.sums)
    if best.sensor == "imu":
        yield ImuMirrored(topic=run.imu, axes=matrix)
        return
    if best.accelerometer < 0 or np.array_equal(matrix, -np.eye(3)):
        yield sign_finding(run, fits, upside_down)
        matrix = matrix if np.linalg.det(matrix) > 0 else -matrix
    if np.linalg.det(matrix) < 0:
        yield mirrored_wrench(run, fits)
    elif not np.array_equal(matrix, np.eye(3)):
        yield other_axes(run, run.sums.turned(wrench=matrix.T), [replace(best, matrix=matrix), *fits[1:]])
