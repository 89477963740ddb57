"""Recordings as other tools write them: rosbags' writers, or an MCAP writer with messages of another encoding."""

import numpy as np
from mcap.writer import Writer as McapWriter
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import CompressionFormat, StoragePlugin
from rosbags.rosbag2 import Writer as RosbagWriter
from rosbags.typesys import Stores, get_typestore

from rig.channels import WrenchChannel

STORE = get_typestore(Stores.ROS2_HUMBLE)
ROS1 = get_typestore(Stores.ROS1_NOETIC)


def header(store, stamp, frame, counter=0):
    time = store.types["builtin_interfaces/msg/Time"](*divmod(int(stamp), 10**9))
    kind = store.types["std_msgs/msg/Header"]
    return kind(counter, time, frame) if store is ROS1 else kind(time, frame)


def vector(store, values):
    return store.types["geometry_msgs/msg/Vector3"](*map(float, values))


def wrench(store, force, moment):
    return store.types["geometry_msgs/msg/Wrench"](vector(store, force), vector(store, moment))


def channel_messages(channel, store=STORE):
    """(log time, topic, type, message) of a wrench or IMU channel."""
    for k, time in enumerate(channel.log_time.tolist()):
        head = header(store, channel.stamp[k], channel.frame_id, k)
        if isinstance(channel, WrenchChannel):
            kind = "geometry_msgs/msg/WrenchStamped"
            message = store.types[kind](head, wrench(store, channel.force[k], channel.moment[k]))
        else:
            kind, nine = "sensor_msgs/msg/Imu", np.zeros(9)
            quaternion = store.types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
            rate, force = vector(store, channel.angular_velocity[k]), vector(store, channel.linear_acceleration[k])
            message = store.types[kind](head, quaternion, nine, rate, nine, force, nine)
        yield time, channel.topic, kind, message


def merged(*channels, store=STORE):
    """The messages of several channels in the order of their times."""
    items = [item for channel in channels for item in channel_messages(channel, store)]
    return sorted(items, key=lambda item: item[0])


def write_rosbag2(path, items, *, plugin=StoragePlugin.MCAP, mode=None, little_endian=True):
    """A rosbag2 folder; ``mode`` compresses it with zstd, as a whole (file) or each message."""
    writer = RosbagWriter(path, version=9, storage_plugin=plugin)
    if mode is not None:
        writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        connections = {}
        for time, topic, kind, message in items:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=STORE)
            data = STORE.serialize_cdr(message, kind, little_endian=little_endian)
            writer.write(connections[topic], int(time), data)


def write_ros1(path, items, *, compression=None):
    """A ROS 1 bag."""
    writer = Ros1Writer(path)
    if compression is not None:
        writer.set_compression(compression)
    with writer:
        connections = {}
        for time, topic, kind, message in items:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=ROS1)
            writer.write(connections[topic], int(time), ROS1.serialize_ros1(message, kind))


def write_mcap(path, items, *, encoding, schema_encoding, encode, name=lambda kind: kind, schema=b"", **options):
    """An MCAP file whose messages are ``encode(message, kind)``; ``options`` are the writer's."""
    with open(path, "wb") as stream:
        writer = McapWriter(stream, **options)
        writer.start()
        channels = {}
        for time, topic, kind, message in items:
            if topic not in channels:
                number = writer.register_schema(name(kind), schema_encoding, schema)
                channels[topic] = writer.register_channel(topic, encoding, number)
            writer.add_message(channels[topic], int(time), encode(message, kind), int(time))
        writer.finish()
