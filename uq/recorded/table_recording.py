"""A table's columns as a recording, so that the same functions process it."""

from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from rig import channels
from rig.channels import ImuChannel, WrenchChannel
from uq.experiment.recording_table import UNITS, RecordingTable
from uq.files.provenance import sha256


def silenced(recording: RecordingTable, quantities: set[str]) -> RecordingTable:
    """Return the declaration with a unit for quantities that a table lacks, so that nothing is assumed of them."""
    units: dict[str, Any] = {f"{name}_unit": recording.unit(name) or UNITS[name] for name in quantities}
    return msgspec.structs.replace(recording, **units)


def as_recording(
    path: str | Path, force: np.ndarray, moment: np.ndarray, omega: np.ndarray, acceleration: np.ndarray
) -> channels.Recording:
    """Return a table's columns as a recording without metadata."""
    times = np.arange(len(force))
    wrench = WrenchChannel(
        topic="force and moment", frame_id="", log_time=times, stamp=times, force=force, moment=moment
    )
    imu = ImuChannel(
        topic="angular velocity and acceleration", frame_id="", log_time=times, stamp=times, angular_velocity=omega,
        linear_acceleration=acceleration,
    )  # fmt: skip
    return channels.Recording(Path(path), sha256(path), {}, wrench, imu)
