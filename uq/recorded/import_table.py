"""Tables of samples to our runs: the function behind ``inertia import``."""

import json
import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from identify.signals.run import RunError
from rig.channels import ImuChannel, WrenchChannel
from rig.runs import write
from uq.experiment.recording_table import Recording, parse_recording
from uq.files.csv_columns import Columns, parse_columns, read_columns
from uq.files.document import ExperimentError, Table
from uq.files.units import UnitError, scale
from uq.recorded.declared_channels import declared
from uq.recorded.table_recording import as_recording, silenced

SIGNALS = {"time": 1, "force": 3, "moment": 3, "angular_velocity": 3, "acceleration": 3}
NEEDED = ("force", "moment", "angular_velocity")
DECLARES = (
    "wrench", "force_unit", "moment_unit", "angular_velocity_unit", "acceleration_unit", "wrench_rotation_to_body",
    "imu_rotation_to_body", "wrench_point", "calibration",
)  # fmt: skip
"""Keys of ``[recording]`` that a map may have: what changes numbers; the others stay with the experiment."""
NANOSECONDS = 1_000_000_000


@dataclass(frozen=True)
class Map:
    """What the columns of a table of samples mean."""

    columns: Columns
    recording: Recording
    time_unit: str | None
    """Name of the unit of the time column."""
    rate: float | None
    """Sample rate [Hz] of a table without times."""

    @classmethod
    def load(cls, path: str | Path) -> "Map":
        """Read a map file.

        Raises:
            ExperimentError: it is not TOML, or not a map.
            OSError: it cannot be read.
        """
        try:
            document = tomllib.loads(Path(path).read_text("utf-8"))
        except UnicodeDecodeError:
            raise ExperimentError(f"not a text file {path}: give a map file in TOML") from None
        except tomllib.TOMLDecodeError as error:
            raise ExperimentError(f"not TOML {path}: {error}") from None
        try:
            return cls.from_dict(document)
        except ExperimentError as error:
            raise ExperimentError(f"{error} (in {path})") from None

    @classmethod
    def from_dict(cls, document: dict) -> "Map":
        """Build a map from the content of a file; see :meth:`load`."""
        top = Table("", document)
        columns, time_unit, rate = top.table("columns", _columns)
        recording = top.table("recording", _declared)
        top.finish()
        return cls(columns, recording, time_unit, rate)


def _columns(table: Table) -> tuple[Columns, str | None, float | None]:
    columns = parse_columns(table, SIGNALS)
    time_unit = table.typed("time_unit", str, None)
    rate = table.quantity("rate", "Hz", None, positive=True)
    table.finish()
    for signal in NEEDED:
        if signal not in columns.names:
            raise ExperimentError(f"missing key {table.path(signal)}: name its columns")
    if ("time" in columns.names) == (rate is not None):
        raise ExperimentError(
            f"{table.where} has {'both time and' if rate else 'neither time nor'} rate: write one of them"
        )
    if (time_unit is None) != (rate is not None):
        raise ExperimentError(
            f"{table.path('time_unit')} belongs to a time column: "
            + ("remove it" if rate else 'add it, such as time_unit = "s"')
        )
    if time_unit is not None:
        try:
            scale(time_unit, "s")
        except UnitError as error:
            raise ExperimentError(f"{table.path('time_unit')} {error}") from None
    return columns, time_unit, rate


def _declared(table: Table) -> Recording:
    for key in table.content:
        if key not in DECLARES:
            raise ExperimentError(f"unknown key {table.path(key)}: the keys of a map are {', '.join(DECLARES)}")
    for key in ("wrench", "force_unit", "moment_unit", "angular_velocity_unit"):
        table.raw(key)  # a table says nothing of itself, so that the map must
    return parse_recording(table)


@dataclass(frozen=True)
class Imported:
    """A table that was written as a run."""

    path: Path
    """The MCAP file."""
    samples: int
    assumptions: tuple[str, ...]
    """What the map does not say."""

    def to_dict(self) -> dict[str, Any]:
        """Return the content as plain values."""
        return {"path": str(self.path), "samples": self.samples, "assumptions": list(self.assumptions)}

    def __repr__(self) -> str:
        notes = [f"assumed: {text}" for text in self.assumptions]
        return "\n".join([f"{self.samples:,} samples written to {self.path}", *notes])


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
    table = read_columns(path, mapping.columns)
    stamp = _stamps(table.get("time"), mapping, len(table["force"]), Path(path).name)
    nothing = np.zeros((len(stamp), 3))
    motion = table["angular_velocity"], table.get("acceleration", nothing)
    raw = as_recording(path, table["force"], table["moment"], *motion)
    absent = {"acceleration"} - set(table)
    rig = declared(raw, silenced(mapping.recording, absent))
    (force, moment), (omega, acceleration) = rig.wrench(raw.wrench), rig.motion(raw.imu)
    imu = ImuChannel("/imu", "body", stamp, stamp, omega, acceleration)
    write(
        output,
        wrench=WrenchChannel("/wrench", "body", stamp, stamp, force, moment),
        imu=imu,
        metadata={"rig.run": _about(raw.path, raw.sha256, rig.assumptions, accelerates=not absent)},
        overwrite=overwrite,
    )
    return Imported(Path(output), len(stamp), rig.assumptions)


def _stamps(time: np.ndarray | None, mapping: Map, count: int, name: str) -> np.ndarray:
    """Instants [ns]; a table whose time begins below zero begins at zero."""
    if time is None:
        return np.round(np.arange(count) * (NANOSECONDS / float(mapping.rate or 1))).astype(np.int64)
    seconds = time[:, 0] * scale(str(mapping.time_unit), "s")
    if seconds[-1] - min(seconds[0], 0) > 9e9:
        raise RunError(f"time in {name} reaches {seconds[-1]:.3g} s: correct columns.time_unit")
    back = np.flatnonzero(np.diff(seconds) <= 0)
    if len(back):
        raise RunError(f"time in {name} does not increase after sample {back[0] + 1}: correct the table")
    since = (time[:, 0] - time[0, 0]) * scale(str(mapping.time_unit), "s")  # a count of days would cost digits
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
