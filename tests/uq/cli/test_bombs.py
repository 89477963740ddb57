"""Files that claim or hold far more than they are long: one line, in little memory, from every command.

Every command runs in a process of its own, which may map 2 GiB and must not touch 0.7 GiB. A file of zeros unpacks to
a thousand times its length with zstd and to 250 times with LZ4; what the tests pack is never in memory as a whole.
"""

import os
import resource
import sqlite3
import subprocess
import sys
from functools import cache

import lz4.frame
import numpy as np
import pytest
import zstandard
from mcap.opcode import Opcode
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from rosbags.rosbag1 import Writer as Ros1Writer

from rig import runs
from rig.bags.marks import read_marks
from rig.exceptions import RigError
from rig.mcap.records import MAGIC, RECORD_HEADER, Scanner
from rig.mcap.recover import HEADER
from rig.read_limits import VARIABLE, UnpackError
from tests.helpers.bags import ROS1
from tests.helpers.rig_samples import imu_channel, wrench_channel

GIB = 2**30
MOST = 0.7 * GIB
WRENCH_TYPE = "geometry_msgs/msg/WrenchStamped"


@cache
def packed_zeros(size, *, kind="zstd", stated=True):
    """A record of an unused kind with zeros, together so many bytes, compressed a piece at a time."""
    piece = bytes(2**23)
    head = RECORD_HEADER.pack(0x80, size - RECORD_HEADER.size)
    pieces = [head + piece[len(head) :], *[piece] * (size // len(piece) - 1)]
    if kind == "zstd":
        pack = zstandard.ZstdCompressor(write_content_size=stated).compressobj(size if stated else -1)
        return b"".join([*map(pack.compress, pieces), pack.flush()])
    with lz4.frame.LZ4FrameCompressor() as pack:
        return b"".join([pack.begin(), *map(pack.compress, pieces), pack.flush()])


def record(opcode, body):
    return RECORD_HEADER.pack(opcode, len(body)) + body


def chunk(data, size, kind, crc=0):
    """A chunk's record that claims ``size`` bytes."""
    head = HEADER.pack(Opcode.CHUNK, 40 + len(kind) + len(data), 0, 1, size, crc, len(kind))
    return head + kind.encode() + len(data).to_bytes(8, "little") + data


def mcap(path, *records):
    """An MCAP file of these records, ended as it should be."""
    end = record(Opcode.DATA_END, bytes(4)) + record(Opcode.FOOTER, bytes(20))
    path.write_bytes(MAGIC + record(Opcode.HEADER, bytes(8)) + b"".join(records) + end + MAGIC)
    return path


def messages(path, data, count):
    """An MCAP file with so many messages, each compressed by itself as rosbag2 does, in compressed chunks."""
    with open(path, "wb") as stream:
        writer = McapWriter(stream, compression=CompressionType.ZSTD, chunk_size=2**22)
        writer.start()
        number = writer.register_channel("/wrench", "cdr", writer.register_schema(WRENCH_TYPE, "ros2msg", b""))
        for k in range(count):
            writer.add_message(number, k, data, k)
        writer.finish()
    return path


COMMAND = """
import re, sys
from uq.cli.main import main
try:
    status = main(sys.argv[1:])
except SystemExit as end:
    status = end.code
print(re.search(r"VmHWM:\\s*(\\d+)", open("/proc/self/status").read())[1])
raise SystemExit(status)
"""
"""Prints last the most memory that it had [KiB]: what `wait4` says may be the parent's, from before it was replaced."""


def run(*arguments, **environment):
    """Run a command; its status, its lines of error, and the most memory that it had [bytes]."""
    process = subprocess.Popen(
        [sys.executable, "-c", COMMAND, *map(str, arguments)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        env={**os.environ, **environment},
    )
    resource.prlimit(process.pid, resource.RLIMIT_AS, (2 * GIB, 2 * GIB))
    printed, lines = process.communicate()
    assert printed, lines
    return process.returncode, lines.splitlines(), int(printed.split()[-1]) * 1024


def refused(words, *arguments):
    """See that a command ends with one line that holds these words, in little memory."""
    status, lines, memory = run(*arguments)
    assert status == 2, lines
    assert len(lines) == 1
    assert words in lines[0]
    assert memory < MOST, memory


CHUNKS = {
    "an LZ4 chunk that claims 100 bytes": lambda: [chunk(packed_zeros(GIB, kind="lz4"), 100, "lz4")],
    "a zstd chunk that claims 100 bytes": lambda: [chunk(packed_zeros(GIB, stated=False), 100, "zstd")],
    "twenty true LZ4 chunks": lambda: [chunk(packed_zeros(GIB, kind="lz4"), GIB, "lz4")] * 20,
    "twenty true zstd chunks": lambda: [chunk(packed_zeros(GIB), GIB, "zstd")] * 20,
    "twenty true zstd chunks without their size": lambda: [chunk(packed_zeros(GIB, stated=False), GIB, "zstd")] * 20,
    "chunks within the largest piece": lambda: [chunk(packed_zeros(2**26), 2**26, "zstd")] * 20,
}


@pytest.mark.parametrize("name", CHUNKS)
def test_chunks_that_hold_a_gigabyte(tmp_path, name):
    path = mcap(tmp_path / "bomb.mcap", *CHUNKS[name]())
    claims = "claims" in name
    refused("a chunk's length is wrong" if claims else f"set {VARIABLE}=4", "inspect", path)
    refused("nothing to recover" if claims else f"set {VARIABLE}=4", "recover", path, "-o", tmp_path / "new.mcap")
    assert not (tmp_path / "new.mcap").exists()
    with pytest.raises(RigError):
        read_marks(path)


def test_forty_messages_of_a_gigabyte(tmp_path):
    path = messages(tmp_path / "bomb.mcap", packed_zeros(GIB), 40)
    refused("a message of 1073741824 bytes", "inspect", path)


def test_thousands_of_messages_of_a_megabyte(tmp_path):
    path = messages(tmp_path / "bomb.mcap", zstandard.compress(bytes(2**20)), 4000)
    assert path.stat().st_size < 100_000
    refused("too much to unpack", "inspect", path)


@pytest.mark.parametrize("stated", [True, False])
def test_a_compressed_file_of_four_gigabytes(tmp_path, stated, monkeypatch):
    head = mcap(tmp_path / "small.mcap").read_bytes()
    pack = zstandard.ZstdCompressor(write_content_size=False)
    (tmp_path / "bomb.mcap.zst").write_bytes(pack.compress(head) + packed_zeros(4 * GIB, stated=stated))
    assert (tmp_path / "bomb.mcap.zst").stat().st_size < 140_000
    refused("too much to unpack", "inspect", tmp_path / "bomb.mcap.zst")


def test_frames_that_hold_nothing_are_counted_too(tmp_path):
    (tmp_path / "bomb.zst").write_bytes(zstandard.compress(b"") * 300_000)
    refused("too much to unpack", "inspect", tmp_path / "bomb.zst")


def test_zstd_within_zstd(tmp_path):
    data = mcap(tmp_path / "small.mcap").read_bytes()
    for _ in range(1500):
        data = zstandard.compress(data)
    (tmp_path / "bomb.zst").write_bytes(data)
    refused("zstd within zstd", "inspect", tmp_path / "bomb.zst")


def test_a_chunk_of_nothing_but_channels(tmp_path):
    """Each record of twenty bytes becomes objects of a kilobyte."""
    body = bytes(2) + bytes(2) + bytes(4) + bytes(4) + bytes(4)
    data = record(Opcode.CHANNEL, body) * 50_000
    path = mcap(tmp_path / "bomb.mcap", *[chunk(zstandard.compress(data), len(data), "zstd")] * 20)
    refused("too much to unpack", "inspect", path)


@pytest.mark.parametrize(("opcode", "words"), [(0, "no record has the opcode 0"), (0x81, "too much to unpack")])
def test_records_of_nothing(tmp_path, opcode, words):
    """Nine bytes each; to step through 100 MB of them would take a minute."""
    path = tmp_path / "nothing.mcap"
    path.write_bytes(MAGIC + RECORD_HEADER.pack(opcode, 0) * 100_000)
    with open(path, "rb") as stream:
        scanner = Scanner(path, stream)
        with pytest.raises(RigError, match=words):
            list(scanner)
        assert scanner.position < 300_000


def test_a_chunk_of_short_records_of_an_unused_kind(tmp_path):
    data = record(0x80, bytes(2)) * (2**26 // 12)
    path = mcap(tmp_path / "bomb.mcap", chunk(zstandard.compress(data), len(data), "zstd"))
    refused("a chunk's records are damaged", "inspect", path)


def test_json_counts_twice(tmp_path):
    """Its numbers become objects one by one: 60 MiB in one compressed chunk are too much."""
    text = b'{"header":{"stamp":{"sec":1,"nsec":2}},"wrench":{"force":[1,2,3],"torque":[1,2,3]}}' + b" " * 2000
    with open(tmp_path / "bomb.mcap", "wb") as stream:
        writer = McapWriter(stream, compression=CompressionType.ZSTD, chunk_size=2**27)
        writer.start()
        number = writer.register_channel("/wrench", "json", writer.register_schema(WRENCH_TYPE, "", b""))
        for _ in range(60 * 2**20 // len(text)):
            writer.add_message(number, 5, text, 5)
        writer.finish()
    refused("too much to unpack", "inspect", tmp_path / "bomb.mcap")


def test_chunks_that_overlap_cost_their_bytes(tmp_path):
    """Every 53 bytes a chunk that would reach to the end of the file: recovery must not read it a thousand times."""
    count, step = 20_000, HEADER.size + 12
    data = bytearray((chunk(b"", 10**9, "zstd")) * count)
    for start in range(0, len(data), step):
        rest = len(data) - start
        data[start + 1 : start + 9] = (rest - 9).to_bytes(8, "little")
        data[start + HEADER.size + 4 : start + step] = (rest - step).to_bytes(8, "little")
    (tmp_path / "bomb.mcap").write_bytes(MAGIC + data)
    refused("too much to unpack", "recover", tmp_path / "bomb.mcap", "-o", tmp_path / "new.mcap")


def database(path, *, messages_table, rows=1):
    with sqlite3.connect(path) as base:
        base.execute("CREATE TABLE topics (id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT)")
        base.execute(
            f"INSERT INTO topics VALUES (1, '/wrench', '{WRENCH_TYPE}', 'cdr'), (2, '/other', 'x/msg/Y', 'cdr')"
        )
        base.execute(messages_table)
        base.executemany("INSERT INTO messages (topic_id, timestamp) VALUES (?, ?)", [(1 + (rows > 1), 5)] * rows)
    base.close()
    return path


def test_a_generated_column_of_an_sqlite_bag(tmp_path):
    table = (
        "CREATE TABLE messages (id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, "
        "data BLOB GENERATED ALWAYS AS (zeroblob(900000000)) VIRTUAL)"
    )
    refused("is computed, not stored", "inspect", database(tmp_path / "bomb.db3", messages_table=table))


def test_a_long_message_of_an_sqlite_bag(tmp_path):
    table = (
        "CREATE TABLE messages (id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, "
        "data BLOB DEFAULT (zeroblob(2000000)))"
    )
    refused("a message of 2000000 bytes", "inspect", database(tmp_path / "bomb.db3", messages_table=table))


def test_pages_of_an_sqlite_bag_that_branch_without_end(tmp_path):
    """Four levels whose hundreds of children are all the same page of the next: ten thousand million rows."""
    table = "CREATE TABLE messages (id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, data BLOB)"
    path = database(tmp_path / "bomb.db3", messages_table=table, rows=80_000)
    data, size = bytearray(path.read_bytes()), 4096
    (root,) = sqlite3.connect(path).execute("SELECT rootpage FROM sqlite_master WHERE name = 'messages'").fetchone()
    page = data[(root - 1) * size : root * size]
    assert page[0] == 5  # an interior page
    cells = [int.from_bytes(page[12 + 2 * k : 14 + 2 * k], "big") for k in range(int.from_bytes(page[3:5], "big"))]
    assert len(cells) > 200
    levels = [root, *range(len(data) // size - 4, len(data) // size)]
    leaf = next(k for k in range(root + 1, len(data) // size) if data[(k - 1) * size] == 13 and k not in levels)
    for number, child in zip(levels, [*levels[1:], leaf], strict=True):
        copy = bytearray(page)
        for at in (8, *cells):
            copy[at : at + 4] = child.to_bytes(4, "big")
        data[(number - 1) * size : number * size] = copy
    path.write_bytes(data)
    refused("cut or damaged SQLite bag", "inspect", path)


@pytest.mark.parametrize("compression", list(Ros1Writer.CompressionFormat))
def test_chunks_of_a_ros1_bag(tmp_path, compression):
    """Two hundred chunks of a megabyte of zeros."""
    writer = Ros1Writer(tmp_path / "bomb.bag")
    writer.set_compression(compression)
    with writer:
        connection = writer.add_connection("/wrench", WRENCH_TYPE, typestore=ROS1)
        for k in range(200):
            writer.write(connection, k, bytes(2**20 - 100))
    assert (tmp_path / "bomb.bag").stat().st_size < 2**20
    refused("too much to unpack", "inspect", tmp_path / "bomb.bag")


def test_a_large_attachment_is_passed_over_and_the_limit_can_be_raised(tmp_path):
    """80 MiB of zeros beside a run, compressed as a whole: read when the user trusts the file."""
    runs.write(tmp_path / "run.mcap", wrench=wrench_channel(), imu=imu_channel())
    with open(tmp_path / "run.mcap", "rb") as stream:
        records = [record(item.opcode, item.body) for item in Scanner("", stream) if item.opcode != Opcode.DATA_END]
    body = [records[1], record(Opcode.ATTACHMENT, bytes(80 * 2**20)), *records[2:6]]
    path = tmp_path / "run.mcap.zst"
    path.write_bytes(zstandard.compress(mcap(tmp_path / "large.mcap", *body).read_bytes()))
    refused("too much to unpack", "inspect", path)
    assert run("inspect", path, **{VARIABLE: "0.2"})[0] in (0, 1)
    status, lines, _ = run("inspect", path, **{VARIABLE: "much"})
    assert (status, len(lines)) == (2, 1)
    assert f"{VARIABLE} is no number of GiB" in lines[0]


def test_a_large_record_that_must_be_held_is_refused(tmp_path):
    path = mcap(tmp_path / "bomb.mcap")
    with open(path, "r+b") as stream:  # a hole: the file takes no room on the disk
        stream.seek(len(MAGIC))
        stream.write(RECORD_HEADER.pack(Opcode.MESSAGE, 2**28))
        stream.truncate(2**29)
    refused("too much to unpack", "inspect", path)


def test_a_sound_run_unpacks_to_a_tenth_of_its_limit(tmp_path):
    """At rest and without noise; numbers that change unpack to less."""
    still = np.zeros((20_000, 3))
    wrench, imu = wrench_channel(len(still)), imu_channel(len(still))
    wrench.force[:], wrench.moment[:], imu.angular_velocity[:], imu.linear_acceleration[:] = 0, 0, 0, 0
    runs.write(tmp_path / "run.mcap", wrench=wrench, imu=imu)
    from rig.bags.containers import container_file
    from rig.mcap.records import Definitions

    file = container_file(tmp_path / "run.mcap")
    assert sum(1 for _ in file.batches(Definitions({}, {}, {}), set()))
    assert file.budget.unpacked < 20 * file.budget.read


def test_what_is_unpacked_inside_earns_nothing(tmp_path):
    """A compressed file of compressed chunks has one budget: a hundred times its length and not ten thousand times."""
    inner = mcap(tmp_path / "inner.mcap", *[chunk(packed_zeros(2**23), 2**23, "zstd")] * 9)
    (tmp_path / "bomb.zst").write_bytes(zstandard.compress(inner.read_bytes()))
    with pytest.raises(UnpackError):
        runs.load(tmp_path / "bomb.zst")
