"""Recovery of a cut or damaged MCAP file: every chunk whose checksum is right, and nothing else.

Chunks are searched for over the whole file, whatever the records around them say: a damaged length must not hide the
chunks behind it. What lies between chunks (metadata, definitions, messages outside chunks) is read record by record.
"""

import errno
import mmap
import os
import re
import struct
import zlib
from array import array
from collections.abc import Iterator, Sequence
from contextlib import closing, suppress
from dataclasses import dataclass, field
from io import BytesIO
from itertools import chain
from pathlib import Path

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Statistics
from mcap.writer import Writer

from rig.atomic_files import check_output, replacing
from rig.exceptions import RigError, counted
from rig.mcap.records import (
    KNOWN,
    MAGIC,
    PARSE_ERRORS,
    RECORD_HEADER,
    UNREAD,
    Batch,
    Definitions,
    Record,
    Scanner,
    batches,
    chunk_batch,
    is_sealed,
    message_at,
    metadata,
    seal,
    walk,
)
from rig.mcap.writer import new_writer
from rig.read_limits import UnpackBudget, UnpackError, require_file

# A chunk's header: opcode, length, three u64, CRC, name of the compression.
CHUNK_START = re.compile(rb"\x06(?=.{5}\0\0\0.{28}(?:\x04\0\0\0zstd|\x03\0\0\0lz4|\0\0\0\0))", re.DOTALL)
HEADER = struct.Struct("<BQQQQII")
FOOTER = struct.Struct("<QQI")


@dataclass
class Recovery:
    """Counts of the messages and bytes that were saved and lost.

    Attributes:
        messages: messages saved.
        chunks: chunks saved.
        lost_bytes: bytes that belong to no intact record.
        expected: messages that the file itself says it had, or None where that is gone.
        intact: nothing was lost.
        cut: the file only ends early: what comes before its end is as it was written.
        notes: what the user should know, a sentence each.
    """

    messages: int = 0
    chunks: int = 0
    lost_bytes: int = 0
    expected: int | None = None
    intact: bool = False
    cut: bool = False
    notes: list[str] = field(default_factory=list)

    def __str__(self) -> str:
        """Show the counts in one line."""
        if self.intact:
            lost = "nothing was lost"
        elif self.expected is not None:
            lost = f"lost {max(0, self.expected - self.messages)} of {self.expected} messages"
        else:
            lost = "the number of lost messages is unknown"
        what = "at its end belong to no whole chunk: the file is cut" if self.cut else "are damaged"
        damaged = f", {counted(self.lost_bytes, 'byte')} {what}" if self.lost_bytes else ""
        saved = f"saved {counted(self.messages, 'message')} in {counted(self.chunks, 'chunk')}"
        return "; ".join([f"{saved}, {lost}{damaged}", *self.notes])


@dataclass
class _IntactRecords:
    """The intact records of a damaged file. Chunks by position only: a file may be larger than the memory."""

    definitions: Definitions = field(default_factory=Definitions)
    chunks: list[int] = field(default_factory=list)
    between: list[tuple[int, int]] = field(default_factory=list)  # position and opcode
    loose: array = field(default_factory=lambda: array("Q"))  # positions of the messages outside chunks
    gaps: list[int] = field(default_factory=list)  # damaged bytes behind each chunk, and before the first
    finished: bool = False

    @property
    def only_cut(self) -> bool:
        """Whether the file just ends early, so that all content before the end is as it was written."""
        return not self.finished and not any(self.gaps[:-1])


def recover(path: str | os.PathLike[str], output: str | os.PathLike[str]) -> Recovery:
    """Write every intact message of a file to a new one. The source is only read.

    Raises:
        RigError: the output exists, the file is damaged and holds no intact message, or it unpacks to too much.
        OSError: a file cannot be opened or written.
    """
    check_output(output)
    require_file(path)
    with open(path, "rb") as stream:
        if os.fstat(stream.fileno()).st_size < len(MAGIC):
            raise RigError(f"nothing to recover in {path}: it ends before its first chunk")
        with closing(mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ)) as data:
            return _recover(path, data, output, list(_extents(stream.fileno(), len(data))))


def _extents(handle: int, size: int) -> Iterator[tuple[int, int]]:
    """Start and end of each part of an open file that is on disk; a sparse file may have holes of any size between."""
    position = 0
    while position < size:
        try:
            start = os.lseek(handle, position, os.SEEK_DATA)
            position = os.lseek(handle, start, os.SEEK_HOLE)
        except (OSError, AttributeError) as error:  # AttributeError: Windows
            if getattr(error, "errno", None) != errno.ENXIO:
                yield position, size  # the system cannot tell
            return
        yield start, position


def _recover(
    path: str | os.PathLike[str], data: mmap.mmap, output: str | os.PathLike[str], extents: list[tuple[int, int]]
) -> Recovery:
    intact = _find_intact(data, extents, UnpackBudget(path))
    result = Recovery(intact=_is_intact(path), lost_bytes=sum(intact.gaps), cut=intact.only_cut)
    trusted = result.intact or intact.only_cut
    _summary(data, intact, trusted, result)
    loose = _loose(intact, trusted, result)
    if not intact.chunks and not loose:
        if not result.intact:
            raise RigError(f"nothing to recover in {path}: no intact chunk in {len(data)} bytes")
        result.notes.append("the file is intact and holds no messages")
    with replacing(output) as stream:
        writer = new_writer(stream)
        for name, facts in _metadata(data, intact, trusted, result):
            writer.add_metadata(name, seal(name, facts))
        channels, undefined = _registered(writer, intact.definitions), 0
        budget = UnpackBudget(path, read=len(data))
        records = (_record(data, at) for at in chain(intact.chunks, loose))
        end = Record(len(data), Opcode.DATA_END, b"")
        for batch in batches(chain(records, [end]), Definitions(), budget, path):
            for position in sorted(chain(*(places.tolist() for places in batch.offsets.values()))):
                message = message_at(batch.data, position)
                if message.channel_id not in channels:
                    undefined += 1
                    continue
                number, sequence = channels[message.channel_id], message.sequence
                writer.add_message(number, message.log_time, message.data, message.publish_time, sequence)
                result.messages += 1
            result.chunks += 1
            writer.flush()
        if undefined:
            result.notes.append(f"{undefined} messages of topics whose definition is lost are left out")
        facts = {"source": Path(path).name, "result": str(result)}
        writer.add_metadata("rig.mcap.recover", seal("rig.mcap.recover", facts))
        writer.finish()
    return result


def _is_intact(path: str | os.PathLike[str]) -> bool:
    """Whether the file reads from end to end with every checksum right."""
    try:
        with open(path, "rb") as stream:
            scanner = Scanner(path, stream)
            for _ in batches(scanner, Definitions(), scanner.budget, path):
                pass
    except UnpackError:
        raise
    except PARSE_ERRORS:
        return False
    return True


def _find_intact(data: mmap.mmap, extents: list[tuple[int, int]], budget: UnpackBudget) -> _IntactRecords:
    intact = _IntactRecords(finished=data[-len(MAGIC) :] == MAGIC)
    position = len(MAGIC)
    starts = (CHUNK_START.finditer(data, start, end + HEADER.size) for start, end in extents)
    for match in chain.from_iterable(starts):
        if match.start() < position or (batch := _chunk_at(data, match.start(), budget)) is None:
            continue
        _between(data, position, match.start(), intact)
        intact.chunks.append(match.start())
        intact.definitions.add(batch)
        position = match.start() + 9 + RECORD_HEADER.unpack_from(data, match.start())[1]
    _between(data, position, len(data) - (len(MAGIC) if intact.finished else 0), intact)
    return intact


def _bytes(data: mmap.mmap, start: int) -> bytes:
    """Return the whole record that starts here."""
    return data[start : start + 9 + RECORD_HEADER.unpack_from(data, start)[1]]


def _record(data: mmap.mmap, start: int) -> Record:
    return Record(start, data[start], _bytes(data, start)[9:])


def _chunk_at(data: mmap.mmap, start: int, budget: UnpackBudget) -> Batch | None:
    """The chunk that starts here, if its lengths, its checksum and its records agree.

    What only looks like a chunk costs its bytes, too: many might overlap.
    """
    if start + HEADER.size + 8 > len(data):
        return None
    _, length, _, _, _, _, name = HEADER.unpack_from(data, start)
    if length < 40 + name or start + 9 + length > len(data):
        return None
    (size,) = struct.unpack_from("<Q", data, start + HEADER.size + name)
    if length != 40 + name + size:
        return None
    budget.reached(start + 9 + length)
    budget.take(length)
    try:
        return chunk_batch(_record(data, start), budget)
    except UnpackError:
        raise
    except ValueError:
        return None


def _between(data: mmap.mmap, position: int, end: int, intact: _IntactRecords) -> None:
    """Take the records between two chunks; behind the first that makes no sense, nothing there is trusted."""
    while position < end:
        opcode, length = RECORD_HEADER.unpack_from(data, position) if position + 9 <= end else (0, 0)
        if opcode not in KNOWN or opcode == Opcode.CHUNK or position + 9 + length > end:
            break
        if opcode == Opcode.MESSAGE:
            intact.loose.append(position)
        elif opcode not in UNREAD:
            intact.between.append((position, opcode))
        position += 9 + length
    intact.gaps.append(end - position)


def _summary(data: mmap.mmap, intact: _IntactRecords, trusted: bool, result: Recovery) -> None:
    """Definitions and counts from outside the chunks, where a checksum or an undamaged file vouches for them."""
    start = 0 if trusted else _verified_summary(data, intact)
    outside, inside = Definitions(), intact.definitions
    for position, opcode in intact.between:
        with suppress(*PARSE_ERRORS):
            if position >= start and opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                outside.add(walk(_bytes(data, position)))
            elif position >= start and opcode == Opcode.STATISTICS:
                stream = ReadDataStream(BytesIO(_record(data, position).body))
                result.expected = Statistics.read(stream).message_count
    inside.schemas = outside.schemas | inside.schemas
    inside.channels = outside.channels | inside.channels


def _verified_summary(data: mmap.mmap, intact: _IntactRecords) -> int:
    """Return the start of the summary, if its checksum is there and right; else the end of the file."""
    last, opcode = intact.between[-1] if intact.between else (0, 0)
    if opcode != Opcode.FOOTER or RECORD_HEADER.unpack_from(data, last)[1] != FOOTER.size:
        return len(data)
    start, _, expected = FOOTER.unpack_from(data, last + RECORD_HEADER.size)
    if not 0 < start <= last or expected != zlib.crc32(data[start : last + 25]):
        return len(data)
    return start


def _loose(intact: _IntactRecords, trusted: bool, result: Recovery) -> Sequence[int]:
    """Return the positions of the messages outside chunks, if they can be trusted."""
    if intact.loose and not trusted:
        result.notes.append(f"{len(intact.loose)} messages outside chunks are left out: they cannot be verified")
        return ()
    if intact.loose:
        result.notes.append(f"{len(intact.loose)} messages outside chunks have no checksum of their own")
    return intact.loose


def _metadata(
    data: mmap.mmap, intact: _IntactRecords, trusted: bool, result: Recovery
) -> Iterator[tuple[str, dict[str, str]]]:
    for position, opcode in intact.between:
        if opcode != Opcode.METADATA:
            continue
        record = _record(data, position)
        try:
            name, facts = metadata(record)
        except PARSE_ERRORS:
            result.notes.append("a damaged metadata record is left out")
            continue
        if is_sealed(record) or trusted:
            yield name, facts
        else:
            result.notes.append(f"metadata '{name}' is left out: it cannot be verified")


def _registered(writer: Writer, definitions: Definitions) -> dict[int, int]:
    """Announce every channel whose schema is there; returns their new numbers by the old."""
    schemas = {0: 0}
    for number, schema in definitions.schemas.items():
        schemas[number] = writer.register_schema(schema.name, schema.encoding, schema.data)
    return {
        number: writer.register_channel(
            channel.topic, channel.message_encoding, schemas[channel.schema_id], channel.metadata
        )
        for number, channel in definitions.channels.items()
        if channel.schema_id in schemas
    }
