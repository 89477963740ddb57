"""The layout of a serialised message as a numpy dtype, which all messages of equal texts and lengths share.

ROS 2 serialises in CDR: a four-byte encapsulation header (``00 01`` little-endian, ``00 00`` big-endian), then the
fields, each aligned to its size counted from behind that header; texts end in NUL (OMG DDSI-RTPS 2.5, clause 10). ROS 1
serialises little-endian without alignment or NUL, and its header begins with a counter.
"""

from dataclasses import dataclass, field

import numpy as np

from rig.mcap.message_fields import SHAPES, STAMPED

ENDIANNESS = {b"\x00\x01": "<", b"\x00\x00": ">"}
ENCODINGS = ("cdr", "ros1")
MOST_NAMES = 4096
"""Joints in a message; each is a field of the layout."""


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
    names: list[str] = field(default_factory=list)
    """The texts of a sequence of texts: names of joints."""

    def __post_init__(self) -> None:
        self._at, self._origin, self._order = 0, 0, "<"
        if self.encoding == "cdr":
            order = ENDIANNESS.get(self.message[:2])
            if order is None:
                raise ValueError(f"the encapsulation {self.message[:2].hex()} is not plain CDR")
            self._put("encapsulation", "u1", 4, constant=False)
            self.fields[-1] = ("encapsulation", "u1", (4,))
            self._order, self._origin = order, 4

    @property
    def dtype(self) -> np.dtype:
        """The layout's dtype."""
        return np.dtype(self.fields)

    def _put(self, name: str, form: str, count: int, *, constant: bool) -> int:
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

    def doubles(self, name: str, count: int) -> None:
        """Add fields of doubles."""
        self._put(name, "f8", count, constant=False)

    def stamp(self) -> None:
        """Add the header up to its frame."""
        if self.encoding == "ros1":
            self._put("counter", "u4", 1, constant=False)
        self._put("sec", "u4" if self.encoding == "ros1" else "i4", 1, constant=False)
        self._put("nanosec", "u4", 1, constant=False)


def of(message: bytes, type_name: str, encoding: str) -> Layout:
    """The layout of a message of this type. Raises ``ValueError`` when the bytes are not such a message."""
    layout = Layout(message, encoding)
    if type_name in STAMPED:
        layout.stamp()
        layout.text("frame_id")
    for item in SHAPES[type_name]:
        name = item.column or item.path
        if item.kind == "doubles":
            layout.doubles(name, item.count)
        elif item.kind == "sequence":
            layout.doubles(name, layout.length(name))
        elif item.kind == "text":
            layout.text(name)
        else:
            count = layout.length(name)
            if count > MOST_NAMES:
                raise ValueError(f"its {name} has more than {MOST_NAMES} texts")
            layout.names = [layout.text(f"{name}_{k}") for k in range(count)]
    return layout
