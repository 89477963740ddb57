"""CDR, the encoding of ROS 2 messages: WrenchStamped and Imu, one by one to bytes and by the thousand to arrays.

A message is a four-byte encapsulation header (``00 01`` little-endian, ``00 00`` big-endian), then the fields, each
aligned to its size counted from behind that header. With a given length of ``frame_id`` every message of a type has the
same layout, so that a numpy structured dtype describes it (OMG Data Distribution Service Interoperability Protocol
(DDSI-RTPS) 2.5, clause 10).
"""

import struct
from functools import cache

import numpy as np
from numpy.typing import NDArray

from rig import schemas

ENCAPSULATION = b"\x00\x01\x00\x00"
ENDIANNESS = {b"\x00\x01": "<", b"\x00\x00": ">"}

# The doubles behind the header of each type: name and number.
BODIES = {
    schemas.WRENCH: (("force", 3), ("torque", 3)),
    schemas.IMU: (
        ("orientation", 4),
        ("orientation_covariance", 9),
        ("angular_velocity", 3),
        ("angular_velocity_covariance", 9),
        ("linear_acceleration", 3),
        ("linear_acceleration_covariance", 9),
    ),
}


@cache
def layout(type_name: str, endianness: str, frame_length: int) -> np.dtype:
    """The dtype of one message of ``type_name`` whose ``frame_id`` takes ``frame_length`` bytes, NUL included."""
    padding = -(12 + frame_length) % 8
    header = [
        ("encapsulation", "u1", (4,)),
        ("sec", endianness + "i4"),
        ("nanosec", endianness + "u4"),
        ("frame_length", endianness + "u4"),
        ("frame_id", "u1", (frame_length,)),
        ("padding", "u1", (padding,)),
    ]
    return np.dtype(header + [(name, endianness + "f8", (count,)) for name, count in BODIES[type_name]])


class Encoder:
    """Packs messages of one stamped type in one frame: ``encoder(stamp_ns, *doubles) -> bytes``."""

    def __init__(self, type_name: str, frame_id: str) -> None:
        frame = frame_id.encode() + b"\0"
        padding = -(12 + len(frame)) % 8
        doubles = sum(count for _, count in BODIES[type_name])
        self._struct = struct.Struct(f"<4siII{len(frame)}s{padding}x{doubles}d")
        self._frame = frame

    def __call__(self, stamp: int, *values: float) -> bytes:
        """The message with this stamp [ns] and these doubles, in the order of ``BODIES``."""
        sec, nanosec = divmod(stamp, 1_000_000_000)
        return self._struct.pack(ENCAPSULATION, sec, nanosec, len(self._frame), self._frame, *values)


class WrenchEncoder(Encoder):
    """Packs WrenchStamped: ``encoder(stamp_ns, Fx, Fy, Fz, Mx, My, Mz)``."""

    def __init__(self, frame_id: str) -> None:
        super().__init__(schemas.WRENCH, frame_id)


_NO_ORIENTATION = (0.0, 0.0, 0.0, 1.0, -1.0, *[0.0] * 8)
_UNKNOWN_COVARIANCE = (0.0,) * 9


class ImuEncoder(Encoder):
    """Packs Imu without orientation (``orientation_covariance[0] = -1``) and with unknown covariances (zeros)."""

    def __init__(self, frame_id: str) -> None:
        super().__init__(schemas.IMU, frame_id)

    def __call__(self, stamp: int, *values: float) -> bytes:
        """The message with this stamp [ns], angular velocity and specific force (six doubles)."""
        return super().__call__(
            stamp, *_NO_ORIENTATION, *values[:3], *_UNKNOWN_COVARIANCE, *values[3:], *_UNKNOWN_COVARIANCE
        )


def stamps(messages: NDArray) -> NDArray[np.int64]:
    """The header stamps [ns] of messages decoded with ``layout``."""
    return messages["sec"].astype(np.int64) * 1_000_000_000 + messages["nanosec"].astype(np.int64)
