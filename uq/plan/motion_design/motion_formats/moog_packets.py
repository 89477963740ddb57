"""Packets of a Moog motion base: 32 bytes each, big-endian, command word, six degrees of freedom, a spare."""

from collections.abc import Iterable
from typing import Any

import numpy as np

from identify.motion.euler_angles import attitude_of, roll_pitch_yaw
from uq.plan.motion_design.commanded import PlatformCommand
from uq.plan.motion_design.motion_formats import MotionFormat

DOFS = ("roll", "pitch", "heave", "surge", "yaw", "lateral")
PACKET = np.dtype([("command", ">u4"), ("dof", ">f4", 6), ("spare", ">f4")])
NEW_POSITION = 130
"""Moog's command word for a position in degrees of freedom."""
DOWN = np.diag([1.0, -1.0, -1.0])
"""Rotation from A (x forward, y left, z up) to Moog's axes (x forward, y right, z down)."""
RATE = 60
SINGLE = 2e-6
"""Largest difference of a read value from the motion, in single precision."""


def write(motion: PlatformCommand) -> bytes:
    """Return a stream of packets, metres and radians; heave is down and lateral is to the right, in ``DOFS``' order."""
    roll, pitch, yaw = roll_pitch_yaw(DOWN @ motion.rotation @ DOWN).T
    surge, lateral, heave = (motion.position @ DOWN).T
    packets = np.zeros(len(motion.t), PACKET)
    packets["command"] = NEW_POSITION
    packets["dof"] = np.stack([roll, pitch, heave, surge, yaw, lateral], axis=1)
    return packets.tobytes()


def read(content: bytes) -> tuple[np.ndarray, ...]:
    """Return instants, positions and attitudes of such a stream.

    Raises:
        ValueError: another length, or another command.
    """
    packets = np.frombuffer(content, PACKET)
    if (packets["command"] != NEW_POSITION).any():
        raise ValueError("another command word")
    roll, pitch, heave, surge, yaw, lateral = packets["dof"].astype(float).T
    rotation = DOWN @ attitude_of(np.stack([roll, pitch, yaw], axis=1)) @ DOWN
    return np.arange(len(packets)) / RATE, np.stack([surge, lateral, heave], axis=1) @ DOWN, rotation


def compared(content: bytes, motion: PlatformCommand) -> Iterable[tuple[Any, Any]]:
    """Return what packets say beside the command."""
    return zip(read(content), (motion.t, motion.position, motion.rotation), strict=True)


FORMAT = MotionFormat(
    ending="moog.bin", description=f"Moog packets, {RATE} Hz", command=PlatformCommand, write=write,
    compared=compared, rate=RATE, tolerance=SINGLE,
    meaning={
        "packet": ["command word, u32", *(f"{dof}, f32" for dof in DOFS), "spare, f32"],
        "byte_order": "big-endian",
        "units": {"rotation": "rad", "translation": "m"},
        "assumed": [
            f"degrees-of-freedom mode, command word {NEW_POSITION} (new position), one packet per datagram",
            "axes x forward, y right, z down: surge = x, lateral = -y, heave = -z, pitch and yaw with the other "
            "sign than in the table; R = Rz(yaw) Ry(pitch) Rx(roll) in these axes",
            "zero is home, and the motion base turns about OMB",
        ],
    },
)  # fmt: skip
