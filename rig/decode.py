"""Messages of one chunk to arrays: one numpy gather for all messages that share a layout."""

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from rig import cdr

# The record of one message up to its data: https://mcap.dev/spec#message-op0x05
RECORD = [
    ("opcode", "u1"),
    ("length", "<u8"),
    ("channel", "<u2"),
    ("sequence", "<u4"),
    ("log_time", "<u8"),
    ("publish_time", "<u8"),
]
# ... and the start of a stamped message, which decides the layout of the rest.
START = np.dtype([*RECORD, ("encapsulation", "u1", (4,)), ("stamp", "u1", (8,)), ("frame_length", "u1", (4,))])


def records(data: bytes, offsets: NDArray[np.int64], dtype: np.dtype) -> NDArray:
    """The records that start at ``offsets`` (n,) of a chunk as an array (n,) of ``dtype``.

    Raises:
        ValueError: a record is too short for ``dtype``.
    """
    if offsets.max() + dtype.itemsize > len(data):
        raise ValueError("a message is too short for its type")
    window = sliding_window_view(np.frombuffer(data, np.uint8), dtype.itemsize)
    return np.ascontiguousarray(window[offsets]).view(dtype)[:, 0]


def messages(data: bytes, offsets: list[int], type_name: str) -> list[tuple[NDArray[np.intp], NDArray]]:
    """Decode the messages at ``offsets`` of a chunk: groups of equal layout, as (positions in ``offsets``, records).

    The records have the fields of ``RECORD`` and of ``cdr.layout``.

    Raises:
        ValueError: an encapsulation is not plain CDR or a message is too short for its type.
    """
    starts = np.array(offsets, dtype=np.int64)
    first = records(data, starts, START)
    key = np.concatenate([first["encapsulation"][:, :2], first["frame_length"]], axis=1)
    if (key == key[0]).all():
        return [(np.arange(len(starts)), _group(data, starts, key[0].tobytes(), type_name))]
    found, which = np.unique(key, axis=0, return_inverse=True)
    indices = [np.flatnonzero(which.ravel() == i) for i in range(len(found))]
    return [(i, _group(data, starts[i], k.tobytes(), type_name)) for i, k in zip(indices, found, strict=True)]


def _group(data: bytes, starts: NDArray[np.int64], key: bytes, type_name: str) -> NDArray:
    endianness = cdr.ENDIANNESS.get(key[:2])
    if endianness is None:
        raise ValueError(f"the encapsulation {key[:2].hex()} is not plain CDR")
    frame_length = int.from_bytes(key[2:], "little" if endianness == "<" else "big")
    if frame_length > len(data):
        raise ValueError("a message's frame_id is longer than the message")
    layout = cdr.layout(type_name, endianness, frame_length)
    dtype = np.dtype(RECORD + [(name, layout[name]) for name in layout.names or ()])
    group = records(data, starts, dtype)
    if int(group["length"].min()) + 9 < dtype.itemsize:
        raise ValueError("a message is too short for its type")
    return group


def frame_id(group: NDArray) -> str:
    """The one ``frame_id`` of a group of records.

    Raises:
        ValueError: there are several, or it is not UTF-8.
    """
    frames = group["frame_id"]
    if frames.shape[1] and not (frames == frames[0]).all():
        raise ValueError("its messages name several frames")
    return frames[0].tobytes().rstrip(b"\0").decode()
