"""Messages of any container as the chunks of MCAP records that :mod:`rig.mcap.cdr_decode` takes."""

import hashlib
import os
import struct
from collections.abc import Iterator

import zstandard

from rig.mcap.records import Batch
from rig.read_limits import UnpackBudget

MESSAGE = struct.Struct("<BQHIQQ")
"""A message's record up to its data: opcode 5, length, channel, sequence, log time, publish time."""
ZSTD = b"\x28\xb5\x2f\xfd"
FULL = 2**20
"""Bytes of a chunk."""
LONGEST = 2**20
"""Bytes of a message; a sample takes some hundred."""


class ForeignFile:
    """A file that is no MCAP; messages call it by its budget's name."""

    def __init__(self, path: str | os.PathLike[str], budget: UnpackBudget) -> None:
        self.path, self.name, self.budget = path, budget.name, budget
        budget.reached(os.path.getsize(path))

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
        """Take one message. Raises ``ValueError`` when its time cannot be, or it is too long."""
        if not 0 <= log_time < 2**63:
            raise ValueError(f"a message has the time {log_time} ns")
        _check_length(len(data))
        self._offsets.setdefault(channel, []).append(len(self._data))
        self._data += MESSAGE.pack(5, MESSAGE.size - 9 + len(data), channel, sequence, log_time, log_time)
        self._data += data

    @property
    def full(self) -> bool:
        """Whether the chunk is full, so that it should be taken."""
        return len(self._data) >= FULL

    def take(self) -> Iterator[Batch]:
        """The chunk, if there is anything in it; the packer is empty then."""
        if self._offsets:
            yield Batch(bytes(self._data), self._offsets, [], [])
        self._data, self._offsets = bytearray(), {}


def _check_length(size: int) -> None:
    if size > LONGEST:
        raise ValueError(f"a message of {size} bytes, where a sample has some hundred")


def pieces(data: bytes, offsets: list[int], budget: UnpackBudget) -> Iterator[tuple[bytes, list[int]]]:
    """The messages at ``offsets`` about a megabyte at a time, so that decoding takes little memory.

    They are decompressed where rosbag2 compressed each by itself (mode MESSAGE).

    Raises:
        ValueError: one does not decompress or is too long.
        UnpackError: together they are more than the budget has left.
    """
    packed = data.startswith(ZSTD, offsets[0] + MESSAGE.size)
    if not packed and len(data) <= 2 * FULL:
        yield data, offsets
        return
    packer, expand = Packer(), zstandard.ZstdDecompressor()
    for offset in offsets:
        _, length, channel, sequence, log_time, _ = MESSAGE.unpack_from(data, offset)
        message = data[offset + MESSAGE.size : offset + 9 + length]
        if packed:
            message = _message(message, expand)
            budget.take(len(message))
        packer.add(channel, log_time, message, sequence)
        if packer.full:
            yield from _taken(packer)
    yield from _taken(packer)


def _message(packed: bytes, expand: zstandard.ZstdDecompressor) -> bytes:
    try:
        stated = zstandard.get_frame_parameters(packed).content_size
        if stated != zstandard.CONTENTSIZE_UNKNOWN:
            _check_length(stated)
        return expand.decompress(packed, max_output_size=LONGEST)
    except zstandard.ZstdError as error:
        raise ValueError("a message does not decompress") from error


def _taken(packer: Packer) -> Iterator[tuple[bytes, list[int]]]:
    for batch in packer.take():
        yield batch.data, next(iter(batch.offsets.values()))
