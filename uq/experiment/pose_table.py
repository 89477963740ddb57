"""The table ``[poses]`` of an experiment file: where static poses stand in a table, and what tells their attitude."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import numpy as np
import scipy

from identify.estimation.static_poses.accelerometer import Accelerometer, calibrate
from identify.estimation.static_poses.pose_fit import Attitudes
from identify.least_squares.covariance_matrices import root_of
from identify.rigid_body.rotation import from_quaternion, nearest_rotation
from identify.signals.run import RunError
from rig.exceptions import quoted
from rig.toml_tables import WrongKeyError, written
from uq.files.csv_columns import ColumnsTable, QuaternionColumns
from uq.files.mistakes import ExperimentError
from uq.files.schema import Axes, in_unit

ATTITUDES = ("gravity", "acceleration", "matrix", "quaternion", "rotation_vector", "euler", "joints")
ROTATIONS = ATTITUDES[2:6]
"""Ways to tell the attitude that need its direction, ``takes``."""
NO_ROTATION = 0.01
"""Departure of a matrix from a rotation beyond which it is none: rounding to two decimals stays within."""
ANGLES = ATTITUDES[4:]
"""Ways to tell the attitude that need the angles' unit."""
CONVENTIONS = {"rpy": "xyz", "fanuc": "xyz", "kuka": "ZYX", "staubli": "XYZ", "kawasaki": "ZYZ"}
"""Axes of the three turns by the names of robots: small letters stand for axes at rest, capitals for axes that turn."""


def _euler_axes(_: str, raw: Any) -> str:
    axes = CONVENTIONS.get(raw, raw) if isinstance(raw, str) else ""
    if not re.fullmatch(r"[xyz]{3}|[XYZ]{3}", axes) or axes[0] == axes[1] or axes[1] == axes[2]:
        raise ValueError(
            f"is {quoted(raw)}: write one of {', '.join(CONVENTIONS)}, or three axes in the order of the turns, "
            'such as "xyz" (about axes at rest) or "ZYX" (about axes that turn)'
        )
    return axes


class AttitudeColumns(ColumnsTable, frozen=True, kw_only=True):
    """Columns of a table that tell an attitude, and what they mean."""

    matrix: tuple[str, str, str, str, str, str, str, str, str] | None = None
    """The columns of a rotation matrix, row by row."""
    quaternion: QuaternionColumns | None = None
    """The columns of a unit quaternion."""
    rotation_vector: Axes[str] | None = None
    """The columns of a rotation vector (axis times angle)."""
    euler: Axes[str] | None = None
    """The columns of three angles in the order of ``euler_convention``."""
    euler_convention: (
        Annotated[str, written(_euler_axes, {"type": "string", "examples": [*CONVENTIONS, "xyz", "ZYX"]})] | None
    ) = None
    """Order and kind of the turns: a robot's name, or three axes, small where they rest, capitals where they turn."""
    angle_unit: Literal["rad", "deg"] | None = None
    """Unit of rotation vector, Euler angles or joints."""
    takes: Literal["sensor_to_level", "level_to_sensor"] | None = None
    """Direction of the rotation: from sensor to level components, or back; the level frame's z is up, unless
    ``recording.urdf_gravity`` says otherwise."""

    gravity: Axes[str] | None = None
    """The columns of the vector of gravity along the sensor's axes, of any length: one of four ways to tell the
    attitude."""
    gravity_points: Literal["down", "up"] | None = None
    """The vectors of ``gravity`` point there; missing: downwards."""

    def check_rotation(self, attitude: str | None) -> None:
        """Refuse a rotation whose direction, unit or order is missing."""
        if self.gravity_points is not None and self.gravity is None:
            raise WrongKeyError("gravity_points", "remove it", "belongs to columns of gravity")
        if attitude in ROTATIONS and self.takes is None:
            raise WrongKeyError("takes", 'write "sensor_to_level" or "level_to_sensor"')
        if attitude in ANGLES and self.angle_unit is None:
            raise WrongKeyError("angle_unit", 'write "rad" or "deg"')
        if attitude == "euler" and self.euler_convention is None:
            raise WrongKeyError("euler_convention", f"write one of {', '.join(CONVENTIONS)}, or three axes")

    def quaternions(self, values: np.ndarray, attitude: str, name: str) -> np.ndarray:
        """Return the quaternions x y z w from the sensor's to level components of many rows, (n, 4).

        Args:
            values: the attitude's columns, (n, columns).
            attitude: one of ``ROTATIONS``.
            name: what messages call the table.

        Raises:
            RunError: a matrix is no rotation.
        """
        turn, degrees = scipy.spatial.transform.Rotation, self.angle_unit == "deg"
        if attitude == "quaternion":
            quaternions = values[:, [1, 2, 3, 0]]
        elif attitude == "matrix":
            matrices = values.reshape(-1, 3, 3)
            off = np.abs(matrices @ matrices.swapaxes(1, 2) - np.eye(3)).max(axis=(1, 2))
            bad = (off > NO_ROTATION) | (np.linalg.det(matrices) < 0)
            if bad.any():
                raise RunError(f"matrix of row {int(np.argmax(bad)) + 1} in {name} is no rotation: check its columns")
            quaternions = turn.from_matrix(matrices).as_quat()
        elif attitude == "rotation_vector":
            quaternions = turn.from_rotvec(values, degrees=degrees).as_quat()
        else:
            quaternions = turn.from_euler(str(self.euler_convention), values, degrees=degrees).as_quat()
        return quaternions * [-1, -1, -1, 1] if self.takes == "level_to_sensor" else np.asarray(quaternions)


class Poses(AttitudeColumns, frozen=True, kw_only=True):
    """``[poses]``: the declaration of static poses."""

    SIGNALS = ("time", "force", "moment", *ATTITUDES)
    time: str | None = None
    """The column of the time at which each pose was held, in any unit, by which a drift of the zero goes; missing: by
    the order of the rows."""
    force: Axes[str] | None = None
    """The columns of the force's components."""
    moment: Axes[str] | None = None
    """The columns of the moment's components."""
    acceleration: Axes[str] | None = None
    """The columns of an accelerometer's components, an alternative to ``gravity``."""
    joints: Mapping[str, str] | None = None
    """The column of each joint's angle, by the joint's name in ``recording.urdf``, an alternative to ``gravity``."""
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
            raise WrongKeyError("", f"describes the attitude by {' and '.join(attitudes)}: name one of them")
        if named and not {"force", "moment"} <= set(named):
            raise WrongKeyError("", "names no columns of force and moment: add both")
        if named and not attitudes:
            raise WrongKeyError("", f"describes no attitude: name the columns of one of {', '.join(ATTITUDES)}")
        if self.time is not None and self.rate is not None:
            raise WrongKeyError("time", "remove it, or rate", "is that of rows of poses, rate that of samples")
        self.check_rotation(self.attitude)

    @property
    def attitude(self) -> str | None:
        """Name of the table's signal that gives the attitude; None: no table is declared."""
        return next((key for key in ATTITUDES if getattr(self, key) is not None), None)

    def to_dict(self) -> dict[str, Any]:
        """Return what is declared, the signals' columns together."""
        keys = (
            "takes", "rate", "euler_convention", "angle_unit", "accelerometer", "sigma_attitude", "sigma_alignment",
            "sigma_accelerometer",
        )  # fmt: skip
        declared = {"columns": self.columns, "attitude": self.attitude, **{key: getattr(self, key) for key in keys}}
        return declared | ({"gravity_points": self.gravity_points} if self.gravity_points else {})


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


def rotations(values: np.ndarray, poses: Poses, name: str) -> np.ndarray:
    """Return the rotation of each pose from components in the attitude's sensor to level ones, (n, 3, 3).

    Args:
        values: the attitude's columns as they stand in the table.
        poses: what they mean: one of ``ROTATIONS``.
        name: what messages call the table.

    Raises:
        RunError: a row that is no rotation, or no unit quaternion.
    """
    turns = np.empty((len(values), 3, 3))
    for row, value in enumerate(values):
        try:
            turns[row] = _rotation(value, poses)
        except ValueError as error:
            raise RunError(f"{poses.attitude} of pose {row + 1} in {name} {error}") from None
    return turns if poses.takes == "sensor_to_level" else turns.swapaxes(1, 2)


def _rotation(value: np.ndarray, poses: Poses) -> np.ndarray:
    if poses.attitude == "matrix":
        return nearest_rotation(value.reshape(3, 3))
    if poses.attitude == "quaternion":
        return from_quaternion(*value)
    turn, degrees = scipy.spatial.transform.Rotation, poses.angle_unit == "deg"
    if poses.attitude == "rotation_vector":
        return np.asarray(turn.from_rotvec(value, degrees=degrees).as_matrix())
    return np.asarray(turn.from_euler(str(poses.euler_convention), value, degrees=degrees).as_matrix())


def upward(values: np.ndarray, poses: Poses, name: str) -> np.ndarray:
    """Return the direction opposite to gravity of each pose's vector, (n, 3).

    Args:
        values: the vectors as they stand in the table, (n, 3).
        poses: what they mean.
        name: what messages call the table.

    Raises:
        RunError: a vector is zero.
    """
    length = np.linalg.norm(values, axis=1, keepdims=True)
    if not length.all():
        raise RunError(f"gravity of pose {int(np.argmin(length)) + 1} in {name} is zero: write the vector of gravity")
    return np.asarray(values / length * (1.0 if poses.gravity_points == "up" else -1.0))


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
        raise ExperimentError(f"no [poses] table declares the columns of {Path(path).name}: name them in [poses]")
    return poses
