"""The table ``[poses]`` of an experiment file: where static poses stand in a table, and what tells their attitude."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

import numpy as np

from identify.accelerometer import Accelerometer, calibrate
from identify.frames import from_quaternion, nearest_rotation
from identify.run import RunError
from uq.columns import Columns, parse_columns
from uq.document import ExperimentError, Table

ATTITUDES = ("gravity", "acceleration", "matrix", "quaternion")
SIGNALS: Mapping[str, int | Sequence[str]] = {
    "force": 3,
    "moment": 3,
    "gravity": 3,
    "acceleration": 3,
    "matrix": 9,
    "quaternion": ("w", "x", "y", "z"),
}


@dataclass(frozen=True)
class Poses:
    """How static poses are declared."""

    columns: Columns = field(default_factory=Columns)
    attitude: Literal["gravity", "acceleration", "matrix", "quaternion"] | None = None
    """Which signal of the table tells the attitude; None: no table is declared."""
    takes: Literal["sensor_to_level", "level_to_sensor"] | None = None
    """Which components a matrix or quaternion takes to which; the level frame's z is up."""
    accelerometer: Literal["offset", "scale"] | None = None
    """What is found of the accelerometer before its attitudes are used; None: the offset where the poses allow it."""


def parse_poses(table: Table) -> Poses:
    """Return the table ``[poses]``.

    Raises:
        ExperimentError: an unknown key, no or several attitudes, or a value that a key cannot have.
    """
    columns = parse_columns(table, SIGNALS)
    attitudes = [key for key in ATTITUDES if key in columns.names]
    takes = table.choice("takes", ("sensor_to_level", "level_to_sensor"), None)
    accelerometer = table.choice("accelerometer", ("offset", "scale"), None)
    table.finish()
    if len(attitudes) > 1:
        raise ExperimentError(f"{table.where} tells the attitude by {' and '.join(attitudes)}: name one of them")
    if columns.names and not {"force", "moment"} <= set(columns.names):
        raise ExperimentError(f"{table.where} names no columns of force and moment: add both")
    if columns.names and not attitudes:
        raise ExperimentError(f"{table.where} tells no attitude: name the columns of one of {', '.join(ATTITUDES)}")
    attitude = attitudes[0] if attitudes else None
    if attitude in ("matrix", "quaternion") and takes is None:
        raise ExperimentError(f'missing key {table.path("takes")}: write "sensor_to_level" or "level_to_sensor"')
    return Poses(columns, attitude, takes, accelerometer)  # type: ignore[arg-type]


def up(values: np.ndarray, poses: Poses, name: str) -> np.ndarray:
    """Return the upward direction of each pose in the frame of the sensor that tells the attitude, (n, 3).

    Args:
        values: the attitude's columns as they stand in the table.
        poses: what they mean; not an accelerometer's.
        name: what messages call the table.

    Raises:
        RunError: a row that is no rotation, no unit quaternion, or no direction.
    """
    one = {"gravity": _against, "matrix": _of_matrix, "quaternion": _of_quaternion}[str(poses.attitude)]
    directions = []
    for row, value in enumerate(values, start=1):
        try:
            directions.append(one(value, poses.takes == "level_to_sensor"))
        except ValueError as error:
            raise RunError(f"{poses.attitude} of pose {row} in {name} {error}") from None
    return np.array(directions)


def _against(value: np.ndarray, _: bool) -> np.ndarray:
    length = np.linalg.norm(value)
    if not length > 0:
        raise ValueError("is zero: write the vector of gravity")
    return np.asarray(-value / length)


def _of_matrix(value: np.ndarray, level_to_sensor: bool) -> np.ndarray:
    rotation = nearest_rotation(value.reshape(3, 3))
    return rotation[:, 2] if level_to_sensor else rotation[2]


def _of_quaternion(value: np.ndarray, level_to_sensor: bool) -> np.ndarray:
    rotation = from_quaternion(*value)
    return rotation[:, 2] if level_to_sensor else rotation[2]


def of_accelerometer(
    readings: np.ndarray, poses: Poses, gravity: float
) -> tuple[np.ndarray, Accelerometer, tuple[str, ...]]:
    """Return the specific force [m/s²] that an accelerometer's static readings tell, what was found of it, warnings."""
    found = calibrate(readings, gravity, method=poses.accelerometer)
    warnings = []
    if not found.fitted and poses.accelerometer is None:
        warnings.append(
            "the poses are too few or too much alike to find the accelerometer's offset, which was taken for zero"
        )
    if not 0.9 < found.gain < 1.1:
        raise RunError(f"the accelerometer reads {found.gain:.4g} times gravity: correct recording.acceleration_unit")
    return found.specific_force(readings, gravity), found, tuple(warnings)


def need_table(poses: Poses | None, path: str | Path) -> Poses:
    """Return how a table's columns are declared.

    Raises:
        ExperimentError: they are not.
    """
    if poses is None or not poses.columns.names:
        raise ExperimentError(f"nothing declares the columns of {Path(path).name}: name them in [poses]")
    return poses
