"""Runs on disk: our own, ROS 2's and rosbags' readers and writers agree; bad files end in one clear line."""

import hashlib
import struct
from dataclasses import fields, is_dataclass

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import CompressionType, IndexType, Writer
from mcap_ros2.decoder import DecoderFactory
from mcap_ros2.writer import Writer as Ros2Writer
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Reader as RosbagReader
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as RosbagWriter
from rosbags.typesys import Stores, get_typestore

from rig import runs
from rig.channels import Recording
from rig.exceptions import RigError
from rig.mcap import cdr, message_definitions
from rig.mcap.writer import _SpooledIndexes, new_writer, register
from tests.helpers.rig_samples import IMU_COLUMNS, SHARED, WRENCH_COLUMNS, assert_same, imu_channel, wrench_channel

METADATA = {"rig.run": {"note": "a test", "wrench": "on the body at Q"}}


@pytest.mark.parametrize("compression", ["zstd", "lz4", "none"])
@pytest.mark.parametrize("frame", ["", "b", "body_12", "body_123", "a longer name of a frame"])
def test_what_is_written_is_read(tmp_path, compression, frame):
    path = tmp_path / "run.mcap"
    wrench, imu = wrench_channel(frame=frame), imu_channel(77, frame=frame)
    runs.write(path, wrench=wrench, imu=imu, metadata=METADATA, compression=compression)
    got = runs.read(path)
    assert isinstance(got, Recording)
    assert_same(got.wrench, wrench, WRENCH_COLUMNS)
    assert_same(got.imu, imu, IMU_COLUMNS)
    assert got.metadata == METADATA
    assert got.sha256 == hashlib.sha256(path.read_bytes()).hexdigest()
    assert [p.name for p in tmp_path.iterdir()] == ["run.mcap"]


def decoded(path):
    with open(path, "rb") as stream:
        for item in make_reader(
            stream, validate_crcs=True, decoder_factories=[DecoderFactory()]
        ).iter_decoded_messages():
            yield item.channel.topic, item.message, item.decoded_message


def test_mcap_ros2_support_reads_what_we_write(tmp_path):
    wrench, imu = wrench_channel(), imu_channel()
    runs.write(tmp_path / "run.mcap", wrench=wrench, imu=imu, metadata={})
    rows = {"/wrench": [], "/imu": []}
    for topic, record, message in decoded(tmp_path / "run.mcap"):
        stamp = message.header.stamp.sec * 10**9 + message.header.stamp.nanosec
        if topic == "/wrench":
            values = (message.wrench.force, message.wrench.torque)
        else:
            assert message.orientation_covariance[0] == -1
            values = (message.angular_velocity, message.linear_acceleration)
        numbers = [getattr(v, axis) for v in values for axis in "xyz"]
        rows[topic].append([record.log_time, stamp, record.sequence, message.header.frame_id, *numbers])
    for channel, columns in ((wrench, WRENCH_COLUMNS), (imu, IMU_COLUMNS)):
        got = rows[channel.topic]
        assert {row[3] for row in got} == {channel.frame_id}
        for i, name in enumerate(columns[:3]):
            assert [row[i] for row in got] == getattr(channel, name).tolist()
        numbers = np.array([row[4:] for row in got])
        np.testing.assert_array_equal(numbers[:, :3], getattr(channel, columns[3]))
        np.testing.assert_array_equal(numbers[:, 3:], getattr(channel, columns[4]))


def test_rosbags_reads_what_we_write(tmp_path):
    wrench, imu = wrench_channel(), imu_channel()
    runs.write(tmp_path / "run.mcap", wrench=wrench, imu=imu, metadata={})
    store = get_typestore(Stores.ROS2_HUMBLE)
    forces, rates, times = [], [], []
    with AnyReader([tmp_path / "run.mcap"], default_typestore=store) as reader:
        for connection, time, raw in reader.messages():
            message = reader.deserialize(raw, connection.msgtype)
            if connection.topic == "/wrench":
                times.append(time)
                forces.append([message.wrench.force.x, message.wrench.force.y, message.wrench.force.z])
            else:
                rate = message.angular_velocity
                rates.append([rate.x, rate.y, rate.z])
    np.testing.assert_array_equal(times, wrench.log_time)
    np.testing.assert_array_equal(forces, wrench.force)
    np.testing.assert_array_equal(rates, imu.angular_velocity)


def rosbags_message(store, channel, row):
    types = store.types
    seconds, nanoseconds = divmod(int(channel.stamp[row]), 10**9)
    header = types["std_msgs/msg/Header"](types["builtin_interfaces/msg/Time"](seconds, nanoseconds), channel.frame_id)
    vector = types["geometry_msgs/msg/Vector3"]
    if channel.topic == "/wrench":
        wrench = types["geometry_msgs/msg/Wrench"](vector(*channel.force[row]), vector(*channel.moment[row]))
        return types[message_definitions.WRENCH](header, wrench)
    nine = np.zeros(9)
    quaternion = types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
    rate, force = vector(*channel.angular_velocity[row]), vector(*channel.linear_acceleration[row])
    return types[message_definitions.IMU](header, quaternion, nine, rate, nine, force, nine)


def plain(message):
    """A rosbags message as dictionaries and lists, which mcap-ros2-support writes."""
    if is_dataclass(message):
        return {field.name: plain(getattr(message, field.name)) for field in fields(message)}
    return message.tolist() if isinstance(message, np.ndarray) else message


@pytest.mark.parametrize("little_endian", [True, False])
def test_runs_written_by_rosbags_are_read(tmp_path, little_endian):
    wrench, imu = wrench_channel(), imu_channel()
    store = get_typestore(Stores.ROS2_HUMBLE)
    with RosbagWriter(tmp_path / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        for channel, kind in ((wrench, message_definitions.WRENCH), (imu, message_definitions.IMU)):
            connection = writer.add_connection(channel.topic, kind, typestore=store)
            for row, time in enumerate(channel.log_time):
                data = store.serialize_cdr(rosbags_message(store, channel, row), kind, little_endian=little_endian)
                writer.write(connection, int(time), data)
    (path,) = (tmp_path / "bag").glob("*.mcap")
    with RosbagReader(tmp_path / "bag") as reader:
        assert reader.message_count == 400
    got = runs.read(path)
    assert_same(got.wrench, wrench, [c for c in WRENCH_COLUMNS if c != "sequence"])
    assert_same(got.imu, imu, [c for c in IMU_COLUMNS if c != "sequence"])


def test_runs_written_by_mcap_ros2_support_are_read(tmp_path):
    wrench, imu = wrench_channel(), imu_channel(frame="")
    store = get_typestore(Stores.ROS2_HUMBLE)
    with open(tmp_path / "run.mcap", "wb") as stream:
        writer = Ros2Writer(stream)
        for channel, kind in ((imu, message_definitions.IMU), (wrench, message_definitions.WRENCH)):
            schema = writer.register_msgdef(kind, message_definitions.DEFINITIONS[kind])
            for row, time in enumerate(channel.log_time.tolist()):
                message = plain(rosbags_message(store, channel, row))
                writer.write_message(channel.topic, schema, message, time, time, sequence=int(channel.sequence[row]))
        writer.finish()
    got = runs.read(tmp_path / "run.mcap")
    assert_same(got.wrench, wrench, WRENCH_COLUMNS)
    assert_same(got.imu, imu, IMU_COLUMNS)


@pytest.mark.skipif(not (SHARED / "throws").is_dir(), reason="the sample data is not here")
def test_the_sample_throws_are_read_as_by_mcap_ros2_support():
    path = SHARED / "throws" / "a_00.mcap"
    got = runs.read(path)
    moments = [[m.wrench.torque.x, m.wrench.torque.y, m.wrench.torque.z] for t, _, m in decoded(path) if t == "/wrench"]
    assert got.imu.angular_velocity.shape == (2061, 3)
    np.testing.assert_array_equal(got.wrench.moment, moments)


def test_frames_of_changing_length_and_order_are_sorted_by_time(tmp_path):
    """Messages of different layouts in one chunk, out of order: the slow path gives every one its own row."""
    values, times = np.random.default_rng(3).normal(size=(50, 6)), np.random.default_rng(4).permutation(50)
    with open(tmp_path / "run.mcap", "wb") as stream:
        writer = new_writer(stream)
        number = register(writer, message_definitions.WRENCH, "/wrench")
        imu = register(writer, message_definitions.IMU, "/imu")
        writer.add_message(imu, 0, cdr.encoder(message_definitions.IMU, "x")(0, [0.0] * 6), 0)
        little = cdr.encoder(message_definitions.WRENCH, "f")
        for row, time in enumerate(times.tolist()):
            data = little(time, values[row])
            if row % 2:
                big = struct.pack(">4siII2s2x6d", b"\0\0\0\0", 0, time, 2, b"f\0", *values[row])
                data = big
            writer.add_message(number, time, data, time)
        writer.finish()
    got = runs.read(tmp_path / "run.mcap").wrench
    assert got.log_time.tolist() == got.stamp.tolist() == list(range(50))
    order = np.argsort(times)
    np.testing.assert_array_equal(np.hstack([got.force, got.moment]), values[order])


@pytest.mark.parametrize("chunked", [True, False])
def test_files_without_index_or_chunks_are_read(tmp_path, chunked):
    wrench, imu = wrench_channel(), imu_channel()
    with open(tmp_path / "run.mcap", "wb") as stream:
        writer = Writer(
            stream, use_chunking=chunked, index_types=IndexType.NONE, chunk_size=500, compression=CompressionType.NONE
        )
        writer.start()
        for channel, kind in ((wrench, message_definitions.WRENCH), (imu, message_definitions.IMU)):
            number = register(writer, kind, channel.topic)
            for time, _, data, stamp, sequence in runs._messages(channel, number):
                writer.add_message(number, time, data, stamp, sequence)
        writer.finish()
    got = runs.read(tmp_path / "run.mcap")
    assert_same(got.wrench, wrench, WRENCH_COLUMNS)
    assert_same(got.imu, imu, IMU_COLUMNS)


def test_topics_are_chosen_by_name_or_by_type(tmp_path):
    first = wrench_channel(seed=5)
    other = wrench_channel(seed=6, topic="/other")
    imu = imu_channel()
    with open(tmp_path / "run.mcap", "wb") as stream:
        writer = new_writer(stream)
        for channel, kind in (
            (first, message_definitions.WRENCH),
            (other, message_definitions.WRENCH),
            (imu, message_definitions.IMU),
        ):
            number = register(writer, kind, channel.topic)
            for time, _, data, stamp, sequence in runs._messages(channel, number):
                writer.add_message(number, time, data, stamp, sequence)
        register(writer, message_definitions.WRENCH, "/empty")
        writer.finish()
    path = tmp_path / "run.mcap"
    assert_same(runs.read(path, wrench="/other").wrench, other, WRENCH_COLUMNS)
    assert_same(runs.read(path, wrench="/wrench", imu="/imu").wrench, first, WRENCH_COLUMNS)
    for named, words in [
        ({}, r"several .*name one of /other, /wrench \(\[recording\], wrench_topic\)"),
        ({"wrench": "/none"}, "no topic /none .*choose one of /empty, /other, /wrench"),
        ({"wrench": "/imu"}, "is sensor_msgs/msg/Imu, not .*choose one of"),
        ({"wrench": "/empty"}, "no messages"),
    ]:
        with pytest.raises(RigError, match=words) as error:
            runs.read(path, **named)
        assert "\n" not in str(error.value)


def test_a_run_without_imu_names_what_it_has(tmp_path):
    runs.write(tmp_path / "run.mcap", wrench=wrench_channel(), metadata={})
    with pytest.raises(RigError, match=r"no sensor_msgs/msg/Imu topic in .*it has /wrench"):
        runs.read(tmp_path / "run.mcap")


def test_another_encoding_is_refused(tmp_path):
    with open(tmp_path / "run.mcap", "wb") as stream:
        writer = new_writer(stream)
        schema = writer.register_schema(message_definitions.WRENCH, "", b"")
        number = writer.register_channel("/wrench", "cbor", schema)
        writer.add_message(number, 0, b"{}", 0)
        writer.finish()
    with pytest.raises(RigError, match="in encoding 'cbor', which"):
        runs.read(tmp_path / "run.mcap", wrench="/wrench")


@pytest.mark.parametrize("data", [b"", b"\0\1\0\0", b"\0\7\0\0" + bytes(80), b"\0\1\0\0" + b"\xff" * 80])
def test_a_message_that_is_no_wrench_is_refused(tmp_path, data):
    with open(tmp_path / "run.mcap", "wb") as stream:
        writer = new_writer(stream)
        writer.add_message(register(writer, message_definitions.WRENCH, "/wrench"), 0, data, 0)
        writer.finish()
    with pytest.raises(RigError):
        runs.read(tmp_path / "run.mcap")


@pytest.mark.parametrize("content", [b"", b"hello", b"t,F,M\n" * 100])
def test_something_else_is_not_an_mcap(tmp_path, content):
    (tmp_path / "run.mcap").write_bytes(content)
    with pytest.raises(RigError, match="not an MCAP file"):
        runs.read(tmp_path / "run.mcap")


def test_every_cut_is_noticed_and_recover_is_named(tmp_path):
    path = tmp_path / "run.mcap"
    runs.write(path, wrench=wrench_channel(), imu=imu_channel(), metadata=METADATA)
    whole = path.read_bytes()
    for size in range(8, len(whole), 211):
        path.write_bytes(whole[:size])
        with pytest.raises(RigError, match="inertia recover"):
            runs.read(path)


@pytest.mark.parametrize("compression", ["zstd", "lz4", "none"])
def test_no_flipped_bit_goes_unnoticed(tmp_path, compression):
    """Our files end with a checksum over everything: 150 flips anywhere in the data section are all refused."""
    path = tmp_path / "run.mcap"
    runs.write(path, wrench=wrench_channel(30), imu=imu_channel(30), metadata=METADATA, compression=compression)
    whole = path.read_bytes()
    draw = np.random.default_rng(8)
    for position in draw.integers(8, len(whole) - 8, 150):
        damaged = bytearray(whole)
        damaged[position] ^= 1 << draw.integers(8)
        path.write_bytes(damaged)
        with pytest.raises(RigError):
            runs.read(path)


def test_the_index_of_the_chunks_is_whole_and_small(tmp_path):
    """The writer keeps it on disk: a recording of days must not fill the memory. Foreign readers seek by it."""
    with open(tmp_path / "run.mcap", "wb") as stream:
        writer = new_writer(stream)
        number = register(writer, message_definitions.WRENCH, "/wrench")
        encode = cdr.encoder(message_definitions.WRENCH, "body")
        for time in range(1000):
            writer.add_message(number, time, encode(time, [0.0] * 6), time)
            writer.flush()
        kept = writer._Writer__chunk_indices
        assert isinstance(kept, _SpooledIndexes)
        assert kept._file._rolled
        writer.finish()
    with open(tmp_path / "run.mcap", "rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        assert len(reader.get_summary().chunk_indexes) == 1000
        assert next(reader.iter_messages(starting_at=100))[2].log_time == 100


def test_an_existing_file_is_kept(tmp_path):
    path = tmp_path / "run.mcap"
    path.write_bytes(b"precious")
    with pytest.raises(RigError, match="output exists"):
        runs.write(path, wrench=wrench_channel(), metadata={})
    assert path.read_bytes() == b"precious"
    runs.write(path, wrench=wrench_channel(), metadata={}, overwrite=True)
    assert path.read_bytes() != b"precious"


def test_a_failed_write_leaves_nothing(tmp_path):
    broken = wrench_channel()
    object.__setattr__(broken, "moment", broken.moment[:-1])
    with pytest.raises(RigError, match="differ in length"):
        runs.write(tmp_path / "run.mcap", wrench=broken, metadata={})
    with pytest.raises(RigError, match="no folder"):
        runs.write(tmp_path / "missing" / "run.mcap", wrench=wrench_channel(), metadata={})
    assert list(tmp_path.iterdir()) == []
