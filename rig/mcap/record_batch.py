"""The records in a chunk's bytes: where its messages are, and what it defines."""

import struct
from dataclasses import dataclass
from io import BytesIO

from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Channel, Schema

MESSAGE_HEAD = 22
"""Bytes of a message's record before its data: channel, sequence, two times."""
MOST_DEFINITIONS = 2**16
"""Records in one chunk that are no messages; ids of schemas and channels have 16 bits."""
PARSE_ERRORS = (McapError, struct.error, ValueError, EOFError, OverflowError, MemoryError)


@dataclass
class Batch:
    """The records of one chunk: its bytes, and per channel the offsets of its messages, in file order.

    ``others`` counts the records that are no messages.
    """

    data: bytes
    offsets: dict[int, list[int]]
    schemas: list[Schema]
    channels: list[Channel]
    others: int = 0


_MESSAGE_START = struct.Struct("<BQH").unpack_from
HEAD = 11
"""Bytes at a message's start that say what follows: opcode, length, channel."""
LONGEST = 32
"""Messages of a cycle at most."""


def walk(data: bytes) -> Batch:
    """Find the records in a chunk's bytes. Raises ``ValueError`` when they do not fill it exactly."""
    batch = Batch(data, {}, [], [])
    offsets = batch.offsets
    position, end = 0, len(data)
    cycle: list[int] = []  # where the last messages begin, until one is like the first of them
    wait = tries = 1
    try:
        while position < end:
            opcode, length, channel = _MESSAGE_START(data, position)
            if opcode == 5:
                if length < MESSAGE_HEAD:
                    raise ValueError("a chunk's records are damaged")
                if cycle and data.startswith(data[cycle[0] : cycle[0] + HEAD], position):
                    size, wait = position - cycle[0], wait - 1
                    rounds = 1 if wait else _rounds(data, cycle, size)
                    if rounds > 1:
                        _add_rounds(batch, cycle, size, rounds)
                    position, cycle = cycle[0] + rounds * size, []
                    wait, tries = (wait, tries) if wait else (1, 1) if rounds > 1 else (2 * tries, 2 * tries)
                    if rounds > 1:
                        continue
                if len(cycle) == LONGEST:
                    cycle = []
                cycle.append(position)
                if channel in offsets:
                    offsets[channel].append(position)
                else:
                    offsets[channel] = [position]
            else:
                cycle = []
                _definition(batch, opcode, data[position + 9 : position + 9 + length])
            position += 9 + length
    except PARSE_ERRORS as error:
        raise ValueError("a chunk's records are damaged") from error
    if position != end:
        raise ValueError("a chunk's last record is cut")
    return batch


def _add_rounds(batch: Batch, cycle: list[int], size: int, rounds: int) -> None:
    """Add the messages of all rounds after the first."""
    places: dict[int, list[int]] = {}
    for place in cycle:
        places.setdefault(_MESSAGE_START(batch.data, place)[2], []).append(place)
    for channel, first in places.items():
        if len(first) == 1:
            batch.offsets[channel] += range(first[0] + size, first[0] + rounds * size, size)
        else:
            batch.offsets[channel] += [place + number * size for number in range(1, rounds) for place in first]


def _rounds(data: bytes, cycle: list[int], size: int) -> int:
    """Return the number of times that a cycle of messages follows itself, itself included.

    To step from each to the next takes most of the time of reading; so it is done only where a cycle ends.
    """
    import numpy as np  # a recording begins without it

    cycles = np.frombuffer(data, np.uint8, (len(data) - cycle[0]) // size * size, cycle[0]).reshape(-1, size)
    heads = np.add.outer(np.array(cycle) - cycle[0], np.arange(HEAD)).ravel()
    same = (cycles[:, heads] == cycles[0, heads]).all(axis=1)
    return len(same) if same.all() else int(np.argmin(same))


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
