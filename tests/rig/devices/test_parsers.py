"""Every parser on split, dirtied and damaged streams: it never raises, finds the frames again, counts every byte."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from rig.devices import create_device, device_class, kinds
from rig.devices.parser import Sample

KINDS = [kind for kind in kinds() if device_class(kind).NETWORK != "udp"]  # no stream: a datagram is whole
COLUMNS = ["time us", *[f"{name} rad/s" for name in ("omega_x", "omega_y", "omega_z")]]
COLUMNS += [f"specific_force_{axis} m/s^2" for axis in "xyz"]


def device(kind):
    options = {"columns": COLUMNS, "separator": ",", "whole_lines": True} if kind == "line" else {}
    return create_device(kind, **options)


def frames(kind, count, seed=1):
    """``count`` different frames of a device, as separate byte strings."""
    draw = np.random.default_rng(seed)
    source = device(kind)
    emulator = source.emulator(rate=1000.0)
    values = draw.normal(scale=3.0, size=(count, sum(len(channel.signals) for channel in source.channels)))
    return [emulator.frame(i, i / 1000, tuple(row)) for i, row in enumerate(values.tolist())]


def decode(kind, pieces):
    parser = device(kind).parser()
    samples = [sample for piece in pieces for sample in parser.feed(piece)]
    samples += parser.finish()
    counts = parser.counts
    assert counts.bytes == sum(map(len, pieces)) == counts.framed + counts.skipped
    assert counts.samples == len(samples)
    return samples, counts


def cut(data, cuts):
    edges = sorted({min(c, len(data)) for c in cuts} | {0, len(data)})
    return [data[a:b] for a, b in pairwise(edges)]


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=60, deadline=None)
@given(cuts=st.lists(st.integers(0, 2000), max_size=40), garbage=st.binary(max_size=60), place=st.integers(0, 900))
def test_any_split_gives_the_same_samples(kind, cuts, garbage, place):
    stream = b"".join(frames(kind, 12))
    stream = stream[:place] + garbage + stream[place:]
    whole, counts = decode(kind, [stream])
    pieces, others = decode(kind, cut(stream, cuts))
    assert pieces == whole
    assert (others.skipped, others.framed, others.frames) == (counts.skipped, counts.framed, counts.frames)


@pytest.mark.parametrize("kind", KINDS)
def test_byte_by_byte_is_the_same(kind):
    stream = b"".join(frames(kind, 20))
    whole, counts = decode(kind, [stream])
    assert len(whole) == 20
    assert counts.skipped == counts.failures == counts.missing == 0
    assert decode(kind, cut(stream, range(len(stream))))[0] == whole


def values(samples: list[Sample]) -> list[tuple[float, ...]]:
    return [sample.values for sample in samples]


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=60, deadline=None)
@given(data=st.data())
def test_after_damage_at_most_two_frames_are_missed(kind, data):
    """Garbage, dropped bytes or a flipped bit somewhere in frame 10: all before and all from frame 12 come through."""
    parts = frames(kind, 24)
    good = values(decode(kind, [b"".join(parts)])[0])
    damage = data.draw(st.sampled_from(["insert", "drop", "flip"]))
    place = data.draw(st.integers(0, len(parts[10]) - 1))
    if damage == "insert":
        parts[10] = parts[10][:place] + data.draw(st.binary(min_size=1, max_size=40)) + parts[10][place:]
    elif damage == "drop":
        parts[10] = parts[10][:place] + parts[10][place + data.draw(st.integers(1, 40)) :]
    else:
        flipped = bytearray(parts[10])
        flipped[place] ^= 1 << data.draw(st.integers(0, 7))
        parts[10] = bytes(flipped)
    got = values(decode(kind, [b"".join(parts)])[0])
    assert got[:10] == good[:10]
    assert got[-12:] == good[-12:]
    assert len(got) <= 24 + (kind in WEAK)


WEAK = {
    "line",
    "ur-rtde",
    "robotous",
    "xsens",
    "microstrain",
    "vectornav-ascii",
}  # no CRC: a chance of a false frame remains


@pytest.mark.parametrize("kind", KINDS)
@settings(max_examples=60, deadline=None)
@given(garbage=st.binary(max_size=3000))
def test_garbage_never_raises(kind, garbage):
    decode(kind, [garbage])


@pytest.mark.parametrize("kind", KINDS)
def test_garbage_that_looks_like_starts_never_raises(kind):
    starts = [b"\xaa", b"\x55", b"\xfa\xff\x36\xff\x07\xff", b"\x75\x65\x80\xff", b"\xfa\x01\x21\x01", b"$VNYMR,"]
    draw = np.random.default_rng(4)
    for _ in range(200):
        picks = draw.integers(len(starts), size=30)
        decode(kind, [b"".join(starts[i] + draw.bytes(int(draw.integers(12))) for i in picks)])


def flip(stream_frames, draw, bits):
    """Each frame with one or two of its bits flipped."""
    for frame in stream_frames:
        number = int.from_bytes(frame, "big")
        for bit in draw.choice(8 * len(frame), size=bits, replace=False).tolist():
            number ^= 1 << bit
        yield number.to_bytes(len(frame), "big")


def wrong_samples(kind, count, bits):
    """How many samples of ``count`` frames with flipped bits (each beside an intact one) are not of an intact frame."""
    draw = np.random.default_rng(bits)
    wrong, done = 0, 0
    while done < count:
        good = frames(kind, min(2000, count - done), seed=done)
        parser = device(kind).parser()
        intact = set(values(decode(kind, [b"".join(good)])[0]))
        mixed = b"".join(a + b for a, b in zip(flip(good, draw, bits), good, strict=True))
        wrong += sum(sample.values not in intact for sample in parser.feed(mixed) + parser.finish())
        done += len(good)
    return wrong


@pytest.mark.parametrize("bits", [1, 2])
@pytest.mark.parametrize("kind", ["bota", "vectornav", "robotiq-ft"])
@pytest.mark.parametrize("count", [2000, pytest.param(100_000, marks=pytest.mark.study)])
def test_a_crc_lets_no_flipped_bit_through(kind, bits, count):
    assert wrong_samples(kind, count, bits) == 0


@pytest.mark.parametrize("kind", ["robotous", "xsens", "microstrain", "vectornav-ascii"])
@pytest.mark.parametrize("count", [1000, pytest.param(100_000, marks=pytest.mark.study)])
def test_a_weak_sum_lets_no_single_flipped_bit_through(kind, count):
    """A sum of bytes changes with every single bit; two flips can cancel (measured in ``benchmarks``)."""
    assert wrong_samples(kind, count, 1) == 0
