"""Recordings in every container and encoding that is read hold the same numbers; what cannot be read says why."""

import hashlib
import json
import sqlite3
import subprocess
import sys
import tracemalloc
from dataclasses import fields, is_dataclass

import numpy as np
import pytest
import zstandard
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import CompressionMode, StoragePlugin

from rig import runs
from rig.bags import protobuf_messages
from rig.exceptions import RigError
from tests.helpers.bags import ROS1, STORE, header, merged, wrench, write_mcap, write_ros1, write_rosbag2
from tests.helpers.rig_samples import IMU_COLUMNS, WRENCH_COLUMNS, assert_same, imu_channel, wrench_channel

WRENCH, IMU = wrench_channel(), imu_channel()
MODES = CompressionMode
DESCRIPTORS = bytes.fromhex(
    "0aff010a1f676f6f676c652f70726f746f6275662f74696d657374616d702e70726f746f120f676f6f676c652e70726f746f627566223b0a"
    "0954696d657374616d7012180a077365636f6e647318012001280352077365636f6e647312140a056e616e6f7318022001280552056e616e"
    "6f734285010a13636f6d2e676f6f676c652e70726f746f627566420e54696d657374616d7050726f746f50015a32676f6f676c652e676f6c"
    "616e672e6f72672f70726f746f6275662f74797065732f6b6e6f776e2f74696d657374616d707062f80101a20203475042aa021e476f6f67"
    "6c652e50726f746f6275662e57656c6c4b6e6f776e5479706573620670726f746f330aa3030a09726f732e70726f746f1211726f732e6765"
    "6f6d657472795f6d7367731a1f676f6f676c652f70726f746f6275662f74696d657374616d702e70726f746f222a0a07566563746f723312"
    "090a017818012001280112090a017918022001280112090a017a18032001280122450a0648656164657212290a057374616d701801200128"
    "0b321a2e676f6f676c652e70726f746f6275662e54696d657374616d7012100a086672616d655f6964180220012809225f0a065772656e63"
    "6812290a05666f72636518012001280b321a2e726f732e67656f6d657472795f6d7367732e566563746f7233122a0a06746f727175651802"
    "2001280b321a2e726f732e67656f6d657472795f6d7367732e566563746f72332285010a0d5772656e63685374616d70656412290a066865"
    "6164657218012001280b32192e726f732e67656f6d657472795f6d7367732e48656164657212290a067772656e636818022001280b32192e"
    "726f732e67656f6d657472795f6d7367732e5772656e6368120f0a07636f756e746572181420012811120d0a057370617265181520032802"
    "620670726f746f33"
)
"""ros.geometry_msgs.WrenchStamped, its stamp a google.protobuf.Timestamp, as Google's library serialises it."""
MESSAGE = bytes.fromhex(
    "0a0d0a05080c10d902120463656c6c121f0a1209000000000000f83f1900000000008022c0120911000000000000c03fa0010daa01080000803f"
    "00002040"
)


def check(path, *, sequence=False, stamp_of=lambda channel: channel.stamp):
    got = runs.read(path)
    for one, other, columns in ((got.wrench, WRENCH, WRENCH_COLUMNS), (got.imu, IMU, IMU_COLUMNS)):
        assert_same(one, other, [name for name in columns if sequence or name != "sequence"])
    return got


def plain(message):
    if is_dataclass(message):
        return {f.name: plain(getattr(message, f.name)) for f in fields(message)}
    return message.tolist() if isinstance(message, np.ndarray) else message


@pytest.mark.parametrize("plugin", list(StoragePlugin))
@pytest.mark.parametrize("mode", [None, MODES.FILE, MODES.MESSAGE, MODES.STORAGE])
@pytest.mark.parametrize("little_endian", [True, False])
def test_a_rosbag2_folder_is_a_run(tmp_path, plugin, mode, little_endian):
    if mode == MODES.STORAGE and plugin == StoragePlugin.SQLITE3:
        pytest.skip("MCAP only")
    write_rosbag2(tmp_path / "bag", merged(WRENCH, IMU), plugin=plugin, mode=mode, little_endian=little_endian)
    before = {file: file.read_bytes() for file in (tmp_path / "bag").iterdir()}
    check(tmp_path / "bag")
    assert {file: file.read_bytes() for file in (tmp_path / "bag").iterdir()} == before


@pytest.mark.parametrize("plugin", list(StoragePlugin))
def test_a_file_of_a_folder_is_a_run(tmp_path, plugin):
    write_rosbag2(tmp_path / "bag", merged(WRENCH, IMU), plugin=plugin)
    (file,) = (f for f in (tmp_path / "bag").iterdir() if f.suffix != ".yaml")
    assert check(file).sha256 == hashlib.sha256(file.read_bytes()).hexdigest()


def split(folder, parts=3, *, plugin=StoragePlugin.MCAP):
    """A folder whose run is split over files, written one by one, and the metadata that names them."""
    items, folder_name = merged(WRENCH, IMU), folder.name
    folder.mkdir()
    names = []
    for k, part in enumerate(np.array_split(np.arange(len(items)), parts)):
        write_rosbag2(folder / "part", [items[i] for i in part], plugin=plugin)
        (file,) = (f for f in (folder / "part").iterdir() if f.suffix != ".yaml")
        names.append(f"{folder_name}_{k}{file.suffix}")
        file.rename(folder / names[-1])
        (folder / "part" / "metadata.yaml").unlink()
        (folder / "part").rmdir()
    return names


@pytest.mark.parametrize("listed", [True, False])
@pytest.mark.parametrize("plugin", list(StoragePlugin))
def test_a_split_run_is_one_run(tmp_path, listed, plugin):
    """Twelve files: number 10 comes after number 9, by the metadata or by its number."""
    names = split(tmp_path / "bag", 12, plugin=plugin)
    if listed:
        entries = "".join(f"    - old/place/{name}\n" for name in names)
        about = f"rosbag2_bagfile_information:\n  version: 9\n  relative_file_paths:\n{entries}  duration:\n    x: 1\n"
        (tmp_path / "bag" / "metadata.yaml").write_text(about)
    got = check(tmp_path / "bag")
    digests = [hashlib.sha256((tmp_path / "bag" / name).read_bytes()).hexdigest() for name in names]
    assert got.sha256 == hashlib.sha256("".join(f"{digest}\n" for digest in digests).encode()).hexdigest()


def test_files_that_follow_in_time_are_sorted_whatever_their_order(tmp_path):
    names = split(tmp_path / "bag", 2)
    about = "relative_file_paths: [" + ", ".join(reversed(names)) + "]\n"
    (tmp_path / "bag" / "metadata.yaml").write_text(about)
    check(tmp_path / "bag")


@pytest.mark.parametrize("compression", [None, *Ros1Writer.CompressionFormat])
def test_a_ros1_bag_is_read(tmp_path, compression):
    write_ros1(tmp_path / "run.bag", merged(WRENCH, IMU, store=ROS1), compression=compression)
    check(tmp_path / "run.bag")


@pytest.mark.parametrize("kind", ["mcap", "db3", "bag"])
def test_a_compressed_file_is_read(tmp_path, kind):
    if kind == "bag":
        write_ros1(tmp_path / "run.bag", merged(WRENCH, IMU, store=ROS1))
        file = tmp_path / "run.bag"
    else:
        plugin = StoragePlugin.MCAP if kind == "mcap" else StoragePlugin.SQLITE3
        write_rosbag2(tmp_path / "bag", merged(WRENCH, IMU), plugin=plugin)
        (file,) = (tmp_path / "bag").glob(f"*.{kind}")
    data = file.read_bytes()
    packed = tmp_path / f"run.{kind}.zstd"
    half = len(data) // 2  # two frames, one after the other
    packed.write_bytes(zstandard.compress(data[:half]) + zstandard.compress(data[half:]))
    assert check(packed).sha256 == hashlib.sha256(packed.read_bytes()).hexdigest()


def test_mcap_in_ros1_encoding_is_read(tmp_path):
    items = merged(WRENCH, IMU, store=ROS1)
    encode = lambda message, kind: ROS1.serialize_ros1(message, kind)  # noqa: E731
    name = lambda kind: kind.replace("/msg/", "/")  # noqa: E731
    write_mcap(tmp_path / "r.mcap", items, encoding="ros1", schema_encoding="ros1msg", encode=encode, name=name)
    check(tmp_path / "r.mcap")


@pytest.mark.parametrize("vectors", ["objects", "lists"])
@pytest.mark.parametrize("nanoseconds", ["nanosec", "nsec"])
def test_mcap_in_json_is_read(tmp_path, vectors, nanoseconds):
    def encode(message, _):
        tree = {name: value for name, value in plain(message).items() if not name.startswith("_")}
        stamp = tree["header"]["stamp"]
        tree["header"]["stamp"] = {"sec": stamp["sec"], nanoseconds: stamp["nanosec"]}
        if vectors == "lists" and "wrench" in tree:
            tree["wrench"] = {name: [tree["wrench"][name][axis] for axis in "xyz"] for name in ("force", "torque")}
        return json.dumps(tree).encode()

    items = merged(WRENCH, IMU)
    write_mcap(tmp_path / "r.mcap", items, encoding="json", schema_encoding="jsonschema", encode=encode, schema=b"{}")
    check(tmp_path / "r.mcap")


def test_foxgloves_pose_is_a_pose(tmp_path):
    pose = {"timestamp": {"sec": 3, "nsec": 5}, "frame_id": "map",
            "pose": {"position": {"x": 1, "y": 2, "z": 3}, "orientation": {"x": 0, "y": 0.6, "z": 0, "w": 0.8}}}  # fmt: skip
    write = {"encoding": "json", "schema_encoding": "jsonschema", "schema": b"{}"}
    items = [(7, "/pose", "foxglove.PoseInFrame", pose), (8, "/f", "geometry_msgs/msg/Wrench", {})]
    encode = lambda tree, _: json.dumps(tree or plain(wrench(STORE, [1, 2, 3], [4, 5, 6]))).encode()  # noqa: E731
    write_mcap(tmp_path / "r.mcap", items, encode=encode, **write)
    got = runs.read_any(tmp_path / "r.mcap")
    assert got.motion.orientation.tolist() == [[0, 0.6, 0, 0.8]]
    assert (got.motion.frame_id, got.motion.stamp.tolist()) == ("map", [3_000_000_005])
    assert got.wrench.moment.tolist() == [[4, 5, 6]]
    assert got.wrench.stamp.tolist() == [0]  # an unstamped wrench: the log's time is all there is


def test_protobuf_is_decoded_as_googles_library_encodes_it():
    tree = protobuf_messages.decoder(DESCRIPTORS, "ros.geometry_msgs.WrenchStamped")(MESSAGE)
    assert tree["header"] == {"stamp": {"seconds": 12, "nanos": 345}, "frame_id": "cell"}
    assert tree["wrench"]["force"] == {"x": 1.5, "y": 0.0, "z": -9.25}
    assert tree["wrench"]["torque"] == {"x": 0.0, "y": 0.125, "z": 0.0}
    assert (tree["counter"], tree["spare"]) == (-7, [1.0, 2.5])


def test_any_cut_of_a_protobuf_message_is_refused_or_has_other_fields():
    decode = protobuf_messages.decoder(DESCRIPTORS, "ros.geometry_msgs.WrenchStamped")
    whole = decode(MESSAGE)
    for size in range(1, len(MESSAGE)):
        try:
            assert decode(MESSAGE[:size]) != whole
        except ValueError:
            continue


def write_protobuf(path):
    write_mcap(
        path,
        [(50, "/wrench", "ros.geometry_msgs.WrenchStamped", None), (51, "/imu", "sensor_msgs/msg/Imu", None)],
        encoding="protobuf",
        schema_encoding="protobuf",
        encode=lambda _, kind: MESSAGE,
        schema=DESCRIPTORS,
    )


def test_mcap_in_protobuf_is_read(tmp_path):
    write_protobuf(tmp_path / "r.mcap")
    with pytest.raises(RigError, match=r"topic /imu in .* its schema does not define sensor_msgs/msg/Imu"):
        runs.read(tmp_path / "r.mcap")
    wrench_of = runs.load(tmp_path / "r.mcap", only={"geometry_msgs/msg/WrenchStamped": None}).wrench("/wrench")
    assert wrench_of.stamp.tolist() == [12_000_000_345]
    assert wrench_of.force.tolist() == [[1.5, 0.0, -9.25]]
    assert wrench_of.frame_id == "cell"


def refuse(path, words):
    with pytest.raises(RigError, match=words) as error:
        runs.read(path)
    assert "\n" not in str(error.value)
    assert str(path) in str(error.value)


def test_every_cut_of_an_sqlite_bag_is_noticed(tmp_path):
    write_rosbag2(tmp_path / "bag", merged(WRENCH, IMU), plugin=StoragePlugin.SQLITE3)
    (file,) = (tmp_path / "bag").glob("*.db3")
    whole = file.read_bytes()
    for size in range(16, len(whole) - 1, 4099):
        file.write_bytes(whole[:size])
        refuse(file, "cut or damaged SQLite bag .*sqlite3")


def test_every_cut_of_a_ros1_bag_is_noticed(tmp_path):
    write_ros1(tmp_path / "run.bag", merged(WRENCH, IMU, store=ROS1))
    whole = (tmp_path / "run.bag").read_bytes()
    for size in range(13, len(whole) - 1, 2503):
        (tmp_path / "run.bag").write_bytes(whole[:size])
        refuse(tmp_path / "run.bag", "cut or damaged ROS 1 bag")


def test_every_cut_of_a_compressed_file_is_noticed(tmp_path):
    runs.write(tmp_path / "run.mcap", wrench=WRENCH, imu=IMU, metadata={})
    whole = zstandard.compress((tmp_path / "run.mcap").read_bytes())
    for size in range(4, len(whole) - 1, 997):
        (tmp_path / "run.mcap.zstd").write_bytes(whole[:size])
        refuse(tmp_path / "run.mcap.zstd", "cut or damaged")


def test_an_unfinished_sqlite_bag_is_not_read_without_its_journal(tmp_path):
    write_rosbag2(tmp_path / "bag", merged(WRENCH, IMU), plugin=StoragePlugin.SQLITE3)
    (file,) = (tmp_path / "bag").glob("*.db3")
    file.with_name(file.name + "-wal").write_bytes(b"the last messages")
    refuse(file, "unfinished SQLite bag .*-wal")


@pytest.mark.parametrize(
    ("content", "words"),
    [
        (b"\x89HDF\r\n\x1a\n", "HDF5.*inertia import"),
        (b"MATLAB 5.0 MAT-file", "MATLAB.*inertia import"),
        (b"PAR1....", "Parquet"),
        (b"TDSm\x0e\0\0\0", "TDMS.*npTDMS, then `inertia import"),
        (b"MDF     4.10    ", "MDF.*asammdf, then `inertia import"),
        (b"DEWESOFT\0\0", "DEWESoft.*inertia import"),
        (b"ULog\x01\x12\x35", "ulog2csv"),
        (b"#ROSBAG V1.2\n", "version 1"),
        (b"\x1f\x8b\x08\0", "gzip: unpack"),
        (b"PK\x03\x04", "ZIP: unpack"),
        (b"SQLite format 3\0" + bytes(84), "SQLite"),
        (b"#ROSBAG V2.0\n", "cut or damaged ROS 1 bag"),
        (b"\x28\xb5\x2f\xfd\0\0", "cut or damaged"),
        (b"", "not an MCAP"),
    ],
)
def test_what_is_found_is_named(tmp_path, content, words):
    (tmp_path / "run").write_bytes(content)
    refuse(tmp_path / "run", words)


def test_another_database_is_no_recording(tmp_path):
    with sqlite3.connect(tmp_path / "x.db3") as database:
        database.execute("CREATE TABLE music (title TEXT)")
    database.close()
    refuse(tmp_path / "x.db3", "without the tables topics and messages")


def test_a_database_with_odd_messages_is_refused(tmp_path):
    write_rosbag2(tmp_path / "bag", merged(WRENCH, IMU), plugin=StoragePlugin.SQLITE3)
    (file,) = (tmp_path / "bag").glob("*.db3")
    for column, value in (("timestamp", -5), ("timestamp", "'noon'"), ("data", "X'0001'")):
        data = file.read_bytes()
        with sqlite3.connect(file) as database:
            database.execute(f"UPDATE messages SET {column} = {value} WHERE id = 3")
        database.close()
        refuse(file, "SQLite bag")
        file.write_bytes(data)


def test_folders_that_are_no_run(tmp_path):
    folder = tmp_path / "bag"
    folder.mkdir()
    refuse(folder, "no recording in the folder")
    for name in ("run_0001.mcap", "run_0002.mcap"):  # two runs of `inertia record`, not one that is split
        runs.write(folder / name, wrench=WRENCH, imu=IMU, metadata={})
    refuse(folder, r"several runs in the folder .*name one of run_0001.mcap, run_0002.mcap")
    (folder / "metadata.yaml").write_text("relative_file_paths:\n  - run_0001.mcap\n  - gone.mcap\n")
    refuse(folder, r"no file gone.mcap in .*metadata.yaml")


@pytest.mark.parametrize("package", ["rosbags", "mcap_protobuf"])
def test_without_the_extra_its_name_is_told(tmp_path, package):
    if package == "rosbags":
        write_ros1(tmp_path / "run", merged(WRENCH, IMU, store=ROS1))
    else:
        write_protobuf(tmp_path / "run")
    code = f"import sys; sys.modules['{package}'] = None; from uq.cli.main import main; sys.exit(main(sys.argv[1:]))"
    done = subprocess.run(
        [sys.executable, "-c", code, "inspect", str(tmp_path / "run")], capture_output=True, text=True, check=False
    )
    assert done.returncode == 2
    assert "pip install inertia-uq[bags]" in done.stderr
    assert done.stderr.count("\n") == 1


@pytest.mark.parametrize(
    ("tree", "words"),
    [
        ({}, "header.stamp"),
        ({"header": {"stamp": {"sec": 1, "nsec": 2}, "frame_id": ""}}, "no field wrench.force"),
        (
            {"header": {"stamp": {"sec": 1, "nsec": 2}}, "wrench": {"force": [1, 2], "torque": [1, 2, 3]}},
            "does not have 3",
        ),
        ({"header": {"stamp": {"sec": 1, "nsec": 2}}, "wrench": {"force": [1, 2, None], "torque": [1, 2, 3]}}, "None"),
        ([], "not a JSON object"),
    ],
)
def test_json_without_the_fields_of_its_type_is_refused(tmp_path, tree, words):
    items = [(5, "/wrench", "geometry_msgs/WrenchStamped", tree)]
    encode = lambda message, _: json.dumps(message).encode()  # noqa: E731
    write_mcap(tmp_path / "r.mcap", items, encoding="json", schema_encoding="", encode=encode)
    refuse(tmp_path / "r.mcap", words)


@pytest.mark.parametrize("plugin", list(StoragePlugin))
def test_other_topics_take_no_memory(tmp_path, plugin):
    """64 MB of pictures beside the run: the peak stays below 8 MB, a chunk and what belongs to it."""
    image = STORE.types["sensor_msgs/msg/CompressedImage"]
    picture = np.random.default_rng(1).integers(0, 256, 2**18, dtype=np.uint8)
    pictures = [
        (5_000_000_000 + k, "/camera", "sensor_msgs/msg/CompressedImage", image(header(STORE, k, ""), "", picture))
        for k in range(256)
    ]
    write_rosbag2(tmp_path / "bag", sorted([*merged(WRENCH, IMU), *pictures], key=lambda one: one[0]), plugin=plugin)
    check(tmp_path / "bag")
    tracemalloc.start()
    runs.read(tmp_path / "bag")
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 8e6, peak
