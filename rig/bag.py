"""Runs on disk: ROS 2 MCAP files, read into arrays and written from arrays.

``read`` takes any MCAP that holds a WrenchStamped and an Imu topic in CDR, whoever wrote it. Every checksum that the
file has is verified. ``write`` makes files that ROS 2, Foxglove, PlotJuggler and Rerun open.
"""

import heapq
import os
from collections.abc import Iterator
from operator import itemgetter
from pathlib import Path

import numpy as np
from mcap.records import Channel
from numpy.typing import NDArray

from rig import cdr, decode, schemas
from rig.channels import ImuChannel, Recording, WrenchChannel
from rig.container import Batch, Definitions, Scanner, batches, damage, seal
from rig.errors import RigError
from rig.files import replacing
from rig.writer import Compression, new_writer, register

PathLike = str | os.PathLike[str]
BLOCK = 4096  # rows that are Python numbers at a time while writing

# The doubles of a message that a channel keeps.
KEPT = {schemas.WRENCH: ("force", "torque"), schemas.IMU: ("angular_velocity", "linear_acceleration")}
TYPES = {WrenchChannel: schemas.WRENCH, ImuChannel: schemas.IMU}


def read(path: PathLike, *, wrench: str | None = None, imu: str | None = None) -> Recording:
    """Read a run's wrench and IMU topics.

    Args:
        path: an MCAP file.
        wrench: the topic of type geometry_msgs/msg/WrenchStamped; None takes the only one of that type.
        imu: the topic of type sensor_msgs/msg/Imu; None takes the only one of that type.

    Returns:
        The channels in the order of ``log_time`` (messages of equal time as in the file), the metadata records by name
        and the file's SHA-256.

    Raises:
        RigError: the file is no MCAP, cut or damaged; a topic is missing, empty, not unique or of another type.
        OSError: the file cannot be opened.
    """
    contents = load(path, only={schemas.WRENCH: wrench, schemas.IMU: imu})
    wrench_topic = contents.choose(schemas.WRENCH, wrench)
    imu_topic = contents.choose(schemas.IMU, imu)
    return Recording(
        path=Path(path),
        sha256=contents.sha256,
        metadata=contents.metadata,
        wrench=contents.wrench(wrench_topic),
        imu=contents.imu(imu_topic),
    )


class _Pieces:
    """The messages of one topic as they come, chunk by chunk."""

    def __init__(self, type_name: str) -> None:
        self.type_name = type_name
        self.frames: set[str] = set()
        self.names = ("log_time", "stamp", "sequence", *KEPT[type_name])
        self.pieces: dict[str, list[NDArray]] = {name: [] for name in self.names}

    def add(self, data: bytes, offsets: list[int]) -> None:
        groups = decode.messages(data, offsets, self.type_name)
        order = np.argsort(np.concatenate([where for where, _ in groups]))
        self.frames |= {decode.frame_id(group) for _, group in groups}
        for name in self.names:
            values = np.concatenate([_column(group, name) for _, group in groups])
            self.pieces[name].append(values if len(groups) == 1 else values[order])

    def arrays(self) -> dict[str, NDArray]:
        """Every column of the topic in the order of ``log_time``; the pieces are given up one by one."""
        joined = {name: np.concatenate(self.pieces.pop(name)) for name in self.names}
        log_time = joined["log_time"]
        if len(log_time) and (np.diff(log_time) < 0).any():
            order = np.argsort(log_time, kind="stable")
            return {name: values[order] for name, values in joined.items()}
        return joined


def _column(group: NDArray, name: str) -> NDArray:
    if name == "stamp":
        return cdr.stamps(group)
    kinds = {"log_time": np.int64, "sequence": np.uint32}
    return group[name].astype(kinds.get(name, np.float64))


class Contents:
    """All that ``load`` found: the topics by name, the metadata and the hash."""

    def __init__(self, path: PathLike) -> None:
        self.path = path
        self.sha256 = ""
        self.definitions = Definitions({}, {}, {})
        self.topics: dict[str, _Pieces] = {}

    @property
    def metadata(self) -> dict[str, dict[str, str]]:
        """The metadata records by name."""
        return self.definitions.metadata

    def add(self, batch: Batch, only: dict[str, str | None]) -> None:
        """Take the messages of one chunk that are of a type in ``only``, from the named topic or from every one."""
        for channel_id, offsets in batch.offsets.items():
            if channel_id not in self.definitions.channels:
                raise ValueError(f"messages of channel {channel_id}, which is not defined")
            channel = self.definitions.channels[channel_id]
            type_name = self.type_of(channel)
            if type_name in only and only[type_name] in (None, channel.topic):
                self.topics.setdefault(channel.topic, _Pieces(type_name)).add(batch.data, offsets)

    def type_of(self, channel: Channel) -> str:
        """The message type of a channel, or what is wrong with its encoding."""
        schema = self.definitions.schemas.get(channel.schema_id)
        name = "no type" if schema is None else schemas.canonical(schema.name)
        return name if channel.message_encoding == "cdr" else f"{name} in encoding {channel.message_encoding!r}"

    def choose(self, type_name: str, topic: str | None) -> str:
        """The topic of this name, or the only one of this type. Raises ``RigError`` when there is none or several."""
        types = {channel.topic: self.type_of(channel) for channel in self.definitions.channels.values()}
        candidates = sorted(name for name in types if types[name] == type_name)
        if topic is not None and topic not in types:
            raise RigError(f"no topic {topic} in {self.path}: choose one of {_listed(candidates)} ({type_name})")
        if topic is not None and types[topic] != type_name:
            raise RigError(
                f"topic {topic} in {self.path} is {types[topic]}, not {type_name}: choose one of {_listed(candidates)}"
            )
        filled = [name for name in candidates if name in self.topics]
        if topic is None and len(filled) > 1:
            raise RigError(f"several {type_name} topics in {self.path}: name one of {_listed(filled)}")
        if not candidates:
            raise RigError(f"no {type_name} topic in {self.path}: it has {_listed(sorted(types))}")
        chosen = topic or (filled or candidates)[0]
        if chosen not in self.topics:
            raise RigError(f"topic {chosen} in {self.path} has no messages: record the run again")
        return chosen

    def wrench(self, topic: str) -> WrenchChannel:
        """This topic as arrays."""
        column = self._arrays(topic)
        return WrenchChannel(
            topic=topic,
            frame_id=self._frame(topic),
            log_time=column["log_time"],
            stamp=column["stamp"],
            force=column["force"],
            moment=column["torque"],
            sequence=column["sequence"],
        )

    def imu(self, topic: str) -> ImuChannel:
        """This topic as arrays."""
        column = self._arrays(topic)
        return ImuChannel(
            topic=topic,
            frame_id=self._frame(topic),
            log_time=column["log_time"],
            stamp=column["stamp"],
            angular_velocity=column["angular_velocity"],
            linear_acceleration=column["linear_acceleration"],
            sequence=column["sequence"],
        )

    def _arrays(self, topic: str) -> dict[str, NDArray]:
        return self.topics[topic].arrays()

    def _frame(self, topic: str) -> str:
        frames = sorted(self.topics[topic].frames)
        if len(frames) > 1:
            raise RigError(f"topic {topic} in {self.path} names several frames ({_listed(frames)}): split the run")
        return frames[0]


def _listed(names: list[str]) -> str:
    return ", ".join(names) if names else "none"


def load(path: PathLike, *, only: dict[str, str | None] | None = None) -> Contents:
    """Read all wrench and IMU topics of a file in one pass, a chunk at a time.

    Args:
        path: an MCAP file.
        only: per message type the one topic to take, or None for all.

    Raises:
        RigError: the file is no MCAP, cut or damaged.
        OSError: the file cannot be opened.
    """
    contents = Contents(path)
    wanted = dict.fromkeys(KEPT) if only is None else only
    with open(path, "rb") as stream:
        scanner = Scanner(path, stream)
        for batch in batches(scanner, contents.definitions):
            try:
                contents.add(batch, wanted)
            except ValueError as error:
                raise damage(path, scanner.position, str(error)) from error
        contents.sha256 = scanner.sha256
    return contents


def write(
    path: PathLike,
    *,
    wrench: WrenchChannel | None = None,
    imu: ImuChannel | None = None,
    metadata: dict[str, dict[str, str]] | None = None,
    compression: Compression = "zstd",
    overwrite: bool = False,
) -> None:
    """Write a run. It appears under its name only when it is complete.

    Args:
        path: where to write.
        wrench: a wrench topic [N, N·m], or None. In our runs force and moment ON THE BODY at Q, body frame.
        imu: an IMU topic [rad/s, m/s²], or None.
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
        ids = [register(writer, TYPES[type(channel)], channel.topic) for channel in channels]
        streams = [_messages(channel, number) for channel, number in zip(channels, ids, strict=True)]
        for log_time, number, data, stamp, sequence in heapq.merge(*streams, key=itemgetter(0)):
            writer.add_message(number, log_time, data, stamp, sequence)
        writer.finish()


def _columns(channel: WrenchChannel | ImuChannel) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    if isinstance(channel, WrenchChannel):
        return channel.force, channel.moment
    return channel.angular_velocity, channel.linear_acceleration


def _check_lengths(channel: WrenchChannel | ImuChannel) -> None:
    n = len(channel.log_time)
    left, right = _columns(channel)
    if left.shape != (n, 3) or right.shape != (n, 3) or channel.stamp.shape != (n,):
        raise RigError(f"arrays of topic {channel.topic} differ in length: give n times, n stamps and (n, 3) values")


def _messages(channel: WrenchChannel | ImuChannel, number: int) -> Iterator[tuple[int, int, bytes, int, int]]:
    """(log_time, channel number, data, stamp, sequence) of every message, in the order of the arrays."""
    encode = (cdr.WrenchEncoder if isinstance(channel, WrenchChannel) else cdr.ImuEncoder)(channel.frame_id)
    n = len(channel.log_time)
    counter = np.arange(n) if channel.sequence is None else channel.sequence
    for start in range(0, n, BLOCK):
        block = slice(start, start + BLOCK)
        values = np.concatenate([column[block] for column in _columns(channel)], axis=1)
        columns = channel.log_time[block], channel.stamp[block], counter[block], values
        for log_time, stamp, sequence, row in zip(*(column.tolist() for column in columns), strict=True):
            yield log_time, number, encode(stamp, *row), stamp, sequence
