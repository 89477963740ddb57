"""Cut and damaged files: never a wrong number, every intact chunk, always a line that says what was lost."""

import os

import numpy as np
import pytest
from mcap.opcode import Opcode

from rig import runs
from rig.exceptions import RigError
from rig.mcap.records import Scanner, chunk_batch
from rig.mcap.recover import _extents, recover
from rig.read_limits import UnpackBudget
from tests.helpers.saved_runs import METADATA, rows, written


def chunk_spans(path):
    """(first byte, byte behind, its rows' times) of every chunk."""
    with open(path, "rb") as stream:
        for record in Scanner(path, stream):
            if record.opcode == Opcode.CHUNK:
                yield record.position, record.position + 9 + len(record.body), record


def saved(path, output):
    """The rows of the recovered file, or nothing where nothing could be saved."""
    output.unlink(missing_ok=True)
    try:
        result = recover(path, output)
    except RigError:
        assert not output.exists()
        return {}, None
    assert "\n" not in str(result)
    got = rows(output)
    assert len(got) == result.messages
    return got, result


def rows_of_chunk(record):
    return sum(len(offsets) for offsets in chunk_batch(record, UnpackBudget("")).offsets.values())


def test_an_intact_file_comes_back_whole(tmp_path):
    whole = written(tmp_path / "run.mcap")
    got, result = saved(tmp_path / "run.mcap", tmp_path / "new.mcap")
    assert got == whole
    assert result.intact
    assert runs.load(tmp_path / "new.mcap").metadata["rig.run"] == METADATA["rig.run"]
    assert "nothing was lost" in str(result)


@pytest.mark.parametrize("step", [19 * 47, pytest.param(19, marks=pytest.mark.study)])
def test_every_cut_gives_every_whole_chunk(tmp_path, step):
    """A file of 400 messages cut at every 19th byte; by default at every 47th of those places."""
    path, broken, output = tmp_path / "run.mcap", tmp_path / "broken.mcap", tmp_path / "new.mcap"
    whole = written(path)
    data = path.read_bytes()
    ends = [(end, rows_of_chunk(record)) for _, end, record in chunk_spans(path)]
    assert len(ends) > 20
    for size in range(0, len(data), step):
        broken.write_bytes(data[:size])
        got, result = saved(broken, output)
        assert got.items() <= whole.items()
        assert len(got) == sum(count for end, count in ends if end <= size)
        assert result is None or not result.intact


@pytest.mark.parametrize("compression", ["zstd", "lz4", "none"])
@pytest.mark.parametrize("flips", [20, pytest.param(1000, marks=pytest.mark.study)])
def test_no_flipped_bit_gives_a_wrong_number(tmp_path, compression, flips):
    path, broken, output = tmp_path / "run.mcap", tmp_path / "broken.mcap", tmp_path / "new.mcap"
    whole = written(path, compression)
    data = path.read_bytes()
    spans = [(start, end, rows_of_chunk(record)) for start, end, record in chunk_spans(path)]
    draw = np.random.default_rng(5)
    for position in draw.integers(len(data), size=flips).tolist():
        damaged = bytearray(data)
        damaged[position] ^= 1 << int(draw.integers(8))
        broken.write_bytes(damaged)
        got, result = saved(broken, output)
        assert got.items() <= whole.items()
        assert len(got) >= sum(count for start, end, count in spans if not start <= position < end)
        assert not result.intact
        assert not result.cut
        metadata = runs.load(output).metadata
        assert metadata.get("rig.run", METADATA["rig.run"]) == METADATA["rig.run"]


@pytest.mark.parametrize("length", [2**62, 2**64 - 1])
def test_an_absurd_length_inside_a_chunk_is_damage(tmp_path, length):
    path = tmp_path / "run.mcap"
    whole = written(path)
    (start, end, record), *_ = chunk_spans(path)
    data = bytearray(path.read_bytes())
    at = start + 9 + 8 + 8 + 8 + 4 + 4 + len("zstd")
    data[at : at + 8] = length.to_bytes(8, "little")
    path.write_bytes(data)
    with pytest.raises(RigError, match="inertia recover"):
        runs.read(path)
    got, result = saved(path, tmp_path / "new.mcap")
    assert got.items() <= whole.items()
    assert len(got) == len(whole) - rows_of_chunk(record)
    assert result.lost_bytes >= end - start


# Windows has no such call: there every byte is searched, which takes minutes of a terabyte
@pytest.mark.skipif(not hasattr(os, "SEEK_DATA"), reason="this system cannot tell the holes of a file")
def test_holes_of_a_sparse_file_are_not_read(tmp_path):
    """A recording with a terabyte of nothing behind it, and in the midst of it: only what is on disk is searched."""
    whole = written(tmp_path / "run.mcap")
    data = (tmp_path / "run.mcap").read_bytes()
    with open(tmp_path / "sparse.mcap", "wb") as stream:
        stream.write(data)
        stream.seek(2**39)
        stream.write(data)
        stream.truncate(2**40)
    with open(tmp_path / "sparse.mcap", "rb") as stream:
        extents = list(_extents(stream.fileno(), 2**40))
    assert sum(end - start for start, end in extents) < 4 * len(data) + 2**18
    result = recover(tmp_path / "sparse.mcap", tmp_path / "new.mcap")
    assert result.messages == 2 * len(whole)
