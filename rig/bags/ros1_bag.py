"""ROS 1 bags (.bag, version 2.0), by the optional package rosbags; their messages are decoded like all others."""

import bz2
import errno
import os
from collections.abc import Iterator
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import lz4.frame
from mcap.records import Channel, Schema

from rig.bags.message_packing import FULL, ContainerFile, Packer
from rig.exceptions import RigError, reason
from rig.mcap.message_definitions import canonical
from rig.mcap.records import Batch, Definitions
from rig.read_limits import UnpackBudget

INDEX_ENTRY = 16
"""Bytes of memory that a byte of the bag's index takes, about."""


class Ros1File(ContainerFile):
    """A ROS 1 recording, a .bag file."""

    def damage(self, why: str) -> RigError:
        """The error for a file that is cut or damaged."""
        return RigError(f"cut or damaged ROS 1 bag {self.name} ({reason(why)}): repair a copy with `rosbag reindex`")

    def batches(self, definitions: Definitions, types: set[str]) -> Iterator[Batch]:
        """The messages of these types, a megabyte at a time."""
        packer = Packer()
        self.budget.reached(os.path.getsize(self.path))
        try:
            with self._reader() as reader:
                for connection in reader.connections:
                    number = connection.id
                    definitions.schemas[number] = Schema(number, b"", "ros1msg", connection.msgtype)
                    definitions.channels[number] = Channel(number, connection.topic, "ros1", {}, number)
                wanted = [item for item in reader.connections if canonical(item.msgtype) in types]
                for connection, time, data in reader.messages(wanted) if wanted else ():
                    self.budget.take(len(data))
                    packer.add(connection.id, time, bytes(data))
                    yield from packer.take(FULL)
        except (GeneratorExit, RigError):
            raise
        except Exception as error:  # rosbags lets out what struct, bz2, lz4 and seeking raise of a damaged file
            if isinstance(error, OSError) and error.errno not in (None, errno.EINVAL):
                raise
            raise self.damage(str(error) or type(error).__name__) from error
        yield from packer.take()

    def _reader(self) -> AbstractContextManager[Any]:
        """The reader of rosbags, but what it unpacks, and how often it reads its index, counts to the budget."""
        try:
            from rosbags.rosbag1 import reader
        except ImportError:
            raise RigError(f"{self.name} is a ROS 1 bag: `pip install inertia-uq[bags]` reads it") from None
        budget = self.budget
        expanders = {reader.bz2_decompress: bz2.BZ2Decompressor, reader.lz4_decompress: lz4.frame.LZ4FrameDecompressor}

        class LimitedReader(reader.Reader):
            def read_chunk(self) -> Any:
                chunk = super().read_chunk()
                expander = expanders.get(chunk.decompressor)
                return chunk._replace(decompressor=lambda packed: _unpacked(packed, expander, budget))

            def read_index_data(self, pos: int, indexes: Any) -> None:
                assert self.bio is not None  # noqa: S101
                start = self.bio.tell()
                super().read_index_data(pos, indexes)
                budget.take(INDEX_ENTRY * (self.bio.tell() - start))

        return LimitedReader(Path(self.path))


def _unpacked(packed: bytes, expander: Any, budget: UnpackBudget) -> bytes:
    """Return a chunk's records. Raises ``UnpackError`` when they are more than the budget has left."""
    data = packed
    if expander is not None:
        expand = expander()
        data = expand.decompress(packed, max_length=budget.left + 1)
        if len(data) <= budget.left and not expand.eof:
            raise ValueError("a chunk ends early")
    budget.take(len(data))
    return data
