"""Messages that are trees of named fields, in JSON or protobuf: ROS types by their own field names, one by one.

Such files are written by Foxglove's tools and bridges. A message of a known type has the fields of
:mod:`rig.mcap.message_definitions` by name: vectors as ``{"x": .., "y": .., "z": ..}`` or lists, stamps as
``header.stamp`` or, in Foxglove's own schemas, ``timestamp`` and ``frame_id`` beside the rest.
"""

from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np
from mcap.records import Channel, Schema
from numpy.typing import NDArray

from rig.bags.protobuf_messages import decoder
from rig.exceptions import quoted
from rig.mcap.cdr import DecodedMessages
from rig.mcap.message_definitions import SHAPES, STAMPED, Field
from rig.mcap.records import message_at
from rig.read_limits import parse_json

ENCODINGS = ("json", "protobuf")
AXES = "xyzw"
KINDS = {"where": np.intp, "log_time": np.int64, "stamp": np.int64, "sequence": np.uint32}
SECONDS, NANOSECONDS = ("sec", "secs", "seconds"), ("nanosec", "nsec", "nsecs", "nanos", "nanoseconds")


def decode(
    data: bytes, offsets: NDArray[np.int64], type_name: str, channel: Channel, schema: Schema
) -> list[DecodedMessages]:
    """Decode the messages at ``offsets`` of a chunk.

    Raises:
        ValueError: a message does not decode, or a field is missing or no number.
    """
    read = _json if channel.message_encoding == "json" else decoder(schema.data, schema.name)
    groups: dict[tuple, list[dict[str, Any]]] = {}
    for place, offset in enumerate(offsets.tolist()):
        message = message_at(data, offset)
        tree = read(message.data)
        stamp, frame = _header(tree) if type_name in STAMPED else (0, "")
        names, values = _values(tree, type_name)
        key = frame, names, *(len(value) for value in values.values())
        row = {"where": place, "log_time": message.log_time, "stamp": stamp, "sequence": message.sequence}
        groups.setdefault(key, []).append(row | values)
    return [_together(frame, names, rows) for (frame, names, *_), rows in groups.items()]


def _together(frame: str, names: tuple[str, ...], rows: list[dict[str, Any]]) -> DecodedMessages:
    arrays = {name: np.array([row[name] for row in rows], KINDS.get(name, np.float64)) for name in rows[0]}
    return DecodedMessages(arrays.pop("where"), frame, names, arrays)


def _json(data: bytes) -> Mapping[str, Any]:
    try:
        tree = parse_json(data)
    except ValueError:
        raise ValueError("a message is not JSON") from None
    if not isinstance(tree, dict):
        raise ValueError("a message is not a JSON object")
    return tree


def _header(tree: Mapping[str, Any]) -> tuple[int, str]:
    """Stamp [ns] and frame."""
    header = tree.get("header", tree)
    if not isinstance(header, Mapping):
        raise ValueError("its field header is no object")
    stamp = header.get("stamp", header.get("timestamp"))
    frame = header.get("frame_id", "")
    if not isinstance(stamp, Mapping) or not isinstance(frame, str):
        raise ValueError("a message has no header.stamp with seconds and nanoseconds")
    numbers = [next((stamp[name] for name in names if name in stamp), None) for names in (SECONDS, NANOSECONDS)]
    if not all(isinstance(number, int) and abs(number) < 2**33 for number in numbers):
        raise ValueError("a message has no header.stamp with seconds and nanoseconds")
    return int(numbers[0] or 0) * 1_000_000_000 + int(numbers[1] or 0), frame


def _values(tree: Mapping[str, Any], type_name: str) -> tuple[tuple[str, ...], dict[str, list[float]]]:
    """Names of joints, and the numbers of each column."""
    names: tuple[str, ...] = ()
    values = {}
    for item in SHAPES[type_name]:
        if item.kind == "texts":
            texts = _at(tree, item.path)
            if not isinstance(texts, list) or not all(isinstance(text, str) for text in texts):
                raise ValueError(f"its field {item.path} is no list of names")
            names = tuple(texts)
        elif item.column:
            values[item.column] = list(_numbers(_at(tree, item.path), item))
    return names, values


def _at(tree: Any, path: str) -> Any:
    for name in path.split("."):
        if not isinstance(tree, Mapping) or name not in tree:
            raise ValueError(f"a message has no field {path}")
        tree = tree[name]
    return tree


def _numbers(value: Any, item: Field) -> Iterator[float]:
    numbers = [value.get(axis) for axis in AXES[: item.count]] if isinstance(value, Mapping) else value
    if not isinstance(numbers, list) or (item.kind == "doubles" and len(numbers) != item.count):
        raise ValueError(f"its field {item.path} does not have {item.count} numbers")
    for number in numbers:
        if isinstance(number, bool) or not isinstance(number, (int, float)):
            raise ValueError(f"its field {item.path} holds {quoted(number)}, which is no number")
        yield float(number)
