"""Messages of one chunk to arrays: one numpy gather for all messages that share a layout."""

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from rig.mcap import cdr_layout, message_fields

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
MOST_LAYOUTS = 256
"""Layouts of one topic in a chunk, beyond which its texts change from message to message."""


def records(data: bytes, offsets: NDArray[np.int64], dtype: np.dtype) -> NDArray:
    """The records that start at ``offsets`` (n,) of a chunk as an array (n,) of ``dtype``.

    Raises:
        ValueError: a record is too short for ``dtype``.
    """
    if offsets.max() + dtype.itemsize > len(data):
        raise ValueError("a message is too short for its type")
    window = sliding_window_view(np.frombuffer(data, np.uint8), dtype.itemsize)
    return np.ascontiguousarray(window[offsets]).view(dtype)[:, 0]


class LayoutGroup:
    """Messages of one layout: their places among the others, and their records."""

    def __init__(self, where: NDArray[np.intp], rows: NDArray, shape: cdr_layout.Layout) -> None:
        self.where = where
        self.rows = rows
        self.names = tuple(shape.names)

    @property
    def frame_id(self) -> str:
        """The frame that all of them name. Raises ``ValueError`` when it is not UTF-8."""
        if "frame_id" not in (self.rows.dtype.names or ()):
            return ""
        return self.rows["frame_id"][0].tobytes().rstrip(b"\0").decode()

    def column(self, name: str) -> NDArray:
        """One column of the messages: times in ns, numbers as doubles."""
        if name == "stamp":
            return stamps(self.rows)
        kinds = {"log_time": np.int64, "sequence": np.uint32}
        return self.rows[name].astype(kinds.get(name, np.float64))


def stamps(rows: NDArray) -> NDArray[np.int64]:
    """The header stamps [ns] of records; zeros where the type has no header."""
    if "sec" not in (rows.dtype.names or ()):
        return np.zeros(len(rows), np.int64)
    return rows["sec"][:, 0].astype(np.int64) * 1_000_000_000 + rows["nanosec"][:, 0].astype(np.int64)


def decode(data: bytes, offsets: list[int], type_name: str, encoding: str = "cdr") -> list[LayoutGroup]:
    """Decode the messages at ``offsets`` of a chunk, in groups of equal layout.

    Raises:
        ValueError: a message is not of this type, or their texts change too often.
    """
    starts = np.array(offsets, dtype=np.int64)
    lengths = records(data, starts, START)["length"].astype(np.int64) + 9
    pending, groups = np.arange(len(starts)), list[LayoutGroup]()
    while len(pending):
        if len(groups) == MOST_LAYOUTS:
            raise ValueError("its frames or names change from message to message")
        first = starts[pending[0]]
        shape = cdr_layout.of(data[first + START.itemsize : first + lengths[pending[0]]], type_name, encoding)
        same_layout = pending[lengths[pending] == lengths[pending[0]]]
        rows = records(data, starts[same_layout], np.dtype(RECORD + shape.fields))
        same = _same(rows, shape)
        if same is not None:
            same_layout, rows = same_layout[same], rows[same]
        groups.append(LayoutGroup(same_layout, rows, shape))
        pending = np.setdiff1d(pending, same_layout, assume_unique=True)
    return groups


def _same(rows: NDArray, shape: cdr_layout.Layout) -> NDArray[np.bool_] | None:
    """Return the mask of records that agree with the first in all that makes their layout; None: all of them do."""
    columns = [rows[name] for name in shape.constant]
    if shape.encoding == "cdr":
        columns.append(rows["encapsulation"][:, :2])
    equal = [values == values[0] for values in columns]
    if all(mask.all() for mask in equal):
        return None
    return np.logical_and.reduce([mask.all(axis=1) for mask in equal])


def column_names(type_name: str) -> tuple[str, ...]:
    """The columns of a topic of this type."""
    return ("log_time", "stamp", "sequence", *message_fields.columns(type_name))
