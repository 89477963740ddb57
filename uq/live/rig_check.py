"""Check before a recording that an experiment fits a rig: the channels that it needs, and their meaning."""

from pathlib import Path

import numpy as np

from rig import channels
from rig.channels import ImuChannel, WrenchChannel
from rig.record.recorder import MEANING
from rig.record.rig_file import Rig
from uq.experiment.experiment import Experiment, ExperimentError
from uq.recorded.declared_channels import declared

SENSORS = {"wrench": ("wrench_topic", "load cell"), "imu": ("motion_topic", "IMU")}
"""Key of ``[recording]`` that names the topic of a device, and the device's name, by what it measures."""


def topics_of(rig: Rig, experiment: Experiment, path: Path) -> tuple[str, str]:
    """Return the topics of load cell and IMU that a live estimate takes.

    Args:
        rig: what will be recorded.
        experiment: what it will be identified with.
        path: of the file to come, for messages.

    Raises:
        ExperimentError: the rig has no such sensor, or several and none is named; a weight that was removed.
        RunError: what the rig records contradicts the experiment's ``[recording]``.
    """
    recording = experiment.recording
    if recording.removes_weight:
        raise ExperimentError(
            f"recording.compensated is {recording.compensated}, and the weight can be put back only when the run is "
            "over: record without --identify"
        )
    (wrench, frame), (imu, _) = (
        _topic_and_frame(rig, measures, getattr(recording, key)) for measures, (key, _) in SENSORS.items()
    )
    nothing, none = np.zeros(0, np.int64), np.zeros((0, 3))
    facts = MEANING | {f"{entry.name}.{key}": text for entry in rig.entries for key, text in entry.settings.items()}
    facts |= {f"{entry.name}.topic": entry.topic for entry in rig.entries}
    bag = channels.Recording(
        path, "", {"rig.run": facts},
        WrenchChannel(topic=wrench, frame_id=frame, log_time=nothing, stamp=nothing, force=none, moment=none),
        ImuChannel(
            topic=imu, frame_id="body", log_time=nothing, stamp=nothing, angular_velocity=none,
            linear_acceleration=none,
        ),
    )  # fmt: skip
    declared(bag, recording)
    return wrench, imu


def _topic_and_frame(rig: Rig, measures: str, named: str | None) -> tuple[str, str]:
    key, sensor = SENSORS[measures]
    topics = {
        topic: entry.frame_id
        for entry in rig.entries
        for channel, topic in zip(entry.device.channels, entry.topics, strict=True)
        if channel.measures == measures
    }
    if not topics:
        raise ExperimentError(f"{rig.path} has no {sensor}: --identify needs load cell and IMU")
    if named is None and len(topics) > 1:
        raise ExperimentError(
            f"{rig.path} has {len(topics)} of {sensor}: name one of {', '.join(topics)} as recording.{key}"
        )
    if named is not None and named not in topics:
        raise ExperimentError(
            f"recording.{key} is {named}, which no {sensor} of {rig.path} has: it has {', '.join(topics)}"
        )
    chosen = named or next(iter(topics))
    return chosen, topics[chosen]
