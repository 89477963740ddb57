"""The MCAP container (https://mcap.dev/spec), read record by record with every checksum verified.

Works on the file's records only; what the messages mean is the business of ``rig.runs``.
"""

import hashlib
import os
import struct
import time
import zlib
from collections import defaultdict
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from io import BytesIO
from typing import IO

import lz4.frame
import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Message, Metadata, Schema
from numpy.typing import NDArray

from rig import read_limits
from rig.exceptions import RigError, quoted, reason
from rig.read_limits import UnpackBudget

MAGIC = b"\x89MCAP0\r\n"
BLOCK = 2**20
"""Bytes at a time of a record that nobody reads."""
UNREAD = frozenset(map(int, (Opcode.ATTACHMENT, Opcode.MESSAGE_INDEX, Opcode.CHUNK_INDEX, Opcode.ATTACHMENT_INDEX)))
"""Records whose bytes count only for the checksums."""
DEFINITION = 4096
"""Bytes that a record other than a message counts for, however short it is: the objects that it becomes, the time."""
KNOWN = {int(opcode) for opcode in Opcode}
RECORD_HEADER = struct.Struct("<BQ")
MESSAGE = struct.Struct("<BQHIQQ")
"""A message's record up to its data: opcode 5, length, channel, sequence, log time, publish time."""
MESSAGE_HEAD = MESSAGE.size - 9
"""Bytes that its length counts beside its data."""
MOST_DEFINITIONS = 2**16
"""Records in one chunk that are no messages; ids of schemas and channels have 16 bits."""
PARSE_ERRORS = (McapError, struct.error, ValueError, EOFError, OverflowError, MemoryError)
_MESSAGE_START = struct.Struct("<BQH").unpack_from
"""Opcode and length of a record, and a message's channel."""
HEAD = np.dtype([("opcode", "u1"), ("length", "<u8"), ("channel", "<u2")])
MESSAGE_OPCODE = int(Opcode.MESSAGE)
PATTERN = 16
"""Most messages that are written in turn: two sensors whose rates are as 1 to 15."""


class DamageError(RigError):
    """The file is cut or damaged."""


@dataclass(frozen=True)
class Record:
    """One top-level record: where it starts, its opcode and its bytes behind opcode and length.

    A large one of ``UNREAD`` is without bytes.
    """

    position: int
    opcode: int
    body: bytes


@dataclass
class Batch:
    """The records of one chunk: its bytes, and per channel the offsets of its messages, in file order.

    ``others`` counts the records that are no messages.
    """

    data: bytes
    offsets: dict[int, NDArray[np.int64]]
    schemas: list[Schema]
    channels: list[Channel]
    others: int = 0


@dataclass
class Definitions:
    """Schemas and channels of a file by id, and its metadata records by name."""

    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    metadata: dict[str, dict[str, str]] = field(default_factory=dict)

    def add(self, batch: Batch) -> None:
        """Take what a chunk defines."""
        self.schemas |= {schema.id: schema for schema in batch.schemas}
        self.channels |= {channel.id: channel for channel in batch.channels}


class Scanner:
    """Iterates over a file's records from start to end, verifying magic, lengths and section checksums.

    ``position`` is the number of bytes read so far; after a full iteration ``sha256`` is the file's hash. Raises
    ``DamageError`` where the file ends early or a checksum disagrees, ``UnpackError`` where a record is too large to be
    held, and ``RigError`` where it is no MCAP.
    """

    def __init__(self, path: str | os.PathLike[str], stream: IO[bytes], budget: UnpackBudget | None = None) -> None:
        self.path = path
        self.budget = UnpackBudget(path) if budget is None else budget
        self._stream = stream
        self._size = os.fstat(stream.fileno()).st_size
        self.position = 0
        self._hash = hashlib.sha256()
        self._crc = 0
        self._told, self._tell = False, time.monotonic() + read_limits.SLOW

    @property
    def sha256(self) -> str:
        """The hash of everything read so far, in hexadecimal."""
        return self._hash.hexdigest()

    @property
    def rest(self) -> int:
        """The number of bytes that are not read yet."""
        return self._size - self.position

    def __iter__(self) -> Iterator[Record]:
        """The records up to and with the footer."""
        if self._take(min(8, self._size)) != MAGIC:
            raise RigError(f"not an MCAP file {self.path}: give a run recorded by `inertia record` or ROS 2")
        opcode = None
        while opcode != Opcode.FOOTER:
            before = self._crc
            record = self._next()
            opcode = record.opcode
            self._verify_section(record, before)
            yield record
        if self._take(8) != MAGIC:
            raise damage(self.path, self.position, "the end mark is missing")

    def _next(self) -> Record:
        position = self.position
        opcode, length = RECORD_HEADER.unpack(self._take(9))
        if not opcode:
            raise damage(self.path, position, "no record has the opcode 0")
        if opcode != Opcode.MESSAGE:
            self.budget.take(DEFINITION)
        if length > self.budget.piece and length <= self.rest:
            if opcode not in UNREAD and opcode in KNOWN:
                raise self.budget.exceeded()
            for start in range(0, length, BLOCK):
                self._take(min(BLOCK, length - start))
            return Record(position, opcode, b"")
        return Record(position, opcode, self._take(length))

    def _take(self, count: int) -> bytes:
        data = self._stream.read(count) if count <= self.rest else b""
        if len(data) != count:
            raise damage(self.path, self.position, "it ends early")
        self.position += count
        self.budget.reached(self.position)
        if self.position >= self._size or time.monotonic() >= self._tell:
            self._watch()
        self._hash.update(data)
        self._crc = zlib.crc32(data, self._crc)
        return data

    def _watch(self) -> None:
        """Tell how far the file is read, where it takes long."""
        if time.monotonic() >= self._tell:
            read_limits.watch(self.path, self.position, self._size)
            self._told, self._tell = True, time.monotonic() + 1.0
        elif self._told:
            read_limits.watch(self.path, self._size, self._size)

    def _verify_section(self, record: Record, before: int) -> None:
        """Compare the checksum that ends the data section or the summary section with what was read."""
        if record.opcode == Opcode.DATA_END:
            expected, actual = _u32(record.body, 0), before
            self._crc = 0
        elif record.opcode == Opcode.FOOTER:
            start = RECORD_HEADER.pack(record.opcode, len(record.body)) + record.body[:16]
            expected, actual = _u32(record.body, 16), zlib.crc32(start, before)
        else:
            return
        if expected not in (0, actual):
            raise damage(self.path, record.position, "a section's checksum is wrong")


def _u32(body: bytes, offset: int) -> int:
    if len(body) < offset + 4:
        return 0
    return int.from_bytes(body[offset : offset + 4], "little")


def damage(path: str | os.PathLike[str], position: int, why: str) -> DamageError:
    """The error for a file damaged at this byte."""
    return DamageError(
        f"cut or damaged MCAP {path} at byte {position} ({reason(why)}): "
        f"save its intact messages with `inertia recover {path} -o NEW.mcap`"
    )


def walk(data: bytes) -> Batch:
    """Find the records in a chunk's bytes. Raises ``ValueError`` when they do not fill it exactly.

    A recorder writes messages of few lengths in turn: those that were last are guessed to repeat, which is verified.
    """
    batch, offsets = Batch(data, {}, [], []), defaultdict[int, list[int]](list)
    repeated = defaultdict[int, list[NDArray[np.int64]]](list)
    position, end, last, patience = 0, len(data), list[tuple[int, int]](), 2 * PATTERN
    try:
        while position < end:
            opcode, length, channel = _MESSAGE_START(data, position)
            if opcode != MESSAGE_OPCODE:
                _definition(batch, opcode, data[position + 9 : position + 9 + length])
                last.clear()
            elif length < MESSAGE_HEAD:
                raise ValueError("a message is shorter than its header")
            else:
                offsets[channel].append(position)
                last.append((length, channel))
            position += 9 + length
            if len(last) >= patience:
                pattern = _pattern(last[-2 * PATTERN :])
                rounds, stride = _rounds(data, position, pattern)
                for (_, channel), places in zip(pattern, rounds, strict=False):
                    repeated[channel].append(places)
                position += stride * len(rounds[0]) if rounds else 0
                last.clear()
                patience = 2 * PATTERN if rounds else 2 * patience  # messages in no order are not compared for nothing
    except PARSE_ERRORS as error:
        raise ValueError("a chunk's records are damaged") from error
    if position != end:
        raise ValueError("a chunk's last record is cut")
    batch.offsets = {
        channel: np.sort(np.concatenate([np.array(places, np.int64), *repeated[channel]]))
        for channel, places in offsets.items()
    }
    return batch


def _pattern(last: list[tuple[int, int]]) -> list[tuple[int, int]]:
    """Length and channel of the messages that the last ones repeat; none where they do not."""
    periods = range(1, PATTERN + 1)
    return next((last[-period:] for period in periods if last[-period:] == last[-2 * period : -period]), [])


def _rounds(data: bytes, position: int, pattern: list[tuple[int, int]]) -> tuple[list[NDArray[np.int64]], int]:
    """Return where each message of a pattern is as long as the pattern repeats, and the bytes of one repetition."""
    stride = sum(9 + length for length, _ in pattern)
    count = (len(data) - position) // stride if pattern else 0
    if not count:
        return [], stride
    starts, same = position + stride * np.arange(count), np.ones(count, bool)
    places = np.cumsum([0, *(9 + length for length, _ in pattern[:-1])])
    for place, head in zip(places.tolist(), pattern, strict=True):
        heads = np.ndarray(count, HEAD, data, position + place, stride)
        same &= (heads["opcode"] == MESSAGE_OPCODE) & (heads["length"] == head[0]) & (heads["channel"] == head[1])
    rounds = starts[: count if same.all() else int(np.argmin(same))]
    return [rounds + place for place in places] if len(rounds) else [], stride


def _definition(batch: Batch, opcode: int, body: bytes) -> None:
    if opcode == Opcode.SCHEMA:
        batch.schemas.append(Schema.read(ReadDataStream(BytesIO(body))))
    elif opcode == Opcode.CHANNEL:
        batch.channels.append(Channel.read(ReadDataStream(BytesIO(body))))
    elif not opcode:
        raise ValueError("no record has the opcode 0")
    batch.others += 1
    if batch.others > MOST_DEFINITIONS:
        raise ValueError("a chunk defines too much")


def message_at(data: bytes, offset: int) -> Message:
    """Return the message whose record starts at ``offset`` of a chunk."""
    _, length, channel, sequence, log_time, publish_time = MESSAGE.unpack_from(data, offset)
    content = data[offset + MESSAGE.size : offset + RECORD_HEADER.size + length]
    return Message(channel_id=channel, log_time=log_time, data=content, publish_time=publish_time, sequence=sequence)


def chunk_data(record: Record, budget: UnpackBudget) -> bytes:
    """The uncompressed records of a chunk, its checksum verified.

    Raises:
        ValueError: anything disagrees.
        UnpackError: it truly holds more than the budget has left.
    """
    try:
        chunk = Chunk.read(ReadDataStream(BytesIO(record.body)))
    except PARSE_ERRORS as error:
        raise ValueError("the chunk's header is damaged") from error
    data = _decompress(chunk, budget)
    budget.take(len(data))
    if len(data) != chunk.uncompressed_size:
        raise ValueError("a chunk's length is wrong")
    if chunk.uncompressed_crc not in (0, zlib.crc32(data)):
        raise ValueError("a chunk's checksum is wrong")
    return data


def _decompress(chunk: Chunk, budget: UnpackBudget) -> bytes:
    """Return at most a byte more than the chunk claims or the budget has left: a length by itself may be damage."""
    limit = min(chunk.uncompressed_size, budget.left) + 1
    try:
        if chunk.compression == "zstd":
            return _from_zstd(chunk, budget, limit)
        if chunk.compression == "lz4":
            expand = lz4.frame.LZ4FrameDecompressor()
            data = expand.decompress(chunk.data, max_length=limit)
            if len(data) < limit and not expand.eof:
                raise ValueError("a chunk does not decompress")
            return data
    except (zstandard.ZstdError, RuntimeError, MemoryError, EOFError) as error:
        raise ValueError("a chunk does not decompress") from error
    if chunk.compression:
        raise ValueError(f"unknown compression {quoted(chunk.compression)}")
    return chunk.data


def _from_zstd(chunk: Chunk, budget: UnpackBudget, limit: int) -> bytes:
    stated = zstandard.get_frame_parameters(chunk.data).content_size
    if stated in (0, zstandard.CONTENTSIZE_UNKNOWN):
        return zstandard.ZstdDecompressor().stream_reader(chunk.data).read(limit)
    if stated != chunk.uncompressed_size:
        raise ValueError("a chunk's length is wrong")
    if stated > budget.left:  # two lengths agree: no damage
        raise budget.exceeded()
    return zstandard.decompress(chunk.data, max_output_size=stated)


def chunk_batch(record: Record, budget: UnpackBudget) -> Batch:
    """The records of a chunk. Raises as :func:`chunk_data` and :func:`walk`."""
    batch = walk(chunk_data(record, budget))
    budget.take(DEFINITION * batch.others)
    return batch


SEAL = "crc32"


def seal(name: str, facts: dict[str, str]) -> dict[str, str]:
    """Metadata with a checksum of its own: the container has none for it, so that a damaged file would lose all."""
    return {**facts, SEAL: _seal(name, facts)}


def _seal(name: str, facts: dict[str, str]) -> str:
    text = "\0".join([name, *(text for item in facts.items() for text in item)])
    return f"{zlib.crc32(text.encode()):08x}"


def metadata(record: Record) -> tuple[str, dict[str, str]]:
    """Name and facts of a metadata record, its seal verified and taken off. Raises ``ValueError`` when it is broken."""
    parsed = Metadata.read(ReadDataStream(BytesIO(record.body)))
    facts = dict(parsed.metadata)
    expected = facts.pop(SEAL, None)
    if expected not in (None, _seal(parsed.name, facts)):
        raise ValueError("a metadata record's checksum is wrong")
    return parsed.name, facts


def is_sealed(record: Record) -> bool:
    """Whether a metadata record carries its own checksum."""
    return SEAL.encode() in record.body


def batches(
    records: Iterable[Record], definitions: Definitions, budget: UnpackBudget, path: str | os.PathLike[str]
) -> Iterator[Batch]:
    """The messages of a file's records, chunk by chunk; those outside chunks come in batches of about a megabyte.

    Fills ``definitions`` on the way. Raises ``DamageError`` at the first damage, ``UnpackError`` beyond the limit.
    """
    loose = bytearray()
    for record in records:
        batch = None
        try:
            if record.opcode == Opcode.CHUNK:
                batch = chunk_batch(record, budget)
            elif record.opcode == Opcode.METADATA:
                name, facts = metadata(record)
                definitions.metadata[name] = facts
            elif record.opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                definitions.add(walk(_framed(record)))
            elif record.opcode == Opcode.MESSAGE:
                loose += _framed(record)
            if len(loose) > BLOCK or (loose and record.opcode == Opcode.DATA_END):
                batch = walk(bytes(loose))
                loose.clear()
        except PARSE_ERRORS as error:
            if isinstance(error, RigError):
                raise
            raise damage(path, record.position, str(error) or type(error).__name__) from error
        if batch is not None:
            definitions.add(batch)
            yield batch


def joined(chunks: Iterable[Batch], size: int) -> Iterator[Batch]:
    """Yield the messages of several chunks together, as long as they have no more bytes than ``size``.

    Definitions are left out: who reads the chunks has them.
    """
    waiting, count = list[Batch](), 0
    for chunk in chunks:
        if waiting and count + len(chunk.data) > size:
            yield _one(waiting)
            waiting, count = [], 0
        waiting.append(chunk)
        count += len(chunk.data)
    if waiting:
        yield _one(waiting)


def _one(chunks: list[Batch]) -> Batch:
    if len(chunks) == 1:
        return chunks[0]
    starts = np.cumsum([0, *(len(chunk.data) for chunk in chunks)]).tolist()
    offsets = defaultdict[int, list[NDArray[np.int64]]](list)
    for start, chunk in zip(starts, chunks, strict=False):
        for channel, places in chunk.offsets.items():
            offsets[channel].append(start + places)
    return Batch(
        b"".join(chunk.data for chunk in chunks),
        {channel: np.concatenate(places) for channel, places in offsets.items()}, [], [],
    )  # fmt: skip


def _framed(record: Record) -> bytes:
    return RECORD_HEADER.pack(record.opcode, len(record.body)) + record.body
