"""CDR, the encoding of ROS 2 messages, and that of ROS 1: messages to arrays, and the values of our runs to bytes.

All messages of a chunk that share a layout are read by one NumPy gather. WrenchStamped, Imu and PoseStamped, a
thousand a second, are written by one packed structure; the others (raw bytes, named values, marks, device status) field
by field.

ROS 2 serialises in CDR: a four-byte encapsulation header (``00 01`` little-endian, ``00 00`` big-endian), then the
fields, each aligned to its size counted from behind that header; texts end in NUL (OMG DDSI-RTPS 2.5, clause 10). ROS 1
serialises little-endian without alignment or NUL, and its header begins with a counter. All messages of equal texts and
lengths have one layout.
"""

import struct
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from rig.exceptions import RigError
from rig.mcap.message_definitions import IMU, POSE, SHAPES, STAMPED, WRENCH, Field, columns

ENDIANNESS = {b"\x00\x01": "<", b"\x00\x00": ">"}
ENCODINGS = ("cdr", "ros1")
MOST_NAMES = 4096
"""Joints in a message; each is a field of the layout."""
MOST_LAYOUTS = 4096
"""Layouts of one topic in a chunk, beyond which its texts change from message to message."""
# The record of one message up to its data: https://mcap.dev/spec#message-op0x05
RECORD = [
    ("opcode", "u1"),
    ("length", "<u8"),
    ("channel", "<u2"),
    ("sequence", "<u4"),
    ("log_time", "<u8"),
    ("publish_time", "<u8"),
]
START = np.dtype(RECORD)


class DecodedMessages(NamedTuple):
    """Messages of one frame and the same joints: their places among the others, and their columns by name.

    Times are in ns; numbers are doubles.
    """

    where: NDArray[np.intp]
    frame_id: str
    names: tuple[str, ...]
    columns: dict[str, NDArray]


@dataclass
class Layout:
    """The fields of one message: a numpy dtype's, and which of them have the same bytes in all messages of the layout.

    Raises:
        ValueError: the message is not of this type.
    """

    message: bytes
    encoding: str
    fields: list[tuple] = field(default_factory=list)
    constant: list[str] = field(default_factory=list)
    frame_id: str = ""
    names: tuple[str, ...] = ()
    """The texts of a sequence of texts: names of joints."""

    def __post_init__(self) -> None:
        self._at, self._origin, self._order = 0, 0, "<"
        if self.encoding == "cdr":
            order = ENDIANNESS.get(self.message[:2])
            if order is None:
                raise ValueError(f"the encapsulation {self.message[:2].hex()} is not plain CDR")
            self._put("encapsulation", "u1", 4)
            self._order, self._origin = order, 4

    def _put(self, name: str, form: str, count: int, *, constant: bool = False) -> int:
        """Add a field of ``count`` numbers; returns where it begins."""
        size = int(form[-1])
        if self.encoding == "cdr" and count and (gap := (self._origin - self._at) % size):
            self.fields.append((f"padding_{self._at}", "u1", (gap,)))
            self._at += gap
        start, self._at = self._at, self._at + size * count
        if self._at > len(self.message):
            raise ValueError("a message is too short for its type")
        self.fields.append((name, form if size == 1 else self._order + form, (count,)))
        if constant:
            self.constant.append(name)
        return start

    def length(self, name: str) -> int:
        """Add a count and return it."""
        start = self._put(f"{name}_length", "u4", 1, constant=True)
        count = int.from_bytes(self.message[start : start + 4], "little" if self._order == "<" else "big")
        if count > len(self.message):
            raise ValueError(f"its {name} is longer than the message")
        return count

    def text(self, name: str) -> str:
        """Add a text and return it."""
        count = self.length(name)
        start = self._put(name, "u1", count, constant=True)
        return self.message[start : start + count].rstrip(b"\0").decode()

    def header(self) -> None:
        """Add the stamp and the frame."""
        if self.encoding == "ros1":
            self._put("counter", "u4", 1)
        self._put("sec", "u4" if self.encoding == "ros1" else "i4", 1)
        self._put("nanosec", "u4", 1)
        self.frame_id = self.text("frame_id")

    def add(self, item: Field) -> None:
        """Add a field of the message's type."""
        name = item.column or item.path
        if item.kind == "doubles":
            self._put(name, "f8", item.count)
        elif item.kind == "sequence":
            self._put(name, "f8", self.length(name))
        elif item.kind == "text":
            self.text(name)
        elif (count := self.length(name)) > MOST_NAMES:
            raise ValueError(f"its {name} has more than {MOST_NAMES} texts")
        else:
            self.names = tuple(self.text(f"{name}_{k}") for k in range(count))


def layout_of(message: bytes, type_name: str, encoding: str) -> Layout:
    """Return the layout of a message of this type. Raises ``ValueError`` when the bytes are not such a message."""
    layout = Layout(message, encoding)
    if type_name in STAMPED:
        layout.header()
    for item in SHAPES[type_name]:
        layout.add(item)
    return layout


def records(data: bytes, offsets: NDArray[np.int64], dtype: np.dtype) -> NDArray:
    """The records that start at ``offsets`` (n,) of a chunk as an array (n,) of ``dtype``.

    Raises:
        ValueError: a record is too short for ``dtype``.
    """
    if offsets.max() + dtype.itemsize > len(data):
        raise ValueError("a message is too short for its type")
    steps = np.diff(offsets)
    if len(steps) and steps[0] > 0 and (steps == steps[0]).all():  # as they mostly are: nothing is copied
        return np.ndarray(len(offsets), dtype, data, int(offsets[0]), int(steps[0]))
    window = sliding_window_view(np.frombuffer(data, np.uint8), dtype.itemsize)
    return np.ascontiguousarray(window[offsets]).view(dtype)[:, 0]


def _stamps(rows: NDArray) -> NDArray[np.int64]:
    """The header stamps [ns] of records; zeros where the type has no header."""
    if "sec" not in (rows.dtype.names or ()):
        return np.zeros(len(rows), np.int64)
    return rows["sec"][:, 0].astype(np.int64) * 1_000_000_000 + rows["nanosec"][:, 0].astype(np.int64)


def decode(data: bytes, offsets: NDArray[np.int64], type_name: str, encoding: str = "cdr") -> list[DecodedMessages]:
    """Decode the messages at ``offsets`` of a chunk, in groups of equal layout.

    Raises:
        ValueError: a message is not of this type.
        RigError: their texts change too often.
    """
    lengths = records(data, offsets, START)["length"].astype(np.int64) + 9
    pending, groups = np.arange(len(offsets)), list[DecodedMessages]()
    while len(pending):
        if len(groups) == MOST_LAYOUTS:
            raise RigError("its frames or names change from message to message: record those of the robot alone")
        first = int(offsets[pending[0]])
        shape = layout_of(data[first + START.itemsize : first + lengths[pending[0]]], type_name, encoding)
        same_layout = pending[lengths[pending] == lengths[pending[0]]]
        rows = records(data, offsets[same_layout], np.dtype(RECORD + shape.fields))
        same = _same(rows, shape)
        if not same.all():
            same_layout, rows = same_layout[same], rows[same]
        groups.append(DecodedMessages(same_layout, shape.frame_id, shape.names, _columns(rows, type_name)))
        if len(same_layout) == len(pending):
            break
        pending = np.setdiff1d(pending, same_layout, assume_unique=True)
    return groups


def _same(rows: NDArray, shape: Layout) -> NDArray[np.bool_]:
    """Return the mask of records that agree with the first in all that makes their layout."""
    texts = [rows[name] for name in shape.constant]
    if shape.encoding == "cdr":
        texts.append(rows["encapsulation"][:, :2])
    same = np.ones(len(rows), bool)
    for values in texts:
        equal = values == values[0]
        if not equal.all():  # mostly they are: rows are looked at only where they must be
            same &= equal.all(axis=1)
    return same


def _columns(rows: NDArray, type_name: str) -> dict[str, NDArray]:
    numbers = {name: rows[name].astype(np.float64) for name in columns(type_name)}
    log_time, sequence = rows["log_time"].astype(np.int64), rows["sequence"].astype(np.uint32)
    return {"log_time": log_time, "stamp": _stamps(rows), "sequence": sequence, **numbers}


ENCAPSULATION = b"\x00\x01\x00\x00"
NUMBERS: dict[str, tuple[str, tuple[float, ...]]] = {
    WRENCH: ("6d", ()),
    IMU: ("24x2d64x3d72x3d72x", (1.0, -1.0)),
    POSE: ("24x4d", ()),
}
ORIENTED_IMU = "4d72x3d72x3d72x", ()
PLACED_POSE = "7d", ()
"""Numbers behind the header: their places, where ``x`` is a byte of zero, and those before a sample's.

PoseStamped is at the origin, unless a position is given. Imu is without orientation (w = 1,
``orientation_covariance[0] = -1``), unless it is asked for, and of unknown covariances (zeros).
"""
Encode = Callable[[int, Sequence[float]], bytes]
"""Function from a stamp [ns] and the numbers of a sample to a message."""


def encoder(
    type_name: str, frame_id: str, names: Sequence[str] = (), *, oriented: bool = False, placed: bool = False
) -> Encode:
    """Return what packs the messages of a type in one frame.

    Args:
        type_name: WrenchStamped or Imu, of six numbers; PoseStamped, of a quaternion x y z w; JointState, of
            positions and, if there are more, velocities.
        frame_id: the frame that the messages name.
        names: of the joints or values.
        oriented: whether an Imu's numbers begin with a quaternion x y z w.
        placed: whether a PoseStamped's numbers begin with a position.
    """
    if type_name not in NUMBERS:
        return lambda stamp, numbers: _joint_state(stamp, frame_id, names, numbers)
    frame = frame_id.encode() + b"\0"
    places, first = ORIENTED_IMU if oriented else PLACED_POSE if placed else NUMBERS[type_name]
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
