"""A file of a recording in any container, and its messages as the chunks of MCAP records that are decoded."""

import hashlib
import os
from abc import ABC, abstractmethod
from collections.abc import Iterator

import numpy as np
import zstandard
from numpy.typing import NDArray

from rig.exceptions import RigError
from rig.mcap.records import MESSAGE, Batch, Definitions, message_at
from rig.read_limits import UnpackBudget

ZSTD = b"\x28\xb5\x2f\xfd"
FULL = 2**20
"""Bytes of a chunk."""
LONGEST = 2**20
"""Bytes of a message; a sample takes some hundred."""


class ContainerFile(ABC):
    """One file of a recording; messages call it by its budget's name, where it was unpacked from another."""

    def __init__(self, path: str | os.PathLike[str], budget: UnpackBudget) -> None:
        self.path, self.name, self.budget = path, budget.name, budget

    @property
    def sha256(self) -> str:
        """The file's hash, once all its batches are taken."""
        with open(self.path, "rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()

    @property
    def rest(self) -> int:
        """Bytes behind the file's end mark, which nobody reads, once all its batches are taken."""
        return 0

    @abstractmethod
    def batches(self, definitions: Definitions, types: set[str]) -> Iterator[Batch]:
        """The messages, at least those of these types, chunk by chunk; fills ``definitions`` on the way."""

    @abstractmethod
    def damage(self, why: str) -> RigError:
        """The error for what is wrong with what was read last."""


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

    def take(self, least: int = 1) -> Iterator[Batch]:
        """The chunk, if there are as many bytes in it; the packer is empty then."""
        if len(self._data) >= least:
            offsets = {channel: np.array(places) for channel, places in self._offsets.items()}
            yield Batch(bytes(self._data), offsets, [], [])
            self._data, self._offsets = bytearray(), {}


def _check_length(size: int) -> None:
    if size > LONGEST:
        raise ValueError(f"a message of {size} bytes, where a sample has about a hundred")


def pieces(data: bytes, offsets: NDArray[np.int64], budget: UnpackBudget) -> Iterator[tuple[bytes, NDArray[np.int64]]]:
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
    for offset in offsets.tolist():
        message = message_at(data, offset)
        if packed:
            message.data = _unpacked(message.data, expand)
            budget.take(len(message.data))
        packer.add(message.channel_id, message.log_time, message.data, message.sequence)
        yield from _taken(packer, FULL)
    yield from _taken(packer)


def _unpacked(packed: bytes, expand: zstandard.ZstdDecompressor) -> bytes:
    try:
        stated = zstandard.get_frame_parameters(packed).content_size
        if stated != zstandard.CONTENTSIZE_UNKNOWN:
            _check_length(stated)
        return expand.decompress(packed, max_output_size=LONGEST)
    except zstandard.ZstdError as error:
        raise ValueError("a message does not decompress") from error


def _taken(packer: Packer, least: int = 1) -> Iterator[tuple[bytes, NDArray[np.int64]]]:
    for batch in packer.take(least):
        yield batch.data, next(iter(batch.offsets.values()))
