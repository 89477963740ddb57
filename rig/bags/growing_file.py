"""An MCAP file that is still being written: what has come since the last look, never read twice, checksums verified."""

import os
from collections.abc import Iterator
from typing import IO

from mcap.opcode import Opcode

from rig.bags.message_packing import ContainerFile
from rig.bags.topics import Contents, Topics
from rig.exceptions import RigError
from rig.mcap.records import MAGIC, RECORD_HEADER, Batch, Definitions, Record, batches, damage
from rig.read_limits import UnpackBudget


class GrowingFile(ContainerFile):
    """Reads a file behind its writer, which it never hinders; a record is taken once all of it is there.

    Attributes:
        definitions: schemas and channels by id, and the metadata records that have come.
        ended: whether the writer has finished the file's messages.
    """

    def __init__(self, path: str | os.PathLike[str], only: Topics) -> None:
        """Name the file, which may not exist yet.

        Args:
            path: of the file.
            only: the topics to take, as of :func:`rig.bags.topics.load`.
        """
        super().__init__(path, UnpackBudget(path))
        self._only = only
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
        """The chunks that have come since the last call."""
        with open(self.path, "rb") as stream:
            yield from batches(self._records(stream), definitions, self.budget, self.path)

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
