"""The ROS 2 message types that we read, with their fields, and the definitions that our runs carry."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

WRENCH = "geometry_msgs/msg/WrenchStamped"
IMU = "sensor_msgs/msg/Imu"
POSE = "geometry_msgs/msg/PoseStamped"
DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
VALUES = "sensor_msgs/msg/JointState"
BYTES = "std_msgs/msg/UInt8MultiArray"
TEXT = "std_msgs/msg/String"

_TEXTS = {
    WRENCH: "std_msgs/Header header\ngeometry_msgs/Wrench wrench\n",
    IMU: """std_msgs/Header header
geometry_msgs/Quaternion orientation
float64[9] orientation_covariance
geometry_msgs/Vector3 angular_velocity
float64[9] angular_velocity_covariance
geometry_msgs/Vector3 linear_acceleration
float64[9] linear_acceleration_covariance
""",
    POSE: "std_msgs/Header header\ngeometry_msgs/Pose pose\n",
    DIAGNOSTICS: "std_msgs/Header header\ndiagnostic_msgs/DiagnosticStatus[] status\n",
    VALUES: "std_msgs/Header header\nstring[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n",
    BYTES: "std_msgs/MultiArrayLayout layout\nuint8[] data\n",
    TEXT: "string data\n",
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id\n",
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec\n",
    "geometry_msgs/Wrench": "geometry_msgs/Vector3 force\ngeometry_msgs/Vector3 torque\n",
    "geometry_msgs/Pose": "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n",
    "geometry_msgs/Point": "float64 x\nfloat64 y\nfloat64 z\n",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z\n",
    "geometry_msgs/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n",
    "diagnostic_msgs/DiagnosticStatus": (
        "byte OK=0\nbyte WARN=1\nbyte ERROR=2\nbyte STALE=3\n"
        "byte level\nstring name\nstring message\nstring hardware_id\ndiagnostic_msgs/KeyValue[] values\n"
    ),
    "diagnostic_msgs/KeyValue": "string key\nstring value\n",
    "std_msgs/MultiArrayLayout": "std_msgs/MultiArrayDimension[] dim\nuint32 data_offset\n",
    "std_msgs/MultiArrayDimension": "string label\nuint32 size\nuint32 stride\n",
}


def _types_in(name: str) -> Iterator[str]:
    """The types of a message's fields, of these fields' own, and so on."""
    for line in _TEXTS[name].splitlines():
        kind = line.split()[0].removesuffix("[]")
        if kind in _TEXTS:
            yield kind
            yield from _types_in(kind)


DEFINITIONS = {
    name: _TEXTS[name] + "".join(f"{'=' * 80}\nMSG: {kind}\n{_TEXTS[kind]}" for kind in dict.fromkeys(_types_in(name)))
    for name in (WRENCH, IMU, POSE, DIAGNOSTICS, VALUES, BYTES, TEXT)
}
"""The definition of each message that our runs carry, with those of all types in it."""


FOXGLOVE = {"foxglove/msg/PoseInFrame": POSE}
"""Types of Foxglove's own that have the fields of a ROS type, and their order."""


def canonical(name: str) -> str:
    """The ROS 2 name of a message type.

    ``sensor_msgs/Imu``, ``sensor_msgs/msg/Imu`` and protobuf's ``ros.sensor_msgs.Imu`` are the same.
    """
    if "/" in name:
        package, _, rest = name.partition("/")
    else:
        *above, rest = name.split(".")
        package = next((name for name in reversed(above) if name != "msg"), "")
    full = f"{package.replace('foxglove_msgs', 'foxglove')}/msg/{rest.removeprefix('msg/')}" if package else name
    return FOXGLOVE.get(full, full)


BARE_WRENCH = "geometry_msgs/msg/Wrench"
TWIST = "geometry_msgs/msg/TwistStamped"
ODOMETRY = "nav_msgs/msg/Odometry"
JOINTS = VALUES

WRENCHES = (WRENCH, BARE_WRENCH)
MOTIONS = (IMU, TWIST, ODOMETRY, POSE, JOINTS)
"""Types from which an angular velocity follows, the most direct first."""


@dataclass(frozen=True)
class Field:
    """One field of a message.

    Attributes:
        path: where it stands in the message, such as ``twist.twist.angular``.
        kind: doubles of a fixed number, a sequence of doubles, a text, a sequence of texts.
        count: how many doubles of a fixed number.
        column: the name of what a channel keeps of it; None: it is skipped.
    """

    path: str
    kind: Literal["doubles", "sequence", "text", "texts"] = "doubles"
    count: int = 3
    column: str | None = None


_TWIST = (Field("twist.linear"), Field("twist.angular", column="angular_velocity"))
_ORIENTATION = "orientation"

SHAPES: dict[str, tuple[Field, ...]] = {
    WRENCH: (Field("wrench.force", column="force"), Field("wrench.torque", column="moment")),
    BARE_WRENCH: (Field("force", column="force"), Field("torque", column="moment")),
    IMU: (
        Field("orientation", count=4, column=_ORIENTATION),
        Field("orientation_covariance", count=9),
        Field("angular_velocity", column="angular_velocity"),
        Field("angular_velocity_covariance", count=9),
        Field("linear_acceleration", column="linear_acceleration"),
        Field("linear_acceleration_covariance", count=9),
    ),
    TWIST: _TWIST,
    POSE: (Field("pose.position", column="position"), Field("pose.orientation", count=4, column=_ORIENTATION)),
    ODOMETRY: (
        Field("child_frame_id", "text"),
        Field("pose.pose.position", column="position"),
        Field("pose.pose.orientation", count=4, column=_ORIENTATION),
        Field("pose.covariance", count=36),
        Field("twist.twist.linear"),
        Field("twist.twist.angular", column="angular_velocity"),
        Field("twist.covariance", count=36),
    ),
    JOINTS: (
        Field("name", "texts", column="names"),
        Field("position", "sequence", column="position"),
        Field("velocity", "sequence", column="velocity"),
        Field("effort", "sequence"),
    ),
}
"""Fields behind the header of each message type, by type."""

STAMPED = {name for name in SHAPES if name != BARE_WRENCH}
"""Types that begin with a std_msgs/Header."""


def columns(type_name: str) -> tuple[str, ...]:
    """The names of what a channel keeps of each message of a type, names of joints apart."""
    return tuple(field.column for field in SHAPES[type_name] if field.column and field.kind != "texts")
