"""An MCAP file that is still being written: what has come since the last look, never read twice, checksums verified."""

import os
from collections.abc import Callable, Iterator
from typing import IO

from mcap.opcode import Opcode
from mcap.records import Channel, Schema

from rig.bags.message_packing import ContainerFile
from rig.bags.topics import Contents, Topics
from rig.exceptions import RigError
from rig.mcap.records import MAGIC, RECORD_HEADER, Batch, Definitions, Record, batches, damage, message_at
from rig.read_limits import UnpackBudget

PassOn = Callable[[Channel, Schema, int, bytes], None]
"""Function that takes a message as it is written: its channel and schema, log time [ns] and bytes."""


class GrowingFile(ContainerFile):
    """Reads a file behind its writer, which it never hinders; a record is taken once all of it is there.

    Attributes:
        definitions: schemas and channels by id, and the metadata records that have come.
        ended: whether the writer has finished the file's messages.
    """

    def __init__(self, path: str | os.PathLike[str], only: Topics, *, pass_on: PassOn | None = None) -> None:
        """Name the file, which may not exist yet.

        Args:
            path: of the file.
            only: the topics to take, as of :func:`rig.bags.topics.load`.
            pass_on: called with every message of every topic but the devices' raw bytes.
        """
        super().__init__(path, UnpackBudget(path))
        self._only, self._pass_on = only, pass_on
        self.definitions = Definitions()
        self.ended = False
        self._position = 0

    def take(self) -> Contents:
        """Return the messages that have come since the last call.

        Raises:
            RigError: a checksum is wrong, or it is no MCAP file.
            OSError: it cannot be opened.
        """
        contents = Contents(self.path)
        if not self.ended and os.path.exists(self.path):
            contents.take(self, self.definitions, self._only)
        return contents

    def batches(self, definitions: Definitions, types: set[str]) -> Iterator[Batch]:
        """The chunks that have come since the last call; what they hold is passed on."""
        with open(self.path, "rb") as stream:
            for batch in batches(self._records(stream), definitions, self.budget, self.path):
                yield batch
                if self._pass_on is not None:
                    self._hand_over(batch, self._pass_on)

    def damage(self, why: str) -> RigError:
        """The error for what is wrong with the chunk read last."""
        return damage(self.path, self._position, why)

    def _records(self, stream: IO[bytes]) -> Iterator[Record]:
        """The records of which all is there."""
        size = os.fstat(stream.fileno()).st_size
        if not self._position and size >= len(MAGIC):
            if stream.read(len(MAGIC)) != MAGIC:
                raise damage(self.path, 0, "it does not begin as an MCAP file")
            self._position = len(MAGIC)
        stream.seek(self._position)
        while not self.ended and len(head := stream.read(RECORD_HEADER.size)) == RECORD_HEADER.size:
            opcode, length = RECORD_HEADER.unpack(head)
            start, end = self._position, self._position + RECORD_HEADER.size + length
            if end > size:
                return
            self._position, self.ended = end, opcode == Opcode.DATA_END
            self.budget.reached(end)
            yield Record(start, opcode, stream.read(length))

    def _hand_over(self, batch: Batch, pass_on: PassOn) -> None:
        for number, places in batch.offsets.items():
            channel = self.definitions.channels[number]
            if not channel.topic.startswith("/raw/"):
                for message in (message_at(batch.data, place) for place in places):
                    pass_on(channel, self.definitions.schemas[channel.schema_id], message.log_time, message.data)
