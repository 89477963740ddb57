"""Bags and folders that are damaged or odd: a recording or one line, never a traceback, never without end."""

import json
import sqlite3

import numpy as np
import pytest
from mcap.writer import Writer as McapWriter
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import StoragePlugin

from rig import inspect, runs
from rig.bags.marks import read_marks
from rig.exceptions import RigError
from tests.helpers.bags import ROS1, merged, write_mcap, write_ros1, write_rosbag2
from tests.helpers.rig_samples import imu_channel, wrench_channel

WRENCH, IMU = wrench_channel(), imu_channel()


def one_line(path, words="."):
    """See that a file is refused in one line."""
    with pytest.raises(RigError, match=words) as error:
        runs.read(path)
    assert "\n" not in str(error.value)
    assert len(str(error.value).replace(str(path), "")) < 250


def sqlite_bag(folder):
    write_rosbag2(folder / "bag", merged(WRENCH, IMU), plugin=StoragePlugin.SQLITE3)
    (file,) = (folder / "bag").glob("*.db3")
    return file


@pytest.mark.parametrize(
    "change",
    [
        "UPDATE topics SET id = 70000 WHERE id = 1",
        "UPDATE topics SET id = -1 WHERE id = 1",
        "UPDATE topics SET name = NULL",
        "UPDATE topics SET name = 7.5",
        "UPDATE topics SET type = X'ff00'",
        "UPDATE topics SET type = NULL",
        "UPDATE topics SET serialization_format = NULL",
        "UPDATE topics SET type = CAST(X'ff80' AS TEXT)",
        "UPDATE messages SET topic_id = 'one'",
        "UPDATE messages SET timestamp = NULL WHERE id = 2",
        "UPDATE messages SET data = 'text' WHERE id = 2",
        "ALTER TABLE topics DROP COLUMN type",
    ],
)
def test_an_sqlite_bag_with_wrong_values_is_one_line(tmp_path, change):
    file = sqlite_bag(tmp_path)
    with sqlite3.connect(file) as database:
        database.execute("PRAGMA foreign_keys = OFF")
        for (index,) in database.execute("SELECT name FROM sqlite_master WHERE sql LIKE 'CREATE%INDEX%'").fetchall():
            database.execute(f"DROP INDEX {index}")
        columns = "id, name, type, serialization_format"  # without types and constraints, which would refuse the change
        database.execute(f"CREATE TABLE plain AS SELECT {columns} FROM topics")
        database.execute("DROP TABLE topics")
        database.execute("ALTER TABLE plain RENAME TO topics")
        database.execute("CREATE TABLE free AS SELECT * FROM messages")
        database.execute("DROP TABLE messages")
        database.execute("ALTER TABLE free RENAME TO messages")
        database.execute(change)
    database.close()
    one_line(file)


@pytest.mark.parametrize("flips", [250, pytest.param(20_000, marks=pytest.mark.study)])
def test_flipped_bytes_of_an_sqlite_bag_are_a_recording_or_one_line(tmp_path, flips):
    """SQLite has no checksums: a flipped byte may go unseen, but never ends in a traceback."""
    file = sqlite_bag(tmp_path)
    whole, draw = file.read_bytes(), np.random.default_rng(3)
    head, messages = len(whole) // 8, []
    for k in range(flips):
        data = bytearray(whole)
        for _ in range(1 + k % 20):
            data[draw.integers(16, head if k % 2 else len(data))] = draw.integers(256)
        file.write_bytes(data)
        for read in (runs.load, read_marks):
            try:
                read(file)
            except RigError as error:
                messages.append(str(error))
    assert len(messages) > flips / 2
    assert not [text for text in messages if "\n" in text]


@pytest.mark.parametrize("compression", [None, *Ros1Writer.CompressionFormat])
def test_flipped_bytes_of_a_ros1_bag_are_a_recording_or_one_line(tmp_path, compression):
    file = tmp_path / "run.bag"
    write_ros1(file, merged(WRENCH, IMU, store=ROS1), compression=compression)
    whole, draw = file.read_bytes(), np.random.default_rng(4)
    refused = 0
    for _ in range(100):
        data = bytearray(whole)
        data[draw.integers(13, len(data))] ^= 1 << int(draw.integers(8))
        file.write_bytes(data)
        try:
            runs.load(file)
        except RigError:
            refused += 1
    assert refused > 5


DEEP = b"[" * 100_000


HEADER = '"header": {"stamp": {"sec": %s, "nsec": 2}, "frame_id": ""}'


FORCES = '"wrench": {"force": [%s, 2, 3], "torque": [1, 2, 3]}'


@pytest.mark.parametrize(
    ("message", "words"),
    [
        (DEEP, "not JSON"),
        (("{" + HEADER % (2**39) + "," + FORCES % 1 + "}").encode(), "header.stamp"),
        (("{" + HEADER % 1 + "," + FORCES % ("9" * 400) + "}").encode(), "too large"),
        (("{" + HEADER % 1 + "," + FORCES % ("9" * 5000) + "}").encode(), "not JSON"),
    ],
)
def test_json_that_python_cannot_hold_is_one_line(tmp_path, message, words):
    items = [(5, "/wrench", "geometry_msgs/WrenchStamped", message)]
    write_mcap(tmp_path / "r.mcap", items, encoding="json", schema_encoding="", encode=lambda data, _: data)
    one_line(tmp_path / "r.mcap", words)


def test_joints_that_are_no_list_are_one_line(tmp_path):
    head = {"header": {"stamp": {"sec": 1, "nsec": 2}, "frame_id": ""}}
    items = [(5, "/joints", "sensor_msgs/JointState", {**head, "name": 7, "position": [], "velocity": []})]
    encode = lambda tree, _: json.dumps(tree).encode()  # noqa: E731
    write_mcap(tmp_path / "r.mcap", items, encoding="json", schema_encoding="", encode=encode)
    with pytest.raises(RigError, match="name is no list of names"):
        runs.load(tmp_path / "r.mcap", only={"sensor_msgs/msg/JointState": None})


def test_a_topic_whose_frames_change_is_one_line_that_names_the_first(tmp_path):
    head = {"stamp": {"sec": 1, "nsec": 2}}
    body = {"wrench": {"force": [1, 2, 3], "torque": [1, 2, 3]}}
    items = [
        (k, "/wrench", "geometry_msgs/WrenchStamped", {"header": {**head, "frame_id": f"f{k}"}, **body})
        for k in range(999)
    ]
    encode = lambda tree, _: json.dumps(tree).encode()  # noqa: E731
    write_mcap(tmp_path / "r.mcap", items, encoding="json", schema_encoding="", encode=encode)
    one_line(tmp_path / "r.mcap", r"several frames \(f0, f1, .* and \d+ more\): split the run")


def test_a_folder_that_names_a_file_again_and_again(tmp_path):
    runs.write(tmp_path / "run_0.mcap", wrench=WRENCH, imu=IMU)
    (tmp_path / "metadata.yaml").write_text("relative_file_paths:\n" + "  - run_0.mcap\n" * 100_000)
    one_line(tmp_path, "a file twice in .*metadata.yaml")


def test_a_metadata_file_without_end(tmp_path):
    runs.write(tmp_path / "run_0.mcap", wrench=WRENCH, imu=IMU)
    with open(tmp_path / "metadata.yaml", "wb") as stream:
        stream.truncate(2**33)  # a hole: it takes no room on the disk
    one_line(tmp_path, "too long .*metadata.yaml")


def test_what_is_missing_comes_in_the_same_order(tmp_path):
    """The order of a set changes from process to process."""
    with open(tmp_path / "empty.mcap", "wb") as stream:
        writer = McapWriter(stream)
        writer.start()
        writer.finish()
    messages = [item.text for item in inspect(tmp_path / "empty.mcap").findings]
    assert [text.split(":")[0] for text in messages] == [
        "no messages of type geometry_msgs/msg/WrenchStamped",
        "no messages of type sensor_msgs/msg/Imu",
    ]
