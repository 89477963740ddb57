"""Meaning of a recorded run's channels: the table ``[recording]`` of an experiment file.

docs/how-to/recordings.md explains it.

Nothing here touches a recording; :mod:`uq.runs.recorded.load_run` applies it.
"""

from dataclasses import fields
from typing import Annotated, Any, Literal

import msgspec
import numpy as np

from identify.choices import CgMotion
from identify.estimation import methods
from identify.estimation.joint.priors import Alignment
from identify.rigid_body.rotation import signed_order
from rig.exceptions import quoted
from rig.toml_tables import TomlTable, WrongKeyError, written
from uq.files.schema import ROTATION, Axes, in_unit, matrix, vector
from uq.files.units import scale

UNITS = {"force": "N", "moment": "N*m", "angular_velocity": "rad/s", "acceleration": "m/s^2"}
"""Unit in SI of each quantity of a recorded run."""
ALIGNMENT = frozenset(field.name for field in fields(Alignment))
"""Priors of the joint estimate, by the fields of ``Alignment``; most are keys of ``[recording]``."""
LONGEST_DELAY = 10.0
"""Seconds of delay, or of its standard uncertainty, beyond which clocks are to be repaired instead."""
WIDEST_ANGLE = np.pi / 6
"""Standard uncertainty of the rotation [rad] beyond which the frames are to be declared instead."""
Rotation = Annotated[np.ndarray, ROTATION]
Point = Annotated[np.ndarray, vector("m")]
Frequency = Annotated[float, in_unit("Hz", above=0)]
SigmaOfTime = Annotated[float, in_unit("s", least=0)]
SigmaOfAngle = Annotated[float, in_unit("rad", least=0)]
SigmaOfRate = Annotated[float, in_unit("rad/s", least=0)]
SigmaOfAcceleration = Annotated[float, in_unit("m/s^2", least=0)]
SigmaOfForce = Annotated[float, in_unit("N", least=0)]
SigmaOfMoment = Annotated[float, in_unit("N*m", least=0)]


def _method(_: str, raw: Any) -> str:
    if raw not in methods.names():
        raise ValueError(f"is {quoted(raw)}: choose one of {', '.join(methods.names())}")
    return raw


def unit_name(unit: str) -> msgspec.Meta:
    """Return the annotation of the name of a unit that has the dimension of ``unit``."""

    def read(_: str, raw: Any) -> str:
        if not isinstance(raw, str):
            raise ValueError(f"is {quoted(raw)}: write a string")
        scale(raw, unit)
        return raw

    return written(read, {"type": "string", "format": f"unit {unit}", "examples": [unit]})


def _names(_: str, raw: Any) -> tuple[str, ...]:
    if not isinstance(raw, list) or not all(isinstance(name, str) and name for name in raw):
        raise ValueError(f"is {quoted(raw)}: write a list of names of [[source]]")
    return tuple(dict.fromkeys(raw))


def _fields(_: str, raw: Any) -> np.ndarray:
    if not isinstance(raw, str):
        raise ValueError(f"is {quoted(raw)}: write a string")
    return signed_order(raw, "xyzw")


class SensorConventions(TomlTable, frozen=True, kw_only=True):
    """Signs, units, axes and points of a run's numbers; missing: not declared."""

    wrench: Literal["on_body", "on_sensor"] | None = None
    """Sign of the recorded wrench: that on the body, as in (4), or the reaction on the sensor."""
    force_unit: Annotated[str, unit_name("N")] | None = None
    """Name of the force's unit, such as ``lbf``."""
    moment_unit: Annotated[str, unit_name("N*m")] | None = None
    """Name of the moment's unit, such as ``N*mm``."""
    angular_velocity_unit: Annotated[str, unit_name("rad/s")] | None = None
    """Name of the angular velocity's unit, such as ``deg/s``."""
    acceleration_unit: Annotated[str, unit_name("m/s^2")] | None = None
    """Name of the specific force's unit, such as ``g``."""
    wrench_rotation_to_body: Rotation | None = None
    """Rotation matrix from components along the load cell's axes to components along the body's."""
    imu_rotation_to_body: Rotation | None = None
    """Rotation matrix from components along the IMU's axes to components along the body's."""
    wrench_point: Point | None = None
    """Position of the point where the moment is taken, from Q, in B [m]."""
    accelerometer_at_rest: Literal["up", "down", "zero"] | None = None
    """The accelerometer's reading at rest: up (specific force), down (its negative), or zero, where gravity was taken
    out of it, as from a "linear acceleration". An attitude in the recording puts it back; without one the acceleration
    is not used."""
    calibration: Annotated[np.ndarray, matrix(6, 6)] | None = None
    """Matrix from the six raw channels to force and moment in their units."""

    def __post_init__(self) -> None:
        """Refuse a calibration that loses a component."""
        if self.calibration is not None and np.linalg.matrix_rank(self.calibration) < 6:
            raise WrongKeyError("calibration", "give six independent rows", "is singular")

    def unit(self, quantity: str) -> str | None:
        """Return the declared unit's name of ``force``, ``moment``, ``angular_velocity`` or ``acceleration``."""
        return getattr(self, f"{quantity}_unit")


class RecordingTable(SensorConventions, frozen=True, kw_only=True):
    """``[recording]``: meaning of a recorded run's channels; missing: not declared."""

    wrench_topic: str | None = None
    """Topic of force and moment; missing: the only one of its type."""
    motion_topic: str | None = None
    """Topic of the angular velocity; missing: the only one of its type."""
    accelerometer_topic: str | None = None
    """Topic of the specific force, where the angular velocity has a topic of its own; missing: the only one whose
    angular velocity is zero throughout, beside one whose acceleration is."""
    wrench_frame: Literal["sensor", "base", "world"] | None = None
    """Axes of the recorded wrench: those that turn with the body, or those at rest to which the attitude refers: the
    root of ``urdf``, or the reference frame of poses and quaternions. ``base`` and ``world`` mean the same."""
    zero_frame: Literal["sensor", "base"] | None = None
    """Axes along which the load cell's zero is constant: the sensor's, or, of method ``joint``, those at rest."""
    quaternion: Annotated[np.ndarray, written(_fields, {"type": "string", "examples": ["w, x, y, z"]})] | None = None
    """Meaning of a recorded quaternion's fields x, y, z, w in this order: ``w, x, y, z`` where the scalar is first,
    ``-x, -y, -z, w`` where the rotation takes components at rest to the sensor's."""
    imu_position: Point | None = None
    """Position of the accelerometer from Q, in B [m]."""
    accelerometer_delay: Annotated[float, in_unit("s")] | None = None
    """Delay of the accelerometer beside the gyro, as by a filter of a lower frequency: time by which its samples are
    older than the gyro's of the same stamp [s]."""
    wrench_lowpass: Frequency | None = None
    """Corner of the low-pass of first order through which the wrench went, and the motion did not [Hz]: it is undone,
    ``F + dF/dt / (2 pi corner)``."""
    offsets: Literal["estimate", "still", "none"] = "estimate"
    """Constant offsets of force and moment: estimated along with the tensor, taken from still segments, or none."""
    zero: Literal["empty", "loaded"] | None = None
    """State in which the load cell was zeroed: without the body (``empty``) or with it (``loaded``)."""
    compensated: Literal["none", "gravity", "gravity_from_force"] | None = None
    """Compensation of a weight by the driver: none, from force and moment, or from the force alone."""
    payload_mass: Annotated[float, in_unit("kg", least=0)] | None = None
    """Mass whose weight the driver removed [kg]; missing: the body's."""
    payload_r_cg_from_q: Point | None = None
    """Centre of gravity of that mass from Q, in B [m]; missing: the body's."""
    time: Literal["header", "log"] | None = None
    """Time of the measurement: that of the message's header, or that of the log."""
    wrench_rate: Frequency | None = None
    """Steady sample rate of the load cell, by which its samples are stamped where the times are those of arrival, in
    bunches or with jitter [Hz]: the line of this rate below the fastest arrivals."""
    motion_rate: Frequency | None = None
    """Steady sample rate of the motion's sensor, by which its samples are stamped in the same way [Hz]."""
    estimator: str | None = None
    """Name of the estimator for recorded runs; missing: the first."""
    urdf: str | None = None
    """Path of the robot's description, where joint states give the motion."""
    urdf_frame: str | None = None
    """The frame of the description that turns with the body."""
    urdf_gravity: Annotated[np.ndarray, vector("m/s^2")] | None = None
    """Gravity along the axes at rest to which the attitude refers, downwards: those of the description's base, with
    which joint states tell the specific force; or of the reference frame of poses, quaternions and a table's attitudes,
    where it is missing downwards along z."""
    drawn_by_mounting: Annotated[
        tuple[str, ...], written(_names, {"type": "array", "items": {"type": "string", "minLength": 1}})
    ] = ()
    """Names of the sources whose errors each mounting of the body draws again."""
    method: Annotated[str, written(_method, {"enum": list(methods.names()), "default": "source"})] = "source"
    """Name of the estimator: ``source``, ``gls`` (weighted by the residuals), or ``joint`` (all unknowns together)."""
    cg_motion: CgMotion | None = None
    """Motion of the centre of gravity: ``still``; missing: not declared."""
    delay: Annotated[float, in_unit("s")] | None = None
    """Delay of the IMU for the joint estimate: time from the measurement of a sample to its stamp [s]."""
    sigma_delay: SigmaOfTime | None = None
    """Standard uncertainty of ``delay`` [s]; 0: ``delay`` is exact."""
    sigma_rotation: SigmaOfAngle | Axes[SigmaOfAngle] | None = None
    """Standard uncertainty of the rotation from the IMU's axes to the body's [rad], one value or one per axis."""
    sigma_gyro_bias: SigmaOfRate | Axes[SigmaOfRate] | None = None
    """Standard uncertainty of the gyro's zero [rad/s]."""
    sigma_tilt: SigmaOfAngle | None = None
    """Standard uncertainty of the attitude at the start, which is level [rad]; missing: the force tells it."""
    sigma_accelerometer_bias: SigmaOfAcceleration | Axes[SigmaOfAcceleration] | None = None
    """Standard uncertainty of the accelerometer's zero [m/s²]."""
    sigma_force_drift: SigmaOfForce | Axes[SigmaOfForce] | None = None
    """Standard uncertainty of a linear change of the force's offset over a run [N]."""
    sigma_moment_drift: SigmaOfMoment | Axes[SigmaOfMoment] | None = None
    """Standard uncertainty of a linear change of the moment's offset from the run's start to its end [N·m]."""

    def __post_init__(self) -> None:
        """Refuse delays and rotations beyond sense."""
        super().__post_init__()
        for key in ("delay", "sigma_delay", "accelerometer_delay"):
            if abs(getattr(self, key) or 0.0) > LONGEST_DELAY:
                raise WrongKeyError(key, "repair the clocks first")
        if (self.payload_mass is None) != (self.payload_r_cg_from_q is None):
            raise WrongKeyError("payload_mass", "state both payload_mass and payload_r_cg_from_q, or neither")
        if self.payload_mass is not None and not self.removes_weight:
            raise WrongKeyError("payload_mass", 'set compensated = "gravity", or leave it out')
        if self.zero_frame == "base" and not (self.turns_back and self.method == "joint"):
            raise WrongKeyError("zero_frame", 'set wrench_frame = "base" and method = "joint", or leave it out')
        if self.zero_frame == "base" and self.wrench_point is not None and self.wrench_point.any():
            raise WrongKeyError("zero_frame", "take Q at wrench_point, or leave it out")
        if np.max(self.sigma_rotation or 0.0) > WIDEST_ANGLE:
            raise WrongKeyError("sigma_rotation", "declare imu_rotation_to_body, then at most 30 deg")

    @property
    def removes_weight(self) -> bool:
        """Whether a driver removed a weight from the wrench."""
        return self.compensated in ("gravity", "gravity_from_force")

    def gravity_of_poses(self, local: float) -> np.ndarray:
        """Return gravity of this size along the axes to which poses, or a table's attitudes, refer [m/s²]."""
        return np.array([0.0, 0.0, -local]) if self.urdf_gravity is None else self.urdf_gravity

    @property
    def turns_back(self) -> bool:
        """Whether the wrench was recorded along axes at rest."""
        return self.wrench_frame in ("base", "world")

    @property
    def alignment(self) -> Alignment:
        """Prior of delay, rotation and slow errors; wide where nothing is stated."""
        stated = {key: getattr(self, key) for key in self.__struct_fields__ if key in ALIGNMENT}
        return Alignment(**{key: value for key, value in stated.items() if value is not None})

    def to_dict(self) -> dict[str, Any]:
        """Return what is declared, the alignment with what the estimate takes where it is not stated."""
        values = {key: value for key, value in msgspec.structs.asdict(self).items() if key not in ALIGNMENT}
        return {**values, "alignment": self.alignment}
