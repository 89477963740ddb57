"""Where the messages of a chunk are: by a loop over single records, whatever order and lengths they have."""

import struct

import numpy as np
import pytest

from rig.mcap.records import HEAD, LONGEST, walk


def message(channel, size, filler=b"\x05"):
    return struct.pack("<BQH", 5, 22 + size, channel) + filler * (20 + size)


def offsets_one_by_one(data):
    """The oracle: every record in its turn."""
    offsets, position = {}, 0
    while position < len(data):
        opcode, length, channel = struct.unpack_from("<BQH", data, position)
        if opcode == 5:
            offsets.setdefault(channel, []).append(position)
        position += 9 + length
    return offsets


A, B, LONG, ATTACHMENT = message(1, 9), message(2, 3), message(1, 40), struct.pack("<BQ", 9, 3) + b"abc"
PATTERNS = {
    "one topic": [A] * 50,
    "two in turn": [A, B] * 50,
    "two to one": [A, A, B] * 50,
    "one begins": [B, *[A] * 50],
    "another length": [A, B] * 20 + [LONG, B] + [A, B] * 20,
    "a round that is not whole": [A, B, LONG] * 20 + [A, B],
    "many topics": [message(k, k) for k in range(LONGEST + 5)] * 4,
    "as many as are looked at": [message(k, k) for k in range(LONGEST)] * 4,
    "other records between": [A, B] * 5 + [ATTACHMENT] + [A, B] * 5 + [ATTACHMENT, A],
    "hundreds of rounds, then another": [A, B] * 300 + [LONG] + [A] * 70 + [B, LONG, B] * 64,
    "nothing": [],
}


@pytest.mark.parametrize("pattern", PATTERNS.values(), ids=PATTERNS)
def test_messages_are_where_each_record_in_turn_says(pattern):
    data = b"".join(pattern)
    batch = walk(data)
    assert batch.offsets == offsets_one_by_one(data)
    assert batch.others == pattern.count(ATTACHMENT)


def test_messages_in_any_order(generator):
    kinds = [A, B, LONG, message(3, 0), ATTACHMENT]
    for _ in range(200):
        count = generator.integers(1, 6)
        runs = [[kinds[k] for k in generator.integers(0, 5, count)] * int(generator.integers(1, 12)) for _ in range(4)]
        data = b"".join(record for run in runs for record in run)
        assert walk(data).offsets == offsets_one_by_one(data)


def test_damage_within_a_repeated_cycle_is_found():
    """A length that is another in one of many equal rounds, an opcode (no message then), a last record that is cut."""
    data = b"".join([A, B] * 30)
    for place in (1, 8):
        harmed = bytearray(data)
        harmed[20 * (len(A) + len(B)) + place] ^= 0x40
        with pytest.raises(ValueError, match=r"damaged|cut"):
            walk(bytes(harmed))
    harmed = bytearray(data)
    harmed[20 * (len(A) + len(B))] ^= 0x40
    assert walk(bytes(harmed)).offsets == offsets_one_by_one(harmed)
    assert len(walk(bytes(harmed)).offsets[1]) == 29
    for lost in (1, len(B) - 1, len(B) - HEAD):
        with pytest.raises(ValueError, match=r"damaged|cut"):
            walk(data[:-lost])


def test_offsets_are_numbers_of_python():
    assert all(type(place) is int for places in walk(b"".join([A, B] * 9)).offsets.values() for place in places)
    assert np.array(walk(A * 3).offsets[1]).tolist() == [0, len(A), 2 * len(A)]
