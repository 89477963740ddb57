"""An MCAP file that is still being written: what has come since the last look, never read twice, checksums verified."""

import os
from collections.abc import Callable, Mapping
from io import FileIO
from pathlib import Path

from mcap.opcode import Opcode
from mcap.records import Channel, Schema

from rig.bags.message_batches import MESSAGE
from rig.bags.topics import Contents
from rig.exceptions import RigError
from rig.mcap.record_batch import PARSE_ERRORS, Batch
from rig.mcap.records import (
    MAGIC,
    RECORD_HEADER,
    Definitions,
    Record,
    chunk_batch,
    damage,
    metadata,
)
from rig.read_limits import UnpackBudget

MOST = 2**24
"""Bytes that are read at a time, and more where one record is larger."""
PassOn = Callable[[Channel, Schema, int, bytes], None]
"""Function that takes a message as it is written: its channel and schema, log time [ns] and bytes."""


class GrowingFile:
    """Reads a file behind its writer, which it never hinders; a record is taken once all of it is there.

    Attributes:
        definitions: schemas and channels by id, and the metadata records that have come.
        ended: whether the writer has finished the file's messages.
    """

    def __init__(
        self, path: str | os.PathLike[str], only: Mapping[str, str | None], *, pass_on: PassOn | None = None
    ) -> None:
        """Name the file, which may not exist yet.

        Args:
            path: of the file.
            only: the topics to take, as of :func:`rig.bags.topics.load`.
            pass_on: called with every message of every topic but the devices' raw bytes.
        """
        self.path, self._only, self._pass_on = Path(path), only, pass_on
        self.definitions = Definitions({}, {}, {})
        self.ended = False
        self._position, self._budget = 0, UnpackBudget(path)

    def take(self) -> Contents:
        """Return the messages that have come since the last call.

        Raises:
            RigError: a checksum is wrong, or it is no MCAP file.
            OSError: it cannot be opened.
        """
        contents = Contents(self.path)
        if self.ended or not self.path.exists():
            return contents
        with open(self.path, "rb", buffering=0) as stream:
            while not self.ended and self._block(stream, os.fstat(stream.fileno()).st_size, contents):
                pass
        contents.note(self.definitions)
        return contents

    def _block(self, stream: FileIO, size: int, contents: Contents) -> bool:
        """Take the whole records of one read; whether there may be more."""
        if not self._position:
            if size < len(MAGIC):
                return False
            if self._read(stream, len(MAGIC)) != MAGIC:
                raise damage(self.path, 0, "it does not begin as an MCAP file")
            self._position = len(MAGIC)
        data, start = self._read(stream, max(min(MOST, size - self._position), 0)), 0
        while start + RECORD_HEADER.size <= len(data) and not self.ended:
            opcode, length = RECORD_HEADER.unpack_from(data, start)
            body = start + RECORD_HEADER.size
            if body + length > len(data):
                if start or self._position + body + length > size:
                    break
                data = self._read(stream, body + length)
            self._record(Record(self._position + start, opcode, data[body : body + length]), contents)
            start = body + length
        self._position += start
        self._budget.reached(self._position)
        return start > 0

    def _read(self, stream: FileIO, count: int) -> bytes:
        stream.seek(self._position)
        parts: list[bytes] = []
        while count > 0 and (part := stream.read(count)):
            parts.append(part)
            count -= len(part)
        return b"".join(parts)

    def _record(self, record: Record, contents: Contents) -> None:
        try:
            if record.opcode == Opcode.CHUNK:
                self._budget.reached(record.position + len(record.body))
                batch = chunk_batch(record, self._budget)
                self.definitions.schemas |= {schema.id: schema for schema in batch.schemas}
                self.definitions.channels |= {channel.id: channel for channel in batch.channels}
                contents.add(batch, self.definitions, self._only, self._budget)
                if self._pass_on is not None:
                    self._hand_over(batch, self._pass_on)
            elif record.opcode == Opcode.METADATA:
                name, facts = metadata(record)
                self.definitions.metadata[name] = facts
            elif record.opcode == Opcode.DATA_END:
                self.ended = True
        except PARSE_ERRORS as error:
            if isinstance(error, RigError):
                raise
            raise damage(self.path, record.position, str(error) or type(error).__name__) from error

    def _hand_over(self, batch: Batch, pass_on: PassOn) -> None:
        for number, places in batch.offsets.items():
            channel = self.definitions.channels[number]
            if channel.topic.startswith("/raw/"):
                continue
            schema = self.definitions.schemas[channel.schema_id]
            for place in places:
                _, length, _, _, log_time, _ = MESSAGE.unpack_from(batch.data, place)
                start, end = place + MESSAGE.size, place + RECORD_HEADER.size + length
                pass_on(channel, schema, log_time, batch.data[start:end])
