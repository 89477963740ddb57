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

_DEPENDENCIES = {
    "std_msgs/Header": "builtin_interfaces/Time stamp\nstring frame_id\n",
    "builtin_interfaces/Time": "int32 sec\nuint32 nanosec\n",
    "geometry_msgs/Wrench": "geometry_msgs/Vector3 force\ngeometry_msgs/Vector3 torque\n",
    "geometry_msgs/Vector3": "float64 x\nfloat64 y\nfloat64 z\n",
    "geometry_msgs/Quaternion": "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n",
}


def _with_dependencies(text: str, *names: str) -> str:
    parts = [f"{'=' * 80}\nMSG: {name}\n{_DEPENDENCIES[name]}" for name in names]
    return text + "".join(parts)


WRENCH = "geometry_msgs/msg/WrenchStamped"
IMU = "sensor_msgs/msg/Imu"

DEFINITIONS = {
    WRENCH: _with_dependencies(
        _WRENCH_STAMPED,
        "std_msgs/Header",
        "builtin_interfaces/Time",
        "geometry_msgs/Wrench",
        "geometry_msgs/Vector3",
    ),
    IMU: _with_dependencies(
        _IMU,
        "std_msgs/Header",
        "builtin_interfaces/Time",
        "geometry_msgs/Quaternion",
        "geometry_msgs/Vector3",
    ),
}


def canonical(name: str) -> str:
    """The ROS 2 name of a message type: ``sensor_msgs/Imu`` and ``sensor_msgs/msg/Imu`` are the same."""
    package, _, rest = name.partition("/")
    return f"{package}/msg/{rest.removeprefix('msg/')}"
