"""The other messages of a recorded run in CDR: raw bytes, named values, marks, device status."""

import struct
from collections.abc import Mapping, Sequence

from rig.mcap.cdr_encode import ENCAPSULATION


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


def raw(data: bytes) -> bytes:
    """std_msgs/UInt8MultiArray without dimensions."""
    return _BYTES_START + struct.pack("<I", len(data)) + data


def text(value: str) -> bytes:
    """std_msgs/String."""
    return _Writer().text(value).finish()


def values(stamp: int, frame_id: str, names: Sequence[str], numbers: Sequence[float]) -> bytes:
    """sensor_msgs/JointState with names and positions, stamp in ns."""
    writer = _Writer().header(stamp, frame_id).put("I", len(names))
    for name in names:
        writer.text(name)
    writer.put("I", len(numbers)).put(f"{len(numbers)}d", *numbers)
    return writer.put("I", 0).put("I", 0).finish()


OK, WARN, ERROR = 0, 1, 2


def diagnostics(stamp: int, statuses: Sequence[tuple[int, str, str, Mapping[str, object]]]) -> bytes:
    """diagnostic_msgs/DiagnosticArray of (level, device, message, values), stamp in ns."""
    writer = _Writer().header(stamp, "").put("I", len(statuses))
    for level, name, message, pairs in statuses:
        writer.put("B", level).text(name).text(message).text("").put("I", len(pairs))
        for key, value in pairs.items():
            writer.text(key).text(str(value))
    return writer.finish()
