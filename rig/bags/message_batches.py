"""Messages of any container as the chunks of MCAP records that :mod:`rig.mcap.cdr_decode` takes."""

import hashlib
import os
import struct
from collections.abc import Iterator

import zstandard

from rig.mcap.records import CHUNK_LIMIT, Batch

MESSAGE = struct.Struct("<BQHIQQ")
"""A message's record up to its data: opcode 5, length, channel, sequence, log time, publish time."""
ZSTD = b"\x28\xb5\x2f\xfd"
FULL = 2**20
"""Bytes of a chunk."""


class ForeignFile:
    """A file that is no MCAP; ``name`` is what messages call it."""

    def __init__(self, path: str | os.PathLike[str], name: str | os.PathLike[str]) -> None:
        self.path, self.name = path, name

    @property
    def sha256(self) -> str:
        """The file's hash."""
        with open(self.path, "rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()


class Packer:
    """Collects messages and gives them in chunks of about a megabyte."""

    def __init__(self) -> None:
        self._data = bytearray()
        self._offsets: dict[int, list[int]] = {}

    def add(self, channel: int, log_time: int, data: bytes, sequence: int = 0) -> None:
        """Take one message. Raises ``ValueError`` when its time cannot be."""
        if not 0 <= log_time < 2**63:
            raise ValueError(f"a message has the time {log_time} ns")
        self._offsets.setdefault(channel, []).append(len(self._data))
        self._data += MESSAGE.pack(5, MESSAGE.size - 9 + len(data), channel, sequence, log_time, log_time)
        self._data += data

    @property
    def full(self) -> bool:
        """Whether it is time to take the chunk."""
        return len(self._data) >= FULL

    def take(self) -> Iterator[Batch]:
        """The chunk, if there is anything in it; the packer is empty then."""
        if self._offsets:
            yield Batch(bytes(self._data), self._offsets, [], [])
        self._data, self._offsets = bytearray(), {}


def unpacked(data: bytes, offsets: list[int]) -> tuple[bytes, list[int]]:
    """The same messages with their data decompressed, where rosbag2 compressed each by itself (mode MESSAGE).

    Raises:
        ValueError: one does not decompress.
    """
    if not data.startswith(ZSTD, offsets[0] + MESSAGE.size):
        return data, offsets
    packer, expand = Packer(), zstandard.ZstdDecompressor()
    for offset in offsets:
        _, length, channel, sequence, log_time, _ = MESSAGE.unpack_from(data, offset)
        packed = data[offset + MESSAGE.size : offset + 9 + length]
        try:
            if zstandard.get_frame_parameters(packed).content_size > CHUNK_LIMIT:
                raise ValueError("a message's length is out of bounds")
            packer.add(channel, log_time, expand.decompress(packed, max_output_size=CHUNK_LIMIT), sequence)
        except zstandard.ZstdError as error:
            raise ValueError("a message does not decompress") from error
    (batch,) = packer.take()
    return batch.data, next(iter(batch.offsets.values()))
