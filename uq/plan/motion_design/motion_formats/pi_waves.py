"""Wave tables of a PI hexapod: GCS 2 commands that fill tables 1 to 6 (X Y Z U V W), in mm and degrees."""

from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np

from identify.motion.euler_angles import attitude_of, roll_pitch_yaw
from uq.plan.motion_design.commanded import PlatformCommand
from uq.plan.motion_design.motion_formats import MotionFormat

AXES = {"X": "mm", "Y": "mm", "Z": "mm", "U": "deg", "V": "deg", "W": "deg"}
"""Axes of a hexapod and their units, in the order of its wave tables 1 to 6."""
POINTS = 100
"""Points of one command."""
RATE = 100


def write(motion: PlatformCommand) -> bytes:
    """Return the commands that fill the tables point by point, one table after the other.

    ``WAV table X PNT 1 count values`` begins a new table, ``WAV table & PNT 1 count values`` adds to it.
    """
    return "\n".join([*_lines(motion), ""]).encode()


def _lines(motion: PlatformCommand) -> Iterator[str]:
    poses = np.hstack([1e3 * motion.position, np.degrees(roll_pitch_yaw(motion.rotation))])
    for table, values in enumerate((np.round(poses, 8) + 0.0).T, start=1):  # no -0
        for first in range(0, len(values), POINTS):
            points_of_line = values[first : first + POINTS]
            points = " ".join(f"{value:.8f}" for value in points_of_line)
            yield f"WAV {table} {'&' if first else 'X'} PNT 1 {len(points_of_line)} {points}"


def read(content: bytes) -> tuple[np.ndarray, ...]:
    """Return instants, positions and attitudes of such commands.

    Raises:
        ValueError: they are none, or the tables are of unequal length.
    """
    tables: dict[int, list[float]] = {}
    for line in content.decode().splitlines():
        command, table, append, kind, first, count, *points = line.split()
        if (command, kind, first) != ("WAV", "PNT", "1") or int(count) != len(points) or append not in "X&":
            raise ValueError(f"no wave of points: {line[:40]}")
        before = tables.get(int(table), []) if append == "&" else []
        tables[int(table)] = before + [float(point) for point in points]
    values = np.array([tables[k] for k in range(1, 7)]).T
    return np.arange(len(values)) / RATE, 1e-3 * values[:, :3], attitude_of(np.radians(values[:, 3:]))


def compared(content: bytes, motion: PlatformCommand) -> Iterable[tuple[Any, Any]]:
    """Return what commands say beside the command."""
    return zip(read(content), (motion.t, motion.position, motion.rotation), strict=True)


FORMAT = MotionFormat(
    ending="pi.txt", description=f"PI wave tables 1 to 6 (X Y Z U V W), {RATE} Hz", command=PlatformCommand,
    write=write, compared=compared, rate=RATE,
    meaning={
        "tables": {str(k): {"axis": axis, "unit": unit} for k, (axis, unit) in enumerate(AXES.items(), start=1)},
        "assumed": [
            "GCS 2 commands WAV … PNT of a hexapod controller; wave generators 1 to 6 are X Y Z U V W",
            "U V W are roll, pitch, yaw: R = Rz(W) Ry(V) Rx(U); the pivot point is OMB, zero is home",
            f"the wave generator puts out one point every {1 / RATE:g} s: set its table rate so",
        ],
    },
)  # fmt: skip
