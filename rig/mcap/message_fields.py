"""The fields of each message type that we read, in the order in which ROS serialises them."""

from dataclasses import dataclass
from typing import Literal

from rig.mcap.message_definitions import IMU, POSE, VALUES, WRENCH

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
