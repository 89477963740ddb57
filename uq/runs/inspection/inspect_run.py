"""Inspection of a run: the health of its channels, and whether they obey mechanics.

Without an experiment nothing here imports JAX: ``inertia inspect`` starts at once.
"""

import contextlib
import os
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from identify.judge.conventions.convention_fit import MOST_SAMPLES, DeclaredRig, ImuSignal, WrenchSignal, reduced
from identify.judge.conventions.findings.clock import clock_findings
from identify.judge.conventions.findings.filter import filter_findings
from identify.judge.conventions.wrench_findings import imu_findings, wrench_findings
from identify.judge.findings import Finding
from rig.channels import ImuChannel, WrenchChannel, stamps_early
from rig.inspection.channel_health import LEAST_SAMPLES, SensorChannel, TopicFinding, rate_key
from rig.inspection.inspect import Inspection, inspect
from uq.runs.inspection.topic_finding import topic_finding

if TYPE_CHECKING:
    from uq.experiment.experiment import Experiment


def inspect_run(path: str | os.PathLike[str], experiment: "Experiment | None" = None) -> Inspection:
    """Look at the channels of a run, and at whether wrench and motion obey mechanics together.

    Args:
        path: the run.
        experiment: what the channels mean, mass and centre of gravity; None: the signals alone.

    Returns:
        A report of rates, jitter and clocks, and the findings with their cures; see docs/how-to/inspect.md.

    Raises:
        RigError: the file is no recording, cut or damaged.
        RunError: the run cannot be read as the experiment declares.
        OSError: it cannot be opened.
    """
    if experiment is None:
        judged: list[Finding] = []
        report = inspect(path, judge=partial(_without_experiment, judged))
        if report.imported:
            in_map = {topic_finding(part, imported=False): topic_finding(part, imported=True) for part in judged}
            report.findings = [in_map.get(finding, finding) for finding in report.findings]
        if report.gravity_removed:
            report.findings = [finding for finding in report.findings if finding.kind != "linear acceleration"]
        return report
    from identify.signals.run import RunError
    from uq.files.mistakes import ExperimentError
    from uq.runs.inspection.experiment_findings import experiment_findings
    from uq.runs.recorded.gravity_compensation import undo
    from uq.runs.recorded.load_run import load
    from uq.runs.recorded.time_window import cut

    def judge(channels: Sequence[SensorChannel], findings: list[TopicFinding]) -> list[TopicFinding]:
        restamped = {part.topic for part in channels if getattr(experiment.recording, rate_key(part)) is not None}
        findings = [part for part in findings if part.kind != "bunches" or part.topic not in restamped]
        band = experiment.estimator().band if experiment.estimators else None  # as `identify` reads it
        try:
            run = load(Path(path), experiment.recording, gravity=experiment.gravity, band=band, marks=False).run
        except RunError:
            if all(finding.kind not in ("not finite", "bunches", "constant") for finding in findings):
                raise
            return findings
        run = cut(run, None, ())
        if experiment.r_cg_from_q is not None and not experiment.r_cg_from_q.any():
            # About the centre of gravity the moment alone tells the tensor: the force may be missing.
            findings = [finding for finding in findings if finding.kind != "no force"]
        weighed, undone = run, False
        # Without mass or attitude the weight that was removed is not put back.
        with contextlib.suppress(RunError, ExperimentError):
            weighed, undone = undo(run, (), experiment)[0], True
        return [*findings, *experiment_findings(weighed, experiment, undone=undone)]

    return inspect(path, judge=judge)


def _without_experiment(
    judged: list[Finding], channels: Sequence[SensorChannel], findings: list[TopicFinding]
) -> list[TopicFinding]:
    """Findings on the signals alone: each IMU, and wrench and motion where neither is faulty otherwise.

    Those of mechanics are appended to ``judged``.
    """
    channels = [channel.taken(slice(MOST_SAMPLES)) for channel in channels]
    imus = [channel for channel in channels if isinstance(channel, ImuChannel)]
    wrenches = [channel for channel in channels if isinstance(channel, WrenchChannel)]
    origin = min((int(channel.stamp[0]) for channel in channels if len(channel.stamp)), default=0)
    findings = list(findings)
    wild = {finding.topic for finding in findings if finding.kind in ("not finite", "excess")}
    whole = [wrench for wrench in wrenches if len(wrench.stamp) >= LEAST_SAMPLES and wrench.topic not in wild]
    alone = WrenchSignal(_seconds(whole[0], origin), whole[0].force, whole[0].moment) if len(whole) == 1 else None
    for imu in imus:
        if len(imu.stamp) >= LEAST_SAMPLES and imu.topic not in wild:  # of such values nothing can be computed
            by_itself = imu_findings(_imu_signal(imu, origin), imu.topic, alone)
            judged += by_itself
            findings += [topic_finding(finding, imported=False) for finding in by_itself]
    topics = [channel.topic for channel in channels]
    findings.sort(key=lambda finding: topics.index(finding.topic))
    if len(wrenches) == len(imus) == 1 and all(finding.kind == "unit" for finding in findings):
        (wrench,), (imu,) = wrenches, imus
        signals = WrenchSignal(_seconds(wrench, origin), wrench.force, wrench.moment), _imu_signal(imu, origin)
        slower = reduced(signals[0]), reduced(signals[1])
        together = (
            clock_findings(*signals, stamps_early(wrench, imu), imu.topic)
            or list(filter_findings(*slower, wrench.topic))
            or wrench_findings(*slower, DeclaredRig(), wrench_topic=wrench.topic, imu_topic=imu.topic)
        )
        judged += together
        findings += [topic_finding(finding, imported=False) for finding in together]
    return findings


def _imu_signal(imu: ImuChannel, origin: int) -> ImuSignal:
    return ImuSignal(_seconds(imu, origin), imu.angular_velocity, imu.linear_acceleration)


def _seconds(channel: SensorChannel, origin: int) -> np.ndarray:
    """Times of measurement from a common origin [s]: doubles hold those of a calendar to 0.2 µs only."""
    return (channel.stamp - origin) * 1e-9
