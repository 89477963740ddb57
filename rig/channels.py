"""What a recorded run holds, as arrays."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from rig.exceptions import RigError


@dataclass(frozen=True, eq=False, repr=False)
class Channel:
    """What every topic has, n messages in the order of ``log_time``.

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


@dataclass(frozen=True, eq=False, repr=False)
class WrenchChannel(Channel):
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
class ImuChannel(Channel):
    """Angular velocity and specific force of one topic.

    Attributes:
        angular_velocity: [rad/s], shape (n, 3).
        linear_acceleration: what the accelerometer reads (specific force) [m/s²], shape (n, 3).
        sequence: the message counter, shape (n,), or None.
    """

    angular_velocity: NDArray[np.float64]
    linear_acceleration: NDArray[np.float64]
    sequence: NDArray[np.uint32] | None = None


@dataclass(frozen=True, eq=False, repr=False)
class MotionChannel(Channel):
    """What a sensor other than an IMU measures of the motion.

    Attributes:
        type: the messages' type.
        angular_velocity: [rad/s], shape (n, 3); None: the type has none.
        orientation: quaternion x y z w from the sensor's frame to ``frame_id``, shape (n, 4); None: the type has none.
        names: names of the joints.
        position: of the joints [rad or m], shape (n, joints); None: no joints.
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


@dataclass(frozen=True, eq=False, repr=False)
class Recording:
    """One recorded run: wrench, motion, the metadata records by name, and the file's SHA-256."""

    path: Path
    sha256: str
    metadata: dict[str, dict[str, str]]
    wrench: WrenchChannel
    motion: ImuChannel | MotionChannel

    def __repr__(self) -> str:
        return f"Recording({self.path.name!r}: {self.wrench}, {self.motion})"

    @property
    def imu(self) -> ImuChannel:
        """The motion, where it is an IMU's. Raises ``RigError`` where it is another sensor's."""
        if not isinstance(self.motion, ImuChannel):
            raise RigError(f"topic {self.motion.topic} in {self.path} is {self.motion.type}: give an IMU's topic")
        return self.motion
