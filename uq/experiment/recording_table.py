"""What a recorded run's channels mean: the table ``[recording]`` of an experiment file. docs/recordings.md explains it.

Nothing here touches a recording; :mod:`uq.recorded.load_run` applies it.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, get_args

import numpy as np
from jaxtyping import Float

from identify.joint.priors import Alignment
from identify.results.identification_result import CgMotion, Method
from identify.rigid_body.rotation import from_axes, from_quaternion, nearest_rotation
from uq.experiment.alignment_prior import parse_alignment
from uq.files.document import ExperimentError, Table
from uq.files.units import UnitError, scale

UNITS = {"force": "N", "moment": "N*m", "angular_velocity": "rad/s", "acceleration": "m/s^2"}
"""The unit in SI of each of a recorded run's quantities."""


@dataclass(frozen=True, eq=False)
class Recording:
    """What a recorded run's channels mean; None: not declared."""

    wrench_topic: str | None = None
    """Topic of force and moment; None: the only one of its type."""
    motion_topic: str | None = None
    """Topic of the angular velocity; None: the only one of its type."""
    wrench: Literal["on_body", "on_sensor"] | None = None
    """Whether the wrench is that on the body, as (4) has it, or the reaction on the sensor."""
    force_unit: str | None = None
    """Name of the force's unit, such as ``lbf``."""
    moment_unit: str | None = None
    """Name of the moment's unit, such as ``N*mm``."""
    angular_velocity_unit: str | None = None
    """Name of the angular velocity's unit, such as ``deg/s``."""
    acceleration_unit: str | None = None
    """Name of the specific force's unit, such as ``g``."""
    wrench_rotation_to_body: Float[np.ndarray, "3 3"] | None = None
    """R with body = R · load cell."""
    imu_rotation_to_body: Float[np.ndarray, "3 3"] | None = None
    """R with body = R · IMU."""
    wrench_point: Float[np.ndarray, "3"] | None = None
    """The point where the moment is taken, from Q, in B [m]."""
    imu_position: Float[np.ndarray, "3"] | None = None
    """The accelerometer, from Q, in B [m]."""
    calibration: Float[np.ndarray, "6 6"] | None = None
    """From the six raw channels to force and moment in their units."""
    offsets: Literal["estimate", "still", "none"] = "estimate"
    """Constant offsets of force and moment: estimated along with the tensor, taken from still stretches, or none."""
    zero: Literal["empty", "loaded"] | None = None
    """Whether the load cell was zeroed without or with the body on it."""
    compensated: Literal["none", "gravity", "gravity_from_force"] | None = None
    """Whether the driver removed the body's weight: from force and moment, or from the force alone."""
    time: Literal["header", "log"] | None = None
    """Which of a message's two times is that of its measurement."""
    estimator: str | None = None
    """Name of the estimator for recorded runs; None: the first."""
    urdf: str | None = None
    """Path of the robot's description, where the motion is told by joint states."""
    urdf_frame: str | None = None
    """The frame of the description that turns with the body."""
    drawn_by_mounting: tuple[str, ...] = ()
    """Names of the sources whose errors each mounting of the body draws anew."""
    method: Method = "source"
    """The estimator: the source's, or tensor, centre, offsets, delay and rotation together."""
    cg_motion: CgMotion | None = None
    """Whether the motion keeps the centre of gravity still; None: not declared."""
    alignment: Alignment = field(default_factory=Alignment)
    """What is known beforehand of delay, rotation and slow errors, for the joint estimate."""

    def unit(self, quantity: str) -> str | None:
        """Return the declared unit's name of ``force``, ``moment``, ``angular_velocity`` or ``acceleration``."""
        return getattr(self, f"{quantity}_unit")


TEXTS = ("wrench_topic", "motion_topic", "estimator", "urdf", "urdf_frame")


def parse_recording(table: Table) -> Recording:
    """Return the table ``[recording]``.

    Raises:
        ExperimentError: an unknown key, or a value that it cannot have.
    """
    alike: dict[str, Any] = {key: table.typed(key, str, None) for key in TEXTS}
    alike |= {f"{name}_unit": _unit(table, f"{name}_unit", si) for name, si in UNITS.items()}
    alike |= {key: rotation(table, key) for key in ("wrench_rotation_to_body", "imu_rotation_to_body")}
    alike |= {key: _point(table, key) for key in ("wrench_point", "imu_position")}
    recording = Recording(
        **alike,
        method=table.choice("method", get_args(Method), "source"),
        cg_motion=table.choice("cg_motion", get_args(CgMotion), None),
        alignment=parse_alignment(table),
        wrench=table.choice("wrench", ("on_body", "on_sensor"), None),
        calibration=_calibration(table),
        offsets=table.choice("offsets", ("estimate", "still", "none"), "estimate"),
        zero=table.choice("zero", ("empty", "loaded"), None),
        compensated=table.choice("compensated", ("none", "gravity", "gravity_from_force"), None),
        time=table.choice("time", ("header", "log"), None),
        drawn_by_mounting=_names(table, "drawn_by_mounting"),
    )
    table.finish()
    return recording


def _unit(table: Table, key: str, si: str) -> str | None:
    """The name of a unit of the dimension of ``si``."""
    name = table.typed(key, str, None)
    if name is not None:
        try:
            scale(name, si)
        except UnitError as error:
            raise ExperimentError(f"{table.path(key)} {error}") from None
    return name


def _names(table: Table, key: str) -> tuple[str, ...]:
    """A list of names, each once."""
    names = table.raw(key, [])
    if not isinstance(names, list) or not all(isinstance(name, str) and name for name in names):
        raise ExperimentError(f"{table.path(key)} is {names!r}: write a list of names of [[source]]")
    return tuple(dict.fromkeys(names))


def _point(table: Table, key: str) -> np.ndarray | None:
    return table.vector(key, "m") if key in table.content else table.raw(key, None)


def rotation(table: Table, key: str) -> np.ndarray | None:
    """Return a rotation written as signed axes, quaternion or matrix; None: the key is missing.

    Raises:
        ExperimentError: it is no rotation.
    """
    raw = table.raw(key, None)
    if raw is None:
        return None
    try:
        if isinstance(raw, str):
            return from_axes(raw)
        if isinstance(raw, Mapping):
            return table.table(key, lambda parts: from_quaternion(**_quaternion(parts)))
        return nearest_rotation(table.numbers(key, (3, 3)))
    except ExperimentError:
        raise
    except ValueError as error:
        raise ExperimentError(f"{table.path(key)} {error}") from None


def _quaternion(table: Table) -> dict[str, float]:
    parts = {name: float(table.numbers(name, ())) for name in "wxyz"}
    table.finish()
    return parts


def _calibration(table: Table) -> np.ndarray | None:
    matrix = table.numbers("calibration", (6, 6), None)
    if matrix is not None and np.linalg.matrix_rank(matrix) < 6:
        raise ExperimentError(f"{table.path('calibration')} is singular: give six independent rows")
    return matrix
