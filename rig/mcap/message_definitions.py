"""The ROS 2 message definitions that our runs carry, each with all the definitions it depends on."""

_HEADER = """std_msgs/Header header
"""
_WRENCH_STAMPED = _HEADER + "geometry_msgs/Wrench wrench\n"
_IMU = (
    _HEADER
    + """geometry_msgs/Quaternion orientation
float64[9] orientation_covariance
geometry_msgs/Vector3 angular_velocity
float64[9] angular_velocity_covariance
geometry_msgs/Vector3 linear_acceleration
float64[9] linear_acceleration_covariance
"""
)

_DIAGNOSTICS = _HEADER + "diagnostic_msgs/DiagnosticStatus[] status\n"
_JOINT_STATE = _HEADER + "string[] name\nfloat64[] position\nfloat64[] velocity\nfloat64[] effort\n"
_BYTES = "std_msgs/MultiArrayLayout layout\nuint8[] data\n"

_DEPENDENCIES = {
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id\n",
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec\n",
    "geometry_msgs/Wrench": "geometry_msgs/Vector3 force\ngeometry_msgs/Vector3 torque\n",
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


def _with_dependencies(text: str, *names: str) -> str:
    definitions = [f"{'=' * 80}\nMSG: {name}\n{_DEPENDENCIES[name]}" for name in names]
    return text + "".join(definitions)


WRENCH = "geometry_msgs/msg/WrenchStamped"
IMU = "sensor_msgs/msg/Imu"
DIAGNOSTICS = "diagnostic_msgs/msg/DiagnosticArray"
VALUES = "sensor_msgs/msg/JointState"
BYTES = "std_msgs/msg/UInt8MultiArray"
TEXT = "std_msgs/msg/String"

_STAMPED = ("std_msgs/Header", "builtin_interfaces/Time")
_VECTOR = "geometry_msgs/Vector3"

DEFINITIONS = {
    WRENCH: _with_dependencies(_WRENCH_STAMPED, *_STAMPED, "geometry_msgs/Wrench", _VECTOR),
    IMU: _with_dependencies(_IMU, *_STAMPED, "geometry_msgs/Quaternion", _VECTOR),
    DIAGNOSTICS: _with_dependencies(
        _DIAGNOSTICS, *_STAMPED, "diagnostic_msgs/DiagnosticStatus", "diagnostic_msgs/KeyValue"
    ),
    VALUES: _with_dependencies(_JOINT_STATE, *_STAMPED),
    BYTES: _with_dependencies(_BYTES, "std_msgs/MultiArrayLayout", "std_msgs/MultiArrayDimension"),
    TEXT: "string data\n",
}


FOXGLOVE = {"foxglove/msg/PoseInFrame": "geometry_msgs/msg/PoseStamped"}
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
