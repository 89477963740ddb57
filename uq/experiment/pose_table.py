"""The table ``[poses]`` of an experiment file: where static poses stand in a table, and what tells their attitude."""

from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np

from identify.rigid_body.rotation import from_quaternion, nearest_rotation
from identify.signals.run import RunError
from identify.static.accelerometer import Accelerometer, calibrate
from identify.static.pose_fit import Attitudes
from rig.toml_tables import WrongKeyError
from uq.files.csv_columns import ColumnsTable, QuaternionColumns
from uq.files.document import ExperimentError
from uq.files.schema import Axes, in_unit
from uq.sources.correlations import root_of

ATTITUDES = ("gravity", "acceleration", "matrix", "quaternion")


class Poses(ColumnsTable, frozen=True, kw_only=True):
    """``[poses]``: the declaration of static poses."""

    SIGNALS = ("force", "moment", *ATTITUDES)
    force: Axes[str] | None = None
    """The columns of the force's components."""
    moment: Axes[str] | None = None
    """The columns of the moment's components."""
    gravity: Axes[str] | None = None
    """The columns of gravity's components in the sensor's frame: one of four ways to tell the attitude."""
    acceleration: Axes[str] | None = None
    """The columns of an accelerometer's components, an alternative to ``gravity``."""
    matrix: tuple[str, str, str, str, str, str, str, str, str] | None = None
    """The columns of a rotation matrix, row by row, an alternative to ``gravity``."""
    quaternion: QuaternionColumns | None = None
    """The columns of a unit quaternion, an alternative to ``gravity``."""
    takes: Literal["sensor_to_level", "level_to_sensor"] | None = None
    """Direction of a matrix or quaternion: from sensor to level components, or back; the level frame's z is up."""
    rate: Annotated[float, in_unit("Hz", above=0)] | None = None
    """Rate of the rows of a table of samples, each of whose still segments is a pose [Hz]; missing: each row is one."""
    accelerometer: Literal["offset", "scale"] | None = None
    """Calibration of the accelerometer before its attitudes are used; missing: its offset where the poses allow."""
    sigma_attitude: Annotated[float, in_unit("rad", least=0)] = 0.0
    """Standard uncertainty of each pose's tilt [rad], independent of the other poses, beside what the residuals
    show."""
    sigma_alignment: Annotated[float, in_unit("rad", least=0)] = 0.0
    """Standard uncertainty of the attitude sensor's axes against the load cell's, on each axis [rad]."""
    sigma_accelerometer: Annotated[float, in_unit("m/s^2", least=0)] = 0.0
    """Standard uncertainty of the accelerometer's offset where the poses do not find it [m/s²]."""

    def __post_init__(self) -> None:
        """Refuse columns without force, moment or one attitude."""
        super().__post_init__()
        named = self.columns.names
        attitudes = [key for key in ATTITUDES if key in named]
        if len(attitudes) > 1:
            raise WrongKeyError("", f"tells the attitude by {' and '.join(attitudes)}: name one of them")
        if named and not {"force", "moment"} <= set(named):
            raise WrongKeyError("", "names no columns of force and moment: add both")
        if named and not attitudes:
            raise WrongKeyError("", f"tells no attitude: name the columns of one of {', '.join(ATTITUDES)}")
        if self.attitude in ("matrix", "quaternion") and self.takes is None:
            raise WrongKeyError("takes", 'write "sensor_to_level" or "level_to_sensor"')

    @property
    def attitude(self) -> str | None:
        """Name of the table's signal that gives the attitude; None: no table is declared."""
        return next((key for key in ATTITUDES if getattr(self, key) is not None), None)

    def to_dict(self) -> dict[str, Any]:
        """Return what is declared, the signals' columns together."""
        keys = ("takes", "rate", "accelerometer", "sigma_attitude", "sigma_alignment", "sigma_accelerometer")
        return {"columns": self.columns, "attitude": self.attitude, **{key: getattr(self, key) for key in keys}}


def uncertain(specific_force: np.ndarray, poses: Poses, sensor: Accelerometer | None, turn: np.ndarray) -> Attitudes:
    """Return how far attitudes may be off.

    Args:
        specific_force: of each pose, in B [m/s²].
        poses: what is declared of the attitudes.
        sensor: the accelerometer that measured them; None: another sensor did.
        turn: R with body = R · the attitude's sensor.
    """
    gravity = np.linalg.norm(specific_force, axis=1)[:, None, None]
    axes = np.broadcast_to(poses.sigma_alignment * np.eye(3), (len(specific_force), 3, 3))
    turned = np.cross(axes, specific_force[:, None], axis=2).transpose(0, 2, 1)
    columns, lasting = [turned] * (poses.sigma_alignment > 0), 3 * (poses.sigma_alignment > 0)
    if sensor is not None:
        covariance = sensor.covariance if sensor.fitted else poses.sigma_accelerometer**2 * np.eye(3)
        up = specific_force[:, :, None] / gravity
        across = np.eye(3) - up * up.transpose(0, 2, 1)
        columns.append(-across @ turn @ root_of(covariance) / sensor.gain)
    return Attitudes(poses.sigma_attitude, np.concatenate(columns, axis=2) if columns else None, lasting)


def up(values: np.ndarray, poses: Poses, name: str) -> np.ndarray:
    """Return the upward direction of each pose in the frame of the sensor that tells the attitude, (n, 3).

    Args:
        values: the attitude's columns as they stand in the table.
        poses: what they mean; not an accelerometer's.
        name: what messages call the table.

    Raises:
        RunError: a row that is no rotation, no unit quaternion, or no direction.
    """
    directions = []
    for row, value in enumerate(values, start=1):
        try:
            directions.append(_upward(value, poses))
        except ValueError as error:
            raise RunError(f"{poses.attitude} of pose {row} in {name} {error}") from None
    return np.array(directions)


def _upward(value: np.ndarray, poses: Poses) -> np.ndarray:
    if poses.attitude == "gravity":
        length = np.linalg.norm(value)
        if not length > 0:
            raise ValueError("is zero: write the vector of gravity")
        return np.asarray(-value / length)
    rotation = nearest_rotation(value.reshape(3, 3)) if poses.attitude == "matrix" else from_quaternion(*value)
    return rotation[:, 2] if poses.takes == "level_to_sensor" else rotation[2]


def of_accelerometer(
    readings: np.ndarray, poses: Poses, gravity: float
) -> tuple[np.ndarray, Accelerometer, tuple[str, ...]]:
    """Return the specific force [m/s²] of static readings, the accelerometer's calibration, and warnings."""
    calibration = calibrate(readings, gravity, method=poses.accelerometer)
    unknown = "the poses are too few or too much alike to find the accelerometer's offset, which was taken for zero"
    warnings = (unknown,) if not calibration.fitted and poses.accelerometer is None else ()
    if not 0.9 < calibration.gain < 1.1:
        raise RunError(
            f"the accelerometer reads {calibration.gain:.4g} times gravity: correct recording.acceleration_unit"
        )
    return calibration.specific_force(readings, gravity), calibration, warnings


def need_table(poses: Poses | None, path: str | Path) -> Poses:
    """Return how a table's columns are declared.

    Raises:
        ExperimentError: they are not.
    """
    if poses is None or not poses.columns.names:
        raise ExperimentError(f"nothing declares the columns of {Path(path).name}: name them in [poses]")
    return poses
