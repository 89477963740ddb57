"""CDR, the encoding of ROS 2 messages: WrenchStamped and Imu to bytes.

:mod:`rig.mcap.cdr_layout` explains and reads it.
"""

import struct

from rig.mcap import message_definitions
from rig.mcap.message_fields import SHAPES

ENCAPSULATION = b"\x00\x01\x00\x00"


class Encoder:
    """Packs messages of one stamped type in one frame: ``encoder(stamp_ns, *doubles) -> bytes``."""

    def __init__(self, type_name: str, frame_id: str) -> None:
        frame = frame_id.encode() + b"\0"
        padding = -(12 + len(frame)) % 8
        doubles = sum(field.count for field in SHAPES[type_name])
        self._struct = struct.Struct(f"<4siII{len(frame)}s{padding}x{doubles}d")
        self._frame = frame

    def __call__(self, stamp: int, *values: float) -> bytes:
        """The message with this stamp [ns] and these doubles, in the order of ``BODIES``."""
        sec, nanosec = divmod(stamp, 1_000_000_000)
        return self._struct.pack(ENCAPSULATION, sec, nanosec, len(self._frame), self._frame, *values)


class WrenchEncoder(Encoder):
    """Packs WrenchStamped: ``encoder(stamp_ns, Fx, Fy, Fz, Mx, My, Mz)``."""

    def __init__(self, frame_id: str) -> None:
        super().__init__(message_definitions.WRENCH, frame_id)


_NO_ORIENTATION = (0.0, 0.0, 0.0, 1.0, -1.0, *[0.0] * 8)
_UNKNOWN_COVARIANCE = (0.0,) * 9


class ImuEncoder(Encoder):
    """Packs Imu without orientation (``orientation_covariance[0] = -1``) and with unknown covariances (zeros)."""

    def __init__(self, frame_id: str) -> None:
        super().__init__(message_definitions.IMU, frame_id)

    def __call__(self, stamp: int, *values: float) -> bytes:
        """The message with this stamp [ns], angular velocity and specific force (six doubles)."""
        return super().__call__(
            stamp, *_NO_ORIENTATION, *values[:3], *_UNKNOWN_COVARIANCE, *values[3:], *_UNKNOWN_COVARIANCE
        )
