"""Events of a recorded run beside its samples: named marks, and times at which a sensor was at the end of its range."""

import os
import struct
from typing import NamedTuple

from rig.bags.containers import recording_files
from rig.bags.topics import type_of
from rig.mcap.message_definitions import DIAGNOSTICS, TEXT
from rig.mcap.records import Definitions, message_at

ALIGNED = 4  # the encapsulation, after which CDR aligns


class Mark(NamedTuple):
    """A named mark and its time [ns], on the log's clock."""

    time: int
    name: str


class Flagged(NamedTuple):
    """Samples that a device flagged (out of range, invalid) between two of its status messages [ns]."""

    device: str
    after: int
    until: int
    samples: int


class Notes(NamedTuple):
    """Marks in the order of time, and flagged samples."""

    marks: tuple[Mark, ...]
    flagged: tuple[Flagged, ...]


def read_marks(path: str | os.PathLike[str]) -> Notes:
    """Read the marks (``/mark``) and the devices' status (``/diagnostics``) of a run.

    Raises:
        RigError: the file is no MCAP, cut or damaged.
        OSError: the file cannot be opened.
    """
    marks, status = [], []
    for file in recording_files(path):
        definitions = Definitions()
        for batch in file.batches(definitions, {TEXT, DIAGNOSTICS}):
            for channel_id, offsets in batch.offsets.items():
                kind = _kind(definitions, channel_id)
                for message in (message_at(batch.data, offset) for offset in offsets.tolist() if kind):
                    try:
                        if kind == TEXT:
                            marks.append(Mark(message.log_time, _Reader(message.data).text()))
                        else:
                            status += [(message.log_time, *item) for item in _status(message.data)]
                    except (ValueError, struct.error) as error:
                        raise file.damage(str(error)) from error
    return Notes(tuple(sorted(marks)), tuple(_flagged(status)))


def _kind(definitions: Definitions, channel_id: int) -> str | None:
    """The message type of our own topics of notes; None: another topic."""
    channel = definitions.channels.get(channel_id)
    if channel is None or channel.topic not in ("/mark", "/diagnostics") or channel.message_encoding != "cdr":
        return None
    kind = type_of(channel, definitions)
    return kind if kind in (TEXT, DIAGNOSTICS) else None


class _Reader:
    """Reads CDR fields, each aligned to its size."""

    def __init__(self, data: bytes) -> None:
        if data[:2] not in (b"\0\0", b"\0\1"):
            raise ValueError(f"the encapsulation {data[:2].hex()} is not plain CDR")
        self._data, self._at, self._order = data[ALIGNED:], 0, "<" if data[1] else ">"

    def number(self, form: str) -> int:
        size = struct.calcsize(form)
        self._at += -self._at % size
        (value,) = struct.unpack_from(self._order + form, self._data, self._at)
        self._at += size
        return value

    def text(self) -> str:
        length = self.number("I")
        start, self._at = self._at, self._at + length
        return self._data[start : self._at].rstrip(b"\0").decode("utf-8", "replace")


def _status(data: bytes) -> list[tuple[str, dict[str, str]]]:
    """Name and values of each device in a DiagnosticArray."""
    reader = _Reader(data)
    reader.number("i")
    reader.number("I")
    reader.text()
    statuses = []
    for _ in range(reader.number("I")):
        reader.number("B")
        name, _, _ = reader.text(), reader.text(), reader.text()
        statuses.append((name, {reader.text(): reader.text() for _ in range(reader.number("I"))}))
    return statuses


def _flagged(status: list[tuple[int, str, dict[str, str]]]) -> list[Flagged]:
    flagged: list[Flagged] = []
    last: dict[str, tuple[int, int]] = {}
    for time, device, values in sorted(status, key=lambda item: item[0]):
        count = values.get("flagged", "")
        if not count.isdigit():
            continue
        after, before = last.get(device, (0, 0))
        if int(count) > before:
            flagged.append(Flagged(device, after, time, int(count) - before))
        last[device] = (time, int(count))
    return flagged
