"""What a recorded run holds, as arrays."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class WrenchChannel:
    """Force and moment of one topic, n messages in the order of ``log_time``.

    Attributes:
        topic: name of the topic.
        frame_id: coordinate frame that the messages name.
        log_time: host arrival time [ns], shape (n,).
        stamp: time of measurement from the message header [ns], shape (n,).
        force: [N], shape (n, 3).
        moment: [N·m], shape (n, 3).
        sequence: the message counter, shape (n,), or None.
    """

    topic: str
    frame_id: str
    log_time: NDArray[np.int64]
    stamp: NDArray[np.int64]
    force: NDArray[np.float64]
    moment: NDArray[np.float64]
    sequence: NDArray[np.uint32] | None = None


@dataclass(frozen=True, eq=False)
class ImuChannel:
    """Angular velocity and specific force of one topic, n messages in the order of ``log_time``.

    Attributes:
        topic: name of the topic.
        frame_id: coordinate frame that the messages name.
        log_time: host arrival time [ns], shape (n,).
        stamp: time of measurement from the message header [ns], shape (n,).
        angular_velocity: [rad/s], shape (n, 3).
        linear_acceleration: what the accelerometer reads (specific force) [m/s²], shape (n, 3).
        sequence: the message counter, shape (n,), or None.
    """

    topic: str
    frame_id: str
    log_time: NDArray[np.int64]
    stamp: NDArray[np.int64]
    angular_velocity: NDArray[np.float64]
    linear_acceleration: NDArray[np.float64]
    sequence: NDArray[np.uint32] | None = None


@dataclass(frozen=True, eq=False)
class Recording:
    """One recorded run: a wrench topic, an IMU topic, the metadata records by name, and the file's SHA-256."""

    path: Path
    sha256: str
    metadata: dict[str, dict[str, str]]
    wrench: WrenchChannel
    imu: ImuChannel
