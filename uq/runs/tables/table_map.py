"""Maps: the meaning of the columns in tables of samples, for ``inertia import``."""

from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Literal

from rig.toml_tables import TomlTable, WrongKeyError
from uq.experiment.pose_table import ROTATIONS, AttitudeColumns
from uq.experiment.recording_table import SensorConventions, unit_name
from uq.files.csv_columns import QuaternionColumns
from uq.files.document import in_file, read_document
from uq.files.schema import Axes, declared_table, in_unit

WRENCH = ("force", "moment")
MOTIONS = ("angular_velocity", *ROTATIONS, "joints")
"""Signals that tell the motion."""


class MapColumns(AttitudeColumns, frozen=True, kw_only=True):
    """``[columns]`` of a map: the columns of time, wrench and motion."""

    SIGNALS = ("time", *WRENCH, *MOTIONS, "position", "acceleration", "gravity")
    time: str | None = None
    """The column of the time: numbers, or dates as text; or state ``rate``."""
    time_unit: Annotated[str, unit_name("s")] | None = None
    """Name of the unit of the time column; missing: as the table states it, or dates as text."""
    rate: Annotated[float, in_unit("Hz", above=0)] | None = None
    """Sample rate [Hz] of a table without times, or with times too coarse to tell its rows apart."""
    time_offset: Annotated[float, in_unit("s")] | None = None
    """Time that is added to the table's times, where another table has another clock [s]."""
    force: Axes[str] | None = None
    """The columns of the force's components."""
    moment: Axes[str] | None = None
    """The columns of the moment's components."""
    angular_velocity: Axes[str] | None = None
    """The columns of the angular velocity's components."""
    quaternion: QuaternionColumns | None = None
    """The columns of a unit quaternion from the body's frame to one at rest whose z is up; alone, or beside an angular
    velocity of the same sensor."""
    position: Axes[str] | None = None
    """The columns of the body's position along axes at rest, beside an attitude: both tell the specific force."""
    position_unit: Annotated[str, unit_name("m")] = "m"
    """Name of the unit of ``position``."""
    joints: Mapping[str, str] | None = None
    """The column of each joint's position, by the joint's name in the URDF; without an angular velocity."""
    joint_unit: Annotated[str, unit_name("rad")] = "rad"
    """Name of the unit of the joints' positions."""
    acceleration: Axes[str] | None = None
    """The columns of the specific force's components."""
    gravity: Axes[str] | None = None
    """The columns of the vector of gravity along the acceleration's axes, which a driver took out of ``acceleration``:
    in its unit, or of length 1. It is put back, and no attitude is needed."""

    def __post_init__(self) -> None:
        """Refuse columns without time, or with half a wrench or two motions."""
        super().__post_init__()
        if self.time is None and self.rate is None:
            raise WrongKeyError("", "has neither time nor rate: write one of them")
        if self.time_unit is not None and self.time is None:
            raise WrongKeyError("time_unit", "remove it", "belongs to a time column")
        for signal, other in (WRENCH, WRENCH[::-1]):
            if getattr(self, signal) is not None and getattr(self, other) is None:
                raise WrongKeyError(other, "add it")
        motions = [key for key in MOTIONS if getattr(self, key) is not None]
        attitudes = [key for key in ROTATIONS if key in motions]
        if len(motions) > 1 and (motions[0] != "angular_velocity" or motions[1:] != attitudes or len(attitudes) > 1):
            raise WrongKeyError("", f"describes the motion by {' and '.join(motions)}: name one of them")
        if self.acceleration is not None and self.angular_velocity is None:
            raise WrongKeyError("angular_velocity", "add it: acceleration belongs to it")
        if self.gravity is not None and self.acceleration is None:
            cure = "add angular_velocity and the acceleration without it, which then tell the mass"
            raise WrongKeyError("gravity", f"{cure}, or take `inertia centre`, of rest", "leaves the heading open")
        if self.position is not None and motions != attitudes:
            raise WrongKeyError("position", "remove it, or the angular velocity", "belongs to an attitude alone")
        if self.quaternion is None or self.angle_unit is not None:
            self.check_rotation(next(iter(attitudes), None))

    @property
    def attitude(self) -> str:
        """The signal that tells the attitude by a rotation; "": the table has none."""
        return next((key for key in ROTATIONS if getattr(self, key) is not None), "")

    @property
    def motion(self) -> str:
        """The signal that tells the motion; "": the table has none."""
        return next((key for key in MOTIONS if getattr(self, key) is not None), "")


class MapConventions(SensorConventions, frozen=True, kw_only=True):
    """``[recording]`` of a map: the conventions of the table's numbers.

    A unit may be missing where the table states it, in a row of units or behind the columns' names.
    """

    wrench: Literal["on_body", "on_sensor"]
    """Sign of the wrench in the table: that on the body, or the reaction on the sensor."""


class Map(TomlTable, frozen=True, kw_only=True):
    """Meaning of the columns in a table of samples."""

    columns: MapColumns
    """Columns of the table's signals."""
    second: MapColumns | None = None
    """Columns of the second table, where wrench and motion stand in tables of their own."""
    recording: MapConventions
    """Signs, units and axes of the table's numbers."""

    def __post_init__(self) -> None:
        """Refuse columns that do not tell wrench and motion, each once."""
        for signal, keys in (("force", WRENCH), ("angular_velocity", MOTIONS)):
            count = sum(any(getattr(part, key) is not None for key in keys) for part in self.parts)
            if count == 0:
                raise WrongKeyError(f"columns.{signal}", "add it", "is missing")
            if count > 1:
                raise WrongKeyError("second", f"name {' and '.join(keys)} for one of the tables", "repeats columns")

        if self.recording.accelerometer_at_rest != "zero" and any(part.gravity is not None for part in self.parts):
            raise WrongKeyError(
                "recording.accelerometer_at_rest", 'write "zero" if columns.gravity was taken out of the acceleration, '
                "else remove columns.gravity",
            )  # fmt: skip
        if self.recording.accelerometer_at_rest and all(part.acceleration is None for part in self.parts):
            raise WrongKeyError("recording.accelerometer_at_rest", "remove it", "belongs to columns of acceleration")

    @property
    def parts(self) -> tuple[MapColumns, ...]:
        """The columns of each table."""
        return (self.columns,) if self.second is None else (self.columns, self.second)

    @classmethod
    def load(cls, path: str | Path) -> "Map":
        """Read a map file.

        Raises:
            ExperimentError: it is not TOML, or not a map.
            OSError: it cannot be read.
        """
        with in_file(path):
            return declared_table("", read_document(path, "a map file")[0], cls)
