"""Recorded runs: from MCAP files and an experiment file to the tensor."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from identify.identification import Identification, identify
from identify.run import Run, RunError
from rig.bag import read
from rig.channels import ImuChannel, WrenchChannel
from uq.experiment import Experiment, Recording
from uq.provenance import provenance


def load_run(path: str | Path, recording: Recording | None = None) -> Run:
    """Read a recorded run from MCAP: force and moment on the body at Q, angular velocity, all in B.

    Args:
        path: an MCAP file with WrenchStamped and Imu.
        recording: what its channels mean; None for our own runs.

    Raises:
        RigError: the file cannot be read, or a topic is missing.
        RunError: its data cannot be used.
    """
    recording = recording or Recording()
    bag = read(path, wrench=recording.wrench_topic, imu=recording.imu_topic)
    sign = {"on_body": 1.0, "on_sensor": -1.0}[recording.wrench]
    warnings: list[str] = []
    wrench_time, imu_time = (_instants(bag.path.name, channel, warnings) for channel in (bag.wrench, bag.imu))
    start = min(int(wrench_time[0]), int(imu_time[0]))
    run = Run.from_channels(
        (wrench_time - start) * 1e-9,
        sign * bag.wrench.force,
        sign * bag.wrench.moment,
        (imu_time - start) * 1e-9,
        bag.imu.angular_velocity,
        name=bag.path.name,
        sha256=bag.sha256,
    )
    return replace(run, warnings=(*run.warnings, *warnings))


def _instants(name: str, channel: WrenchChannel | ImuChannel, warnings: list[str]) -> np.ndarray:
    """The header's stamps [ns] where they are set, else the log's."""
    if np.any(channel.stamp != 0):
        return channel.stamp
    warnings.append(f"{channel.topic} has no stamps in its headers: took the log's times")
    return channel.log_time


def identify_files(
    paths: Sequence[str | Path],
    experiment: Experiment,
    *,
    estimator: str | None = None,
    remove_offsets: bool | None = None,
) -> Identification:
    """Identify the tensor from recorded runs of one body.

    Args:
        paths: MCAP files, one a run.
        experiment: r_CG with its uncertainty, estimators, what the channels mean.
        estimator: name of the estimator; None for the recording's, or the first.
        remove_offsets: whether constant offsets are estimated and removed; None: as the experiment says.

    Raises:
        ExperimentError, RigError, RunError: see :func:`load_run` and :func:`identify.identify`.
    """
    if len({Path(path).resolve() for path in paths}) < len(paths):
        raise RunError("a run is given twice: name each file once")
    spec = experiment.estimator(estimator)
    runs = [load_run(path, experiment.recording) for path in paths]
    result = identify(
        runs,
        r_cg=experiment.r_cg_from_q,
        sigma_r_cg=experiment.sigma_r_cg,
        estimator=spec,
        remove_offsets=experiment.recording.remove_offsets if remove_offsets is None else remove_offsets,
        mass=experiment.mass,
    )
    sign = (
        ()
        if "wrench" in experiment.document.get("recording", {})
        else ("the wrench is that on the body, in the body frame, at Q",)
    )
    return replace(
        result,
        assumptions=(*sign, *result.assumptions),
        provenance=provenance(**experiment.inputs(), inputs={run.name: run.sha256 for run in runs}),
    )
