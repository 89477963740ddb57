"""Recorded runs: from MCAP files and an experiment file to the tensor."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from identify.identification import Identification, identify
from identify.run import Run, RunError
from rig.bag import read
from rig.channels import Recording as BagRecording
from uq.experiment import Experiment
from uq.provenance import provenance
from uq.recording import Recording


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
    bag = read(path, wrench=recording.wrench_topic, imu=recording.motion_topic)
    sign = {"on_body": 1.0, "on_sensor": -1.0}[wrench_meaning(bag, recording)]
    warnings: list[str] = []
    wrench_time, imu_time = _instants(bag, warnings)
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


def wrench_meaning(bag: BagRecording, recording: Recording) -> str:
    """Return ``on_body`` or ``on_sensor``: what the experiment declares, else the run's metadata, else ``on_body``.

    Raises:
        RunError: the two contradict each other.
    """
    said = bag.metadata.get("rig.run", {}).get("wrench")
    said = said if said in ("on_body", "on_sensor") else None
    if recording.wrench and said and recording.wrench != said:
        raise RunError(
            f"{bag.path.name} says that its wrench is {said}, recording.wrench in the experiment says "
            f"{recording.wrench}: correct the experiment"
        )
    return recording.wrench or said or "on_body"


def _instants(bag: BagRecording, warnings: list[str]) -> tuple[np.ndarray, np.ndarray]:
    """The stamps [ns] of wrench and IMU; the log's times of both where either has none, since clocks must not mix."""
    bare = [channel.topic for channel in (bag.wrench, bag.imu) if not np.any(channel.stamp != 0)]
    if not bare:
        return bag.wrench.stamp, bag.imu.stamp
    warnings.append(f"no stamps in the headers of {' and '.join(bare)}: took the log's times for both sensors")
    return bag.wrench.log_time, bag.imu.log_time


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
        remove_offsets=experiment.recording.offsets == "estimate" if remove_offsets is None else remove_offsets,
        mass=experiment.mass,
    )
    sign = (
        ()
        if "wrench" in experiment.document.get("recording", {})
        else ("the wrench is that on the body, in the body frame, at Q",)
    )
    inputs = [{"file": str(path), "sha256": run.sha256} for path, run in zip(paths, runs, strict=True)]
    return replace(
        result,
        assumptions=(*sign, *result.assumptions),
        provenance=provenance(**experiment.inputs(), inputs=inputs),
    )
