"""The topics of a recording as arrays: force, moment and motion; its metadata; its hash."""

import os
from collections.abc import Mapping
from typing import Any

import numpy as np
from mcap.records import Channel
from numpy.typing import NDArray

from rig.bags import json_messages
from rig.bags.containers import recording_files, recording_sha256
from rig.bags.message_packing import FULL, ContainerFile, pieces
from rig.channels import ImuChannel, MotionChannel, WrenchChannel
from rig.exceptions import RigError, listed, quoted
from rig.mcap import cdr, message_definitions
from rig.mcap.cdr import ENCODINGS, DecodedMessages
from rig.mcap.message_definitions import IMU, JOINTS, WRENCH, WRENCHES
from rig.mcap.records import MESSAGE, Batch, Definitions, joined
from rig.read_limits import UnpackBudget, parse_json

PathLike = str | os.PathLike[str]
Topics = Mapping[str, str | None]
"""The one topic to take of each message type, or None for all of the type."""

SET_BACK = 100_000_000
"""Step back of a topic's log times [ns] beyond which a clock was set back: a recorder writes a topic as it comes."""
NEEDS_WRIST = "this needs a wrist sensor: torques of joints are not used"
"""Words for a recording without a wrench."""
CHANGES = "the number of its values changes from message to message: split the run"
MOST_PUBLISHERS = 20
"""Sets of joints that the messages of one topic name: arm, gripper, base, head."""


class GrowingColumn:
    """Rows of one column as they come: lists of chunks, concatenated at the end, would hold every value twice."""

    def __init__(self, first: NDArray) -> None:
        self._rows, self.count = np.empty((0, *first.shape[1:]), first.dtype), 0

    def extend(self, rows: NDArray) -> None:
        """Append rows to the column. Raises ``RigError`` where they are of another width."""
        width, stop = self._rows.shape[1:], self.count + len(rows)
        if rows.shape[1:] != width:
            raise RigError(CHANGES)
        if stop > len(self._rows):  # in place: a large block of memory moves without a copy
            self._rows.resize((stop + stop // 4, *width), refcheck=False)
        self._rows[self.count : stop] = rows
        self.count = stop

    @property
    def values(self) -> NDArray:
        """The rows that were appended so far, to be used before more are: ``extend`` moves them."""
        return self._rows[: self.count]


class TopicMessages:
    """The messages of one topic as they come, chunk by chunk."""

    def __init__(self, type_name: str) -> None:
        self.type_name = type_name
        self.frames: set[str] = set()
        self.columns: dict[tuple[str, ...], dict[str, GrowingColumn]] = {}
        """Columns of the messages that name the same joints, by these joints."""
        self.orders: dict[frozenset[str], tuple[str, ...]] = {}
        """Joints of each set of them in the order that came first."""
        self.checked: dict[tuple[str, ...], int] = {}
        """Messages of each whose log times were checked."""

    def add(self, groups: list[DecodedMessages]) -> None:
        """Take decoded messages of one chunk."""
        self.frames |= {group.frame_id for group in groups}
        if len(self.frames) > 1 and self.type_name != JOINTS:  # a joint's position is in no frame
            raise RigError(f"its messages name several frames ({listed(sorted(self.frames))}): split the run")
        groups = [self._in_order(group) for group in groups]
        for names in dict.fromkeys(group.names for group in groups):
            same = [group for group in groups if group.names == names]
            order = np.argsort(np.concatenate([group.where for group in same]))
            columns = self.columns.setdefault(names, {})
            for name in same[0].columns:
                parts = [group.columns[name] for group in same]
                if len({part.shape[1:] for part in parts}) > 1:
                    raise RigError(CHANGES)
                values = np.concatenate(parts)
                columns.setdefault(name, GrowingColumn(values)).extend(values if len(same) == 1 else values[order])
        if len(self.columns) > MOST_PUBLISHERS:
            raise RigError(f"its messages name over {MOST_PUBLISHERS} sets of joints: record those of the robot alone")

    def _in_order(self, group: DecodedMessages) -> DecodedMessages:
        """Messages with their joints in the order in which this set of them came first: names may come in any order."""
        names = self.orders.setdefault(frozenset(group.names), group.names)
        if names == group.names or sorted(names) != sorted(group.names) or len(set(names)) < len(names):
            return group
        places, count = [group.names.index(name) for name in names], len(names)
        columns = {
            name: values[:, places] if values.ndim == 2 and values.shape[1] == count else values
            for name, values in group.columns.items()
        }
        return group._replace(names=names, columns=columns)

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints of all messages."""
        return tuple(dict.fromkeys(name for names in self.columns for name in names))

    def check_clock(self, file: PathLike, topic: str) -> None:
        """Refuse log times that step back within the file that was taken last: sorted, they would interleave.

        Raises:
            RigError: they do.
        """
        for names, columns in self.columns.items():
            times = columns["log_time"].values[self.checked.get(names, 0) :]
            self.checked[names] = columns["log_time"].count
            back = np.maximum.accumulate(times) - times
            if len(back) and back.max() > SET_BACK:
                raise RigError(
                    f"log times of {listed([topic])} in {file} step back by {back.max() * 1e-9:.3f} s at message "
                    f"{int(np.argmax(back > SET_BACK))}: record again, or, if no clock was set back, use `mcap sort`"
                )

    def arrays(self) -> dict[str, NDArray]:
        """Every column of the topic in the order of ``log_time``; they are taken out of the topic.

        A message that names some of the joints alone holds NaN for the others.
        """
        joints, parts = self.joints, []
        for names in list(self.columns):
            part = {name: column.values for name, column in self.columns.pop(names).items()}
            parts.append(part if names == joints else {name: _among(x, names, joints) for name, x in part.items()})
        joined = parts[0]
        if len(parts) > 1:
            if any(part[name].shape[1:] != joined[name].shape[1:] for part in parts for name in joined):
                raise RigError("some messages of joint states lack values that others have: split the run")
            joined = {name: np.concatenate([part.pop(name) for part in parts]) for name in list(joined)}
        log_time = joined["log_time"]
        if len(log_time) and (np.diff(log_time) < 0).any():
            order = np.argsort(log_time, kind="stable")
            return {name: values[order] for name, values in joined.items()}
        return joined


class Contents:
    """Content that ``load`` returns: the topics by name, the metadata, the hash, and the bytes behind the end."""

    def __init__(self, path: PathLike) -> None:
        self.path = path
        self.sha256 = ""
        self.rest = 0
        self.metadata: dict[str, dict[str, str]] = {}
        self.types: dict[str, str] = {}
        self.topics: dict[str, TopicMessages] = {}

    def take(self, file: ContainerFile, definitions: Definitions, only: Topics) -> None:
        """Take a file's messages that are of a type in ``only``, from the named topic or from every one."""
        for batch in joined(file.batches(definitions, set(only)), FULL):  # decoding has a price a batch
            try:
                self._add(batch, definitions, only, file.budget)
            except RigError:
                raise
            except (ValueError, OverflowError) as error:
                raise file.damage(str(error)) from error
        for topic, messages in self.topics.items():
            messages.check_clock(file.name, topic)
        self.types |= {channel.topic: type_of(channel, definitions) for channel in definitions.channels.values()}
        self.metadata |= definitions.metadata

    def _add(self, batch: Batch, definitions: Definitions, only: Topics, budget: UnpackBudget) -> None:
        for channel_id, offsets in batch.offsets.items():
            if channel_id not in definitions.channels:
                raise ValueError(f"messages of channel {channel_id}, which is not defined")
            channel = definitions.channels[channel_id]
            type_name = type_of(channel, definitions)
            if type_name in only and only[type_name] in (None, channel.topic):
                messages = self.topics.setdefault(channel.topic, TopicMessages(type_name))
                for data, places in pieces(batch.data, offsets, budget):
                    if channel.message_encoding in json_messages.ENCODINGS:  # they count again: objects, one by one
                        budget.take(sum(MESSAGE.unpack_from(data, place)[1] for place in places))
                    try:
                        messages.add(_decoded(data, places, channel, type_name, definitions))
                    except RigError as error:
                        raise RigError(f"topic {listed([channel.topic])} in {self.path}: {error}") from None

    def choose(self, types: str | tuple[str, ...], topic: str | None) -> str:
        """The topic of this name, or the only one of the first of these types that has any.

        Raises:
            RigError: there is none, or several.
        """
        wanted = (types,) if isinstance(types, str) else types
        expected = " or ".join(wanted)
        candidates = sorted(name for name in self.types if self.types[name] in wanted)
        if topic is not None and topic not in self.types:
            raise RigError(
                f"no topic {topic} in {self.path}: choose one of {listed(candidates) or f'none ({expected})'}"
            )
        if topic is not None and self.types[topic] not in wanted:
            raise RigError(
                f"topic {topic} in {self.path} is {self.types[topic]}, not {expected}: "
                f"choose one of {listed(candidates) or 'none'}"
            )
        filled = [name for name in candidates if name in self.topics and name not in self.named_values()]
        first = next((kind for kind in wanted if any(self.types[name] == kind for name in filled)), None)
        filled = [name for name in filled if self.types[name] == first]
        if topic is None and len(filled) > 1:
            key = "wrench_topic" if first in WRENCHES else "motion_topic"
            raise RigError(f"several {first} topics in {self.path}: name one of {listed(filled)} ([recording], {key})")
        if not candidates:
            held = [f"{name} ({kind})" for name, kind in sorted(self.types.items())]
            other = "write another type's fields as one of these, or a table"
            wrench = set(wanted) <= set(WRENCHES)
            cure, missing = (NEEDS_WRIST, "WrenchStamped or Wrench") if wrench else (other, expected)
            raise RigError(
                f"no {missing} topic in {self.path}: it has {listed(held) or 'none'}; {cure} "
                "(docs/how-to/recordings.md#messages-of-other-types)"
            )
        chosen = topic or (filled or candidates)[0]
        if chosen not in self.topics:
            raise RigError(f"topic {chosen} in {self.path} has no messages: record the run again")
        return chosen

    def named_values(self) -> list[str]:
        """Topics whose joint states are named values, as a recording of ours says."""
        try:
            names = parse_json(self.metadata.get("rig.run", {}).get("values_topics", "[]"))
        except ValueError:
            return []
        return names if isinstance(names, list) else []

    def wrench(self, topic: str) -> WrenchChannel:
        """Force and moment of this topic as arrays."""
        return WrenchChannel(**self._arrays(topic))

    def imu(self, topic: str) -> ImuChannel:
        """Angular velocity and specific force of this topic as arrays."""
        return ImuChannel(**self._arrays(topic))

    def motion(self, topic: str) -> ImuChannel | MotionChannel:
        """Motion that this topic holds, as arrays."""
        kind = self.topics[topic].type_name
        if kind == IMU:
            return self.imu(topic)
        names = self.topics[topic].joints
        return MotionChannel(type=kind, names=names, **self._arrays(topic))

    def _arrays(self, topic: str) -> dict[str, Any]:
        frames = self.topics[topic].frames
        return {"topic": topic, "frame_id": frames.pop() if len(frames) == 1 else "", **self.topics[topic].arrays()}


def _among(values: NDArray, names: tuple[str, ...], joints: tuple[str, ...]) -> NDArray:
    """Values of some joints, or of none of them, among all: NaN for the others; of other columns the same."""
    if values.ndim < 2 or values.shape[1] not in (0, len(names)):
        return values
    spread = np.full((len(values), len(joints)), np.nan)
    if values.shape[1]:
        spread[:, [joints.index(name) for name in names]] = values
    return spread


def type_of(channel: Channel, definitions: Definitions) -> str:
    """The message type of a channel, or what is wrong with its encoding."""
    schema = definitions.schemas.get(channel.schema_id)
    name = "no type" if schema is None else listed([message_definitions.canonical(schema.name)])
    if channel.message_encoding in (*ENCODINGS, *json_messages.ENCODINGS):
        return name
    return (
        f"{name} in encoding {quoted(channel.message_encoding)}, which `mcap convert` or its writer can change to cdr"
    )


def _decoded(
    data: bytes, offsets: NDArray[np.int64], channel: Channel, type_name: str, definitions: Definitions
) -> list[DecodedMessages]:
    if channel.message_encoding in ENCODINGS:
        return cdr.decode(data, offsets, type_name, channel.message_encoding)
    try:
        return json_messages.decode(data, offsets, type_name, channel, definitions.schemas[channel.schema_id])
    except ValueError as error:
        raise RigError(f"{error}: write its messages with the fields of {type_name}") from None


def load(path: PathLike, *, only: Topics | None = None) -> Contents:
    """Read all wrench and IMU topics of a recording in one pass, a chunk at a time.

    Args:
        path: a file or rosbag2 folder; see :mod:`rig.bags.containers`.
        only: the topics to take; by default WrenchStamped and Imu.

    Raises:
        RigError: it is no recording, cut, damaged, or unpacks to too much.
        OSError: it cannot be opened.
    """
    contents, files = Contents(path), recording_files(path)
    for file in files:
        contents.take(file, Definitions(), {WRENCH: None, IMU: None} if only is None else only)
        contents.rest += file.rest
    contents.sha256 = recording_sha256(path, files)
    return contents
