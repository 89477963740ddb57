"""Runs on disk, read into arrays and written from arrays.

``read`` takes any recording that holds a WrenchStamped and an Imu topic, whoever wrote it; ``read_any`` other motion
sensors too. Every checksum that the file has is verified. ``write`` makes MCAP files that ROS 2, Foxglove, PlotJuggler
and Rerun open.
"""

import heapq
import os
from collections.abc import Iterator
from operator import itemgetter
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rig.atomic_files import replacing
from rig.bags.topics import Contents, load
from rig.channels import ImuChannel, MotionChannel, Recording, WrenchChannel, halves
from rig.exceptions import RigError
from rig.mcap import cdr
from rig.mcap.message_definitions import IMU, MOTIONS, POSE, WRENCH, WRENCHES
from rig.mcap.records import seal
from rig.mcap.writer import Compression, new_writer, register

__all__ = ["Contents", "load", "read", "read_any", "write"]

PathLike = str | os.PathLike[str]
WrittenChannel = WrenchChannel | ImuChannel | MotionChannel
BLOCK = 4096  # rows that are Python numbers at a time while writing


def read(path: PathLike, *, wrench: str | None = None, imu: str | None = None) -> Recording:
    """Read a run's wrench and IMU topics.

    Args:
        path: a file or rosbag2 folder; see :mod:`rig.bags.containers` for what is read.
        wrench: the topic of type geometry_msgs/msg/WrenchStamped; None takes the only one of that type.
        imu: the topic of type sensor_msgs/msg/Imu; None takes the only one of that type.

    Returns:
        The channels in the order of ``log_time`` (messages of equal time as in the file), the metadata records by name
        and the file's SHA-256.

    Raises:
        RigError: the file is no recording, cut or damaged; a topic is missing, empty, not unique or of another type.
        OSError: the file cannot be opened.
    """
    return _read(path, wrench, imu, (WRENCH,), (IMU,))


def read_any(
    path: PathLike, *, wrench: str | None = None, motion: str | None = None, accelerometer: str | None = None
) -> Recording:
    """Read a run's wrench, stamped or not, and whatever measures its motion.

    Args:
        path: as of :func:`read`.
        wrench: the topic of type WrenchStamped or Wrench; None takes the only one of the first of these types.
        motion: the topic of type Imu, TwistStamped, Odometry, PoseStamped or JointState; None takes the only one of
            the first of these types that the run has.
        accelerometer: the Imu topic of the accelerometer, where the motion's is a gyro's alone; None: the only one
            whose angular velocity is zero throughout, beside one whose acceleration is.

    Raises:
        RigError, OSError: as :func:`read`.
    """
    contents = load(path, only=dict.fromkeys(WRENCHES, wrench) | dict.fromkeys(MOTIONS, motion) | {IMU: None})
    names = [name for name, kind in contents.types.items() if kind == IMU and name in contents.topics]
    if len(names) < 2 or (motion is not None and motion not in names):
        return _recording(contents, wrench, motion, WRENCHES, MOTIONS)
    imus = {name: contents.imu(name) for name in names}
    apart = halves([imus[name] for name in names])
    if accelerometer is not None:
        accelerometer = contents.choose(IMU, accelerometer)
    elif apart is not None and motion in (None, apart[0].topic):
        motion, accelerometer = apart[0].topic, apart[1].topic
    motion = contents.choose(IMU, motion)
    return Recording(
        path=Path(path),
        sha256=contents.sha256,
        metadata=contents.metadata,
        wrench=contents.wrench(contents.choose(WRENCHES, wrench)),
        motion=imus[motion],
        accelerometer=None if accelerometer is None else imus[accelerometer],
    )


def _read(
    path: PathLike, wrench: str | None, motion: str | None, wrenches: tuple[str, ...], motions: tuple[str, ...]
) -> Recording:
    contents = load(path, only=dict.fromkeys(wrenches, wrench) | dict.fromkeys(motions, motion))
    return _recording(contents, wrench, motion, wrenches, motions)


def _recording(
    contents: Contents, wrench: str | None, motion: str | None, wrenches: tuple[str, ...], motions: tuple[str, ...]
) -> Recording:
    wrench_topic, motion_topic = contents.choose(wrenches, wrench), contents.choose(motions, motion)
    return Recording(
        path=Path(contents.path),
        sha256=contents.sha256,
        metadata=contents.metadata,
        wrench=contents.wrench(wrench_topic),
        motion=contents.motion(motion_topic),
    )


def write(
    path: PathLike,
    *,
    wrench: WrenchChannel | None = None,
    imu: ImuChannel | MotionChannel | None = None,
    metadata: dict[str, dict[str, str]] | None = None,
    compression: Compression = "zstd",
    overwrite: bool = False,
) -> None:
    """Write a run. It appears under its name only when it is complete.

    Args:
        path: where to write.
        wrench: a wrench topic [N, N·m], or None. In our runs force and moment ON THE BODY at Q, body frame.
        imu: an IMU topic [rad/s, m/s²], or one of poses or joint states, or None.
        metadata: metadata records by name.
        compression: of the chunks.
        overwrite: replace an existing file.

    Raises:
        RigError: the file exists and ``overwrite`` is False, or the arrays of a channel differ in length.
        OSError: the file cannot be written.
    """
    channels = [channel for channel in (wrench, imu) if channel is not None]
    for channel in channels:
        _check_lengths(channel)
    with replacing(path, overwrite=overwrite) as stream:
        writer = new_writer(stream, compression=compression)
        for name, record in (metadata or {}).items():
            writer.add_metadata(name, seal(name, record))
        ids = [register(writer, message_type(channel), channel.topic) for channel in channels]
        streams = [_messages(channel, number) for channel, number in zip(channels, ids, strict=True)]
        for log_time, number, data, stamp, sequence in heapq.merge(*streams, key=itemgetter(0)):
            writer.add_message(number, log_time, data, stamp, sequence)
        writer.finish()


def message_type(channel: WrittenChannel) -> str:
    """Return the type of a channel's messages."""
    if isinstance(channel, MotionChannel):
        return channel.type
    return WRENCH if isinstance(channel, WrenchChannel) else IMU


def _columns(channel: WrittenChannel) -> tuple[NDArray[np.float64], ...]:
    if isinstance(channel, MotionChannel):
        return tuple(values for values in (channel.position, channel.orientation) if values is not None)
    if isinstance(channel, WrenchChannel):
        return channel.force, channel.moment
    rates = channel.angular_velocity, channel.linear_acceleration
    return rates if channel.orientation is None else (channel.orientation, *rates)


def _check_lengths(channel: WrittenChannel) -> None:
    vectors = not isinstance(channel, MotionChannel) and getattr(channel, "orientation", None) is None
    n, wide = len(channel.log_time), 3 if vectors else None
    if channel.stamp.shape != (n,) or any(x.shape != (n, wide or x.shape[-1]) for x in _columns(channel)):
        raise RigError(f"arrays of topic {channel.topic} differ in length: give n times, n stamps and (n, 3) values")


def _messages(channel: WrittenChannel, number: int) -> Iterator[tuple[int, int, bytes, int, int]]:
    """(log_time, channel number, data, stamp, sequence) of every message, in the order of the arrays."""
    kind, names = message_type(channel), getattr(channel, "names", ())
    oriented = kind == IMU and getattr(channel, "orientation", None) is not None
    placed = kind == POSE and getattr(channel, "position", None) is not None
    encode = cdr.encoder(kind, channel.frame_id, names, oriented=oriented, placed=placed)
    n = len(channel.log_time)
    counter = np.arange(n) if channel.sequence is None else channel.sequence
    for start in range(0, n, BLOCK):
        block = slice(start, start + BLOCK)
        values = np.concatenate([column[block] for column in _columns(channel)], axis=1)
        columns = channel.log_time[block], channel.stamp[block], counter[block], values
        for log_time, stamp, sequence, row in zip(*(column.tolist() for column in columns), strict=True):
            yield log_time, number, encode(stamp, row), stamp, sequence
