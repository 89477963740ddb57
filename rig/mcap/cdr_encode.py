"""CDR, the encoding of ROS 2 messages: from the values that our runs carry to bytes.

:mod:`rig.mcap.cdr_layout` explains and reads it. WrenchStamped and Imu, a thousand a second, by one packed structure;
the others (raw bytes, named values, marks, device status) field by field.
"""

import struct
from collections.abc import Mapping, Sequence

from rig.mcap import message_definitions
from rig.mcap.message_fields import SHAPES

ENCAPSULATION = b"\x00\x01\x00\x00"


class Encoder:
    """Packs messages of one stamped type in one frame: ``encoder(stamp_ns, *doubles) -> bytes``."""

    def __init__(self, type_name: str, frame_id: str) -> None:
        frame = frame_id.encode() + b"\0"
        padding = -(12 + len(frame)) % 8
        doubles = sum(field.count for field in SHAPES[type_name])
        self._struct = struct.Struct(f"<4siII{len(frame)}s{padding}x{doubles}d")
        self._frame = frame

    def __call__(self, stamp: int, *values: float) -> bytes:
        """The message with this stamp [ns] and these doubles, in the order of ``BODIES``."""
        sec, nanosec = divmod(stamp, 1_000_000_000)
        return self._struct.pack(ENCAPSULATION, sec, nanosec, len(self._frame), self._frame, *values)


class WrenchEncoder(Encoder):
    """Packs WrenchStamped: ``encoder(stamp_ns, Fx, Fy, Fz, Mx, My, Mz)``."""

    def __init__(self, frame_id: str) -> None:
        super().__init__(message_definitions.WRENCH, frame_id)


_NO_ORIENTATION = (0.0, 0.0, 0.0, 1.0, -1.0, *[0.0] * 8)
_UNKNOWN_COVARIANCE = (0.0,) * 9


class ImuEncoder(Encoder):
    """Packs Imu without orientation (``orientation_covariance[0] = -1``) and with unknown covariances (zeros)."""

    def __init__(self, frame_id: str) -> None:
        super().__init__(message_definitions.IMU, frame_id)

    def __call__(self, stamp: int, *values: float) -> bytes:
        """The message with this stamp [ns], angular velocity and specific force (six doubles)."""
        return super().__call__(
            stamp, *_NO_ORIENTATION, *values[:3], *_UNKNOWN_COVARIANCE, *values[3:], *_UNKNOWN_COVARIANCE
        )


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


_BYTES_START = ENCAPSULATION + struct.pack("<II", 0, 0)


def encode_bytes(data: bytes) -> bytes:
    """std_msgs/UInt8MultiArray without dimensions."""
    return _BYTES_START + struct.pack("<I", len(data)) + data


def encode_text(value: str) -> bytes:
    """std_msgs/String."""
    return _Writer().text(value).finish()


def encode_values(stamp: int, frame_id: str, names: Sequence[str], numbers: Sequence[float]) -> bytes:
    """sensor_msgs/JointState with names and positions, stamp in ns."""
    writer = _Writer().header(stamp, frame_id).put("I", len(names))
    for name in names:
        writer.text(name)
    writer.put("I", len(numbers)).put(f"{len(numbers)}d", *numbers)
    return writer.put("I", 0).put("I", 0).finish()


class JointsEncoder:
    """Packs sensor_msgs/JointState of these joints: ``encoder(stamp_ns, positions + velocities)``, no effort."""

    def __init__(self, frame_id: str, names: Sequence[str]) -> None:
        count = len(names)
        writer = _Writer().header(0, frame_id).put("I", count)
        for name in names:
            writer.text(name)
        empty = writer.put("I", count).put(f"{count}d", *[0.0] * count).put("I", count).put(f"{count}d", *[0.0] * count)
        self._message = bytearray(empty.put("I", 0).finish())
        self._numbers = struct.Struct(f"<{count}d")
        self._velocity = len(self._message) - 4 - self._numbers.size
        self._position = self._velocity - self._numbers.size - (8 if count else 4)
        self._count = count

    def __call__(self, stamp: int, values: tuple[float, ...]) -> bytes:
        """The message with this stamp [ns]."""
        message = self._message
        struct.pack_into("<iI", message, len(ENCAPSULATION), stamp // 10**9, stamp % 10**9)
        self._numbers.pack_into(message, self._position, *values[: self._count])
        self._numbers.pack_into(message, self._velocity, *values[self._count :])
        return bytes(message)


OK, WARN, ERROR = 0, 1, 2


def encode_diagnostics(stamp: int, statuses: Sequence[tuple[int, str, str, Mapping[str, object]]]) -> bytes:
    """diagnostic_msgs/DiagnosticArray of (level, device, message, values), stamp in ns."""
    writer = _Writer().header(stamp, "").put("I", len(statuses))
    for level, name, message, pairs in statuses:
        writer.put("B", level).text(name).text(message).text("").put("I", len(pairs))
        for key, value in pairs.items():
            writer.text(key).text(str(value))
    return writer.finish()
