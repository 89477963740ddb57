"""The content of a recorded run as arrays."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from rig.exceptions import RigError

LATE = 1_000_000_000
"""Largest delay of a message behind one of a later stamp [ns]; beyond it a clock was set back."""
CROWDED = 0.6
"""Least step between stamps over their median, down to which they are a device's clock."""


@dataclass(frozen=True, eq=False, repr=False)
class RecordedChannel:
    """Data that every topic has, n messages in the order of ``log_time``.

    Attributes:
        topic: name of the topic.
        frame_id: coordinate frame that the messages name.
        log_time: host arrival time [ns], shape (n,).
        stamp: time of measurement from the message header [ns], shape (n,).
    """

    topic: str
    frame_id: str
    log_time: NDArray[np.int64]
    stamp: NDArray[np.int64]

    def __repr__(self) -> str:
        return f"{type(self).__name__}({self.topic!r}: {len(self.log_time):,} samples)"

    def taken(self, which: NDArray[Any] | slice) -> Self:
        """Return some of the messages: those at these places, or where the mask is true."""
        values = {field.name: getattr(self, field.name) for field in fields(self)}
        arrays: dict[str, Any] = {name: x[which] for name, x in values.items() if isinstance(x, np.ndarray)}
        return replace(self, **arrays)

    def in_order(self) -> Self:
        """Return the messages in the order of their stamps, where some overtook others on their way.

        That is so where the stamps, in order, do not crowd, and none lies far back. Other stamps that do not increase
        are no clock's, or one that was set back, and the messages stay as they are.
        """
        if len(self.stamp) < 11 or (self.stamp[1:] > self.stamp[:-1]).all():
            return self
        steps = np.diff(np.sort(self.stamp))
        if steps.min() <= CROWDED * np.median(steps):
            return self
        if (np.maximum.accumulate(self.stamp) - self.stamp).max() > LATE:
            return self
        return self.taken(np.argsort(self.stamp))


def stamps_early(wrench: RecordedChannel, motion: RecordedChannel) -> float:
    """Return the time by which the motion's stamps are early against the wrench's, by the log's times [s].

    The log has one clock: the usual time from stamp to log is alike, unless the stamps are of two clocks. 0 where a
    channel has no stamps.
    """
    if not (wrench.stamp.any() and motion.stamp.any()):
        return 0.0
    delays = [np.median(channel.log_time - channel.stamp) for channel in (wrench, motion)]
    return float(delays[1] - delays[0]) * 1e-9


@dataclass(frozen=True, eq=False, repr=False)
class WrenchChannel(RecordedChannel):
    """Force and moment of one topic.

    Attributes:
        force: [N], shape (n, 3).
        moment: [N·m], shape (n, 3).
        sequence: the message counter, shape (n,), or None.
    """

    force: NDArray[np.float64]
    moment: NDArray[np.float64]
    sequence: NDArray[np.uint32] | None = None


@dataclass(frozen=True, eq=False, repr=False)
class ImuChannel(RecordedChannel):
    """Angular velocity and specific force of one topic.

    Attributes:
        angular_velocity: [rad/s], shape (n, 3).
        linear_acceleration: what the accelerometer reads (specific force) [m/s²], shape (n, 3).
        sequence: the message counter, shape (n,), or None.
        orientation: quaternion x y z w from the sensor's frame to one at rest, shape (n, 4), as recorded; None: none.
    """

    angular_velocity: NDArray[np.float64]
    linear_acceleration: NDArray[np.float64]
    sequence: NDArray[np.uint32] | None = None
    orientation: NDArray[np.float64] | None = None


@dataclass(frozen=True, eq=False, repr=False)
class MotionChannel(RecordedChannel):
    """Motion that a sensor other than an IMU measures.

    Attributes:
        type: the messages' type.
        angular_velocity: [rad/s], shape (n, 3); None: the type has none.
        orientation: quaternion x y z w from the sensor's frame to ``frame_id``, shape (n, 4); None: the type has none.
        names: names of the joints.
        position: of the joints [rad or m], shape (n, joints); of a pose's origin along the axes of ``frame_id`` [m],
            shape (n, 3); None: the type has none.
        velocity: of the joints [rad/s or m/s], shape (n, joints or 0); None: no joints.
        sequence: the message counter, shape (n,), or None.
    """

    type: str
    angular_velocity: NDArray[np.float64] | None = None
    orientation: NDArray[np.float64] | None = None
    names: tuple[str, ...] = ()
    position: NDArray[np.float64] | None = None
    velocity: NDArray[np.float64] | None = None
    sequence: NDArray[np.uint32] | None = None


def counted_together(channels: Sequence[WrenchChannel | ImuChannel]) -> bool:
    """Whether one counter numbers the messages of several topics: then a step of two is no loss."""
    counters = [channel.sequence for channel in channels if channel.sequence is not None and len(channel.sequence)]
    if len(counters) < 2 or max(x.min() for x in counters) > min(x.max() for x in counters):
        return False
    steps = np.diff(np.sort(np.concatenate(counters).astype(np.int64)))
    return bool(steps.min() > 0)


def halves(channels: Sequence[ImuChannel]) -> tuple[ImuChannel, ImuChannel] | None:
    """Return gyro and accelerometer where they are apart: each alone holds one signal, the other's being zero."""
    gyros = [channel for channel in channels if channel.angular_velocity.any()]
    accelerometers = [channel for channel in channels if channel.linear_acceleration.any()]
    if len(gyros) != 1 or len(accelerometers) != 1 or gyros[0] is accelerometers[0]:
        return None
    return gyros[0], accelerometers[0]


@dataclass(frozen=True, eq=False, repr=False)
class Recording:
    """One recorded run: wrench, motion, the metadata records by name, and the file's SHA-256."""

    path: Path
    sha256: str
    metadata: dict[str, dict[str, str]]
    wrench: WrenchChannel
    motion: ImuChannel | MotionChannel
    accelerometer: ImuChannel | None = None
    """Topic of the accelerometer alone, where the motion's is a gyro's alone."""

    def __repr__(self) -> str:
        return f"Recording({self.path.name!r}: {self.wrench}, {self.motion})"

    @property
    def imu(self) -> ImuChannel:
        """The motion, where it is an IMU's. Raises ``RigError`` where it is another sensor's."""
        if not isinstance(self.motion, ImuChannel):
            raise RigError(f"topic {self.motion.topic} in {self.path} is {self.motion.type}: give an IMU's topic")
        return self.motion
