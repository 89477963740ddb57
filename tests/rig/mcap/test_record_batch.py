"""Where the messages of a chunk are, whatever order and lengths they have."""

import struct

import numpy as np
import pytest

from rig.mcap.records import walk


def message(channel, size, filler=b"\x05"):
    return struct.pack("<BQH", 5, 22 + size, channel) + filler * (20 + size)


A, B, LONG, ATTACHMENT = message(1, 9), message(2, 3), message(1, 40), struct.pack("<BQ", 9, 3) + b"abc"


def test_messages_in_any_order(generator):
    """Where records begin is the sum of the lengths before; other records than messages are counted."""
    kinds = {A: 1, B: 2, LONG: 1, message(3, 0): 3, ATTACHMENT: None}
    records = [list(kinds)[k] for k in generator.integers(0, len(kinds), 300)]
    places = np.cumsum([0, *map(len, records)])[:-1].tolist()
    batch = walk(b"".join(records))
    for channel in (1, 2, 3):
        assert batch.offsets[channel].tolist() == [
            place for place, record in zip(places, records, strict=True) if kinds[record] == channel
        ]
    assert batch.others == records.count(ATTACHMENT)
    assert walk(b"").offsets == {}


def test_messages_in_turn_are_verified(generator):
    """A pattern of two sensors' messages that breaks off, is resumed, and stands between definitions."""
    turn = [A, B, A, LONG, A]
    records = [*turn * 50, B, B, ATTACHMENT, *turn * 9, LONG, *turn * 30, *[A] * 100, B]
    places = np.cumsum([0, *map(len, records)])[:-1]
    batch = walk(b"".join(records))
    assert batch.others == 1
    for channel, messages in ((1, (A, LONG)), (2, (B,))):
        assert batch.offsets[channel].tolist() == places[[record in messages for record in records]].tolist()


def test_damage_is_found():
    """A length that is another, an opcode (no message then), a last record that is cut."""
    data = b"".join([A, B] * 30)
    for place in (1, 8):
        harmed = bytearray(data)
        harmed[20 * (len(A) + len(B)) + place] ^= 0x40
        with pytest.raises(ValueError, match=r"damaged|cut"):
            walk(bytes(harmed))
    harmed = bytearray(data)
    harmed[20 * (len(A) + len(B))] ^= 0x40
    assert [len(places) for places in walk(bytes(harmed)).offsets.values()] == [29, 30]
    for lost in (1, len(B) - 1, len(B) - 11):
        with pytest.raises(ValueError, match=r"damaged|cut"):
            walk(data[:-lost])
