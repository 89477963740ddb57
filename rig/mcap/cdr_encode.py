"""CDR, the encoding of ROS 2 messages: from the values that our runs carry to bytes.

:mod:`rig.mcap.cdr_decode` explains and reads it. WrenchStamped, Imu and PoseStamped, a thousand a second, by one packed
structure; the others (raw bytes, named values, marks, device status) field by field.
"""

import struct
from collections.abc import Callable, Mapping, Sequence

from rig.mcap.message_definitions import IMU, POSE, WRENCH

ENCAPSULATION = b"\x00\x01\x00\x00"
NUMBERS: dict[str, tuple[str, tuple[float, ...]]] = {
    WRENCH: ("6d", ()),
    IMU: ("24x2d64x3d72x3d72x", (1.0, -1.0)),
    POSE: ("24x4d", ()),
}
ORIENTED_IMU = "4d72x3d72x3d72x", ()
"""Numbers behind the header: their places, where ``x`` is a byte of zero, and those before a sample's.

PoseStamped is at the origin. Imu is without orientation (w = 1, ``orientation_covariance[0] = -1``), unless it is asked
for, and of unknown covariances (zeros).
"""
Encode = Callable[[int, Sequence[float]], bytes]
"""Function from a stamp [ns] and the numbers of a sample to a message."""


def encoder(type_name: str, frame_id: str, names: Sequence[str] = (), *, oriented: bool = False) -> Encode:
    """Return what packs the messages of a type in one frame.

    Args:
        type_name: WrenchStamped or Imu, of six numbers; PoseStamped, of a quaternion x y z w; JointState, of
            positions and, if there are more, velocities.
        frame_id: the frame that the messages name.
        names: of the joints or values.
        oriented: whether an Imu's numbers begin with a quaternion x y z w.
    """
    if type_name not in NUMBERS:
        return lambda stamp, numbers: _joint_state(stamp, frame_id, names, numbers)
    frame = frame_id.encode() + b"\0"
    places, first = ORIENTED_IMU if oriented else NUMBERS[type_name]
    pack = struct.Struct(f"<4siII{len(frame)}s{-(12 + len(frame)) % 8}x{places}").pack
    return lambda stamp, numbers: pack(ENCAPSULATION, *divmod(stamp, 10**9), len(frame), frame, *first, *numbers)


class _Writer:
    """Appends CDR fields, each aligned to its size."""

    def __init__(self) -> None:
        self._data = bytearray()

    def put(self, form: str, *values: int | float) -> "_Writer":
        size = struct.calcsize("<" + form[-1])
        self._data += bytes(-len(self._data) % size)
        self._data += struct.pack("<" + form, *values)
        return self

    def text(self, value: str) -> "_Writer":
        data = value.encode() + b"\0"
        self.put("I", len(data))
        self._data += data
        return self

    def header(self, stamp: int, frame_id: str) -> "_Writer":
        return self.put("i", stamp // 10**9).put("I", stamp % 10**9).text(frame_id)

    def finish(self) -> bytes:
        return ENCAPSULATION + bytes(self._data)


def encode_bytes(data: bytes) -> bytes:
    """std_msgs/UInt8MultiArray without dimensions."""
    return ENCAPSULATION + struct.pack("<III", 0, 0, len(data)) + data


def encode_text(value: str) -> bytes:
    """std_msgs/String."""
    return _Writer().text(value).finish()


def _joint_state(stamp: int, frame_id: str, names: Sequence[str], numbers: Sequence[float]) -> bytes:
    writer, count = _Writer().header(stamp, frame_id).put("I", len(names)), len(names)
    for name in names:
        writer.text(name)
    for values in (numbers[:count], numbers[count:], ()):  # position, velocity, effort
        writer.put("I", len(values))
        if values:
            writer.put(f"{len(values)}d", *values)
    return writer.finish()


OK, WARN, ERROR = 0, 1, 2


def encode_diagnostics(stamp: int, statuses: Sequence[tuple[int, str, str, Mapping[str, object]]]) -> bytes:
    """diagnostic_msgs/DiagnosticArray of (level, device, message, values), stamp in ns."""
    writer = _Writer().header(stamp, "").put("I", len(statuses))
    for level, name, message, pairs in statuses:
        writer.put("B", level).text(name).text(message).text("").put("I", len(pairs))
        for key, value in pairs.items():
            writer.text(key).text(str(value))
    return writer.finish()
