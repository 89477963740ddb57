"""Tables of samples to our runs: the function behind ``inertia import``."""

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np

from identify.signals.run import RunError
from rig.channels import ImuChannel, WrenchChannel
from rig.exceptions import on_one_line
from rig.runs import write
from rig.toml_tables import TomlTable, WrongKeyError
from uq.experiment.recording_table import RecordingTable, SensorConventions, unit_name
from uq.files.csv_columns import ColumnsTable, read_columns
from uq.files.document import in_file, read_document
from uq.files.schema import Axes, declared_table, in_unit
from uq.files.units import scale
from uq.recorded.declared_channels import declared
from uq.recorded.table_recording import as_recording, silenced

NANOSECONDS = 1_000_000_000


class MapColumns(ColumnsTable, frozen=True, kw_only=True):
    """``[columns]`` of a map: the columns of time, wrench and motion."""

    SIGNALS = ("time", "force", "moment", "angular_velocity", "acceleration")
    time: str | None = None
    """The column of the time; or state ``rate``."""
    time_unit: Annotated[str, unit_name("s")] | None = None
    """Name of the unit of the time column."""
    rate: Annotated[float, in_unit("Hz", above=0)] | None = None
    """Sample rate [Hz] of a table without times."""
    force: Axes[str]
    """The columns of the force's components."""
    moment: Axes[str]
    """The columns of the moment's components."""
    angular_velocity: Axes[str]
    """The columns of the angular velocity's components."""
    acceleration: Axes[str] | None = None
    """The columns of the specific force's components."""

    def __post_init__(self) -> None:
        """Refuse both, or neither, of times and rate."""
        super().__post_init__()
        if (self.time is not None) == (self.rate is not None):
            raise WrongKeyError(
                "", f"has {'both time and' if self.rate else 'neither time nor'} rate: write one of them"
            )
        if (self.time_unit is None) != (self.rate is not None):
            advice = "remove it" if self.rate else 'add it, such as time_unit = "s"'
            raise WrongKeyError("time_unit", advice, "belongs to a time column")


class MapConventions(SensorConventions, frozen=True, kw_only=True):
    """``[recording]`` of a map: the conventions of the table's numbers, which a table itself does not state."""

    wrench: Literal["on_body", "on_sensor"]
    """Sign of the wrench in the table: that on the body, or the reaction on the sensor."""
    force_unit: Annotated[str, unit_name("N")]
    """Name of the force's unit, such as ``lbf``."""
    moment_unit: Annotated[str, unit_name("N*m")]
    """Name of the moment's unit, such as ``N*mm``."""
    angular_velocity_unit: Annotated[str, unit_name("rad/s")]
    """Name of the angular velocity's unit, such as ``deg/s``."""


class Map(TomlTable, frozen=True, kw_only=True):
    """Meaning of the columns in a table of samples."""

    columns: MapColumns
    """Columns of the table's signals."""
    recording: MapConventions
    """Signs, units and axes of the table's numbers."""

    @property
    def conventions(self) -> RecordingTable:
        """The conventions in the form in which an experiment declares them."""
        return RecordingTable(**self.recording.to_dict())

    @classmethod
    def load(cls, path: str | Path) -> "Map":
        """Read a map file.

        Raises:
            ExperimentError: it is not TOML, or not a map.
            OSError: it cannot be read.
        """
        with in_file(path):
            return cls.from_dict(read_document(path, "a map file")[0])

    @classmethod
    def from_dict(cls, document: dict) -> "Map":
        """Build a map from the content of a file; see :meth:`load`."""
        return declared_table("", document, cls)


@dataclass(frozen=True)
class Imported:
    """A table that was written as a run."""

    path: Path
    """Path of the MCAP file."""
    samples: int
    assumptions: tuple[str, ...]
    """Assumptions about what the map does not state."""

    def to_dict(self) -> dict[str, Any]:
        """Return the content as plain values."""
        return {"path": str(self.path), "samples": self.samples, "assumptions": list(self.assumptions)}

    def __repr__(self) -> str:
        notes = [f"assumed: {text}" for text in self.assumptions]
        return "\n".join(map(on_one_line, [f"{self.samples:,} samples written to {self.path}", *notes]))


def import_table(path: str | Path, mapping: Map, output: str | Path, *, overwrite: bool = False) -> Imported:
    """Write a table of samples as a run of ours: SI units, the wrench on the body at Q, body frame.

    Args:
        path: a table in a text file, one row a sample.
        mapping: what its columns mean.
        output: the MCAP file to write.
        overwrite: replace an existing file.

    Returns:
        What was written, and what was assumed.

    Raises:
        RunError: the table cannot be used, or its time does not increase.
        RigError: the output exists.
        OSError: a file cannot be read or written.
    """
    table = read_columns(path, mapping.columns.columns)
    stamp = _stamps(table.get("time"), mapping, len(table["force"]), Path(path).name)
    nothing = np.zeros((len(stamp), 3))
    motion = table["angular_velocity"], table.get("acceleration", nothing)
    raw = as_recording(path, table["force"], table["moment"], *motion)
    absent = {"acceleration"} - set(table)
    rig = declared(raw, silenced(mapping.conventions, absent))
    (force, moment), (omega, acceleration) = rig.wrench(raw.wrench), rig.motion(raw.imu)
    imu = ImuChannel(
        topic="/imu", frame_id="body", log_time=stamp, stamp=stamp, angular_velocity=omega,
        linear_acceleration=acceleration,
    )  # fmt: skip
    write(
        output,
        wrench=WrenchChannel(topic="/wrench", frame_id="body", log_time=stamp, stamp=stamp, force=force, moment=moment),
        imu=imu,
        metadata={"rig.run": _about(raw.path, raw.sha256, rig.assumptions, accelerates=not absent)},
        overwrite=overwrite,
    )
    return Imported(Path(output), len(stamp), rig.assumptions)


def _stamps(time: np.ndarray | None, mapping: Map, count: int, name: str) -> np.ndarray:
    """Instants [ns]; a table whose time begins below zero begins at zero."""
    if time is None:
        return np.round(np.arange(count) * (NANOSECONDS / float(mapping.columns.rate or 1))).astype(np.int64)
    seconds = time[:, 0] * scale(str(mapping.columns.time_unit), "s")
    if seconds[-1] - min(seconds[0], 0) > 9e9:
        raise RunError(f"time in {name} reaches {seconds[-1]:.3g} s: correct columns.time_unit")
    back = np.flatnonzero(np.diff(seconds) <= 0)
    if len(back):
        raise RunError(f"time in {name} does not increase after sample {back[0] + 1}: correct the table")
    since = (time[:, 0] - time[0, 0]) * scale(str(mapping.columns.time_unit), "s")  # a count of days would cost digits
    return round(max(seconds[0], 0) * NANOSECONDS) + np.round(since * NANOSECONDS).astype(np.int64)


def _about(path: Path, digest: str, assumed: tuple[str, ...], *, accelerates: bool) -> dict[str, str]:
    imu = "in B" if accelerates else "in B; no acceleration was imported: it is zero"
    return {
        "imported": json.dumps({"file": path.name, "sha256": digest}),
        "assumed": json.dumps(assumed, ensure_ascii=False),
        "wrench": "on_body",
        "frames": json.dumps({"/wrench": "force and moment on the body at Q, in B", "/imu": imu}),
        "units": json.dumps({"force": "N", "moment": "N*m", "angular_velocity": "rad/s", "acceleration": "m/s^2"}),
    }
