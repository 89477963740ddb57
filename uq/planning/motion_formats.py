"""A motion in the formats that platforms take: a CSV table, PI's wave tables, Moog's packets; and back.

All three name the attitude ``R_AB = Rz(yaw) Ry(pitch) Rx(roll)``, which takes components in B to those in A: turn about
the fixed x by roll, then about the fixed y by pitch, then about the fixed z by yaw (or about z, y', x'' in turn).
Positions are those of the platform's centre OMB from home.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
import scipy
from jaxtyping import Float

ORDER = "ZYX"
"""Rotation order of the angles (yaw, pitch, roll), about turned axes."""
CSV_COLUMNS = (
    "t_s", "x_m", "y_m", "z_m", "roll_rad", "pitch_rad", "yaw_rad", "q_w", "q_x", "q_y", "q_z",
    *(f"leg{k}_m" for k in range(1, 7)),
)  # fmt: skip
PI_AXES = {"X": "mm", "Y": "mm", "Z": "mm", "U": "deg", "V": "deg", "W": "deg"}
"""Axes of a hexapod and their units, in the order of its wave tables 1 to 6."""
PI_POINTS = 100
"""Points of one command."""
MOOG_DOFS = ("roll", "pitch", "heave", "surge", "yaw", "lateral")
MOOG_PACKET = np.dtype([("command", ">u4"), ("dof", ">f4", 6), ("spare", ">f4")])
NEW_POSITION = 130
"""Moog's command word for a position in degrees of freedom."""
DOWN = np.diag([1.0, -1.0, -1.0])
"""Rotation from A (x forward, y left, z up) to Moog's axes (x forward, y right, z down)."""


@dataclass(frozen=True)
class Commanded:
    """The motion that a platform is commanded, at uniform instants."""

    t: Float[np.ndarray, " n"]
    """Instants of the command [s]."""
    position: Float[np.ndarray, "n 3"]
    """Position of OMB from home, in A [m]."""
    rotation: Float[np.ndarray, "n 3 3"]
    """Attitude R_AB, from components in B to components in A."""
    length: Float[np.ndarray, "n legs"]
    """Lengths of the legs [m]; of no width where the format has none."""

    def every(self, step: int) -> "Commanded":
        """Return every ``step``-th instant."""
        return Commanded(*(samples[::step] for samples in (self.t, self.position, self.rotation, self.length)))


def csv(motion: Commanded) -> bytes:
    """Return the table with the columns ``CSV_COLUMNS``, ten decimals."""
    turn = scipy.spatial.transform.Rotation.from_matrix(motion.rotation)
    quaternion = np.roll(turn.as_quat(canonical=True), 1, axis=1)
    angles = turn.as_euler(ORDER)[:, ::-1]
    rows = np.hstack([motion.t[:, None], motion.position, angles, quaternion, motion.length])
    lines = [",".join(f"{value:.10f}" for value in row) for row in _decimals(rows, 10).tolist()]
    return "\n".join([",".join(CSV_COLUMNS), *lines, ""]).encode()


def _decimals(values: np.ndarray, places: int) -> np.ndarray:
    """Values to so many decimals, none of them below nought by rounding alone."""
    return np.round(values, places) + 0.0


def read_csv(content: bytes) -> tuple[Commanded, Float[np.ndarray, "n 3 3"]]:
    """Return the motion of a table, its attitude by the angles; and the attitude by the quaternions.

    Raises:
        ValueError: it is no such table.
    """
    head, *lines = content.decode().split()
    if tuple(head.split(",")) != CSV_COLUMNS:
        raise ValueError("other columns")
    rows = np.array([[float(cell) for cell in line.split(",")] for line in lines])
    by_angles = scipy.spatial.transform.Rotation.from_euler(ORDER, rows[:, 6:3:-1]).as_matrix()
    by_quaternion = scipy.spatial.transform.Rotation.from_quat(np.roll(rows[:, 7:11], -1, axis=1)).as_matrix()
    return Commanded(rows[:, 0], rows[:, 1:4], by_angles, rows[:, 11:]), by_quaternion


def pi_waves(motion: Commanded) -> bytes:
    """Return GCS commands that fill a hexapod's wave tables 1 to 6 (X Y Z U V W) point by point, one after the other.

    ``WAV table X PNT 1 count values`` begins a new table, ``WAV table & PNT 1 count values`` adds to it.
    """
    return "\n".join([*_wave_lines(motion), ""]).encode()


def _wave_lines(motion: Commanded) -> Iterator[str]:
    angles = scipy.spatial.transform.Rotation.from_matrix(motion.rotation).as_euler(ORDER, degrees=True)[:, ::-1]
    for table, values in enumerate(_decimals(np.hstack([1e3 * motion.position, angles]), 8).T, start=1):
        for first in range(0, len(values), PI_POINTS):
            points_of_line = values[first : first + PI_POINTS]
            points = " ".join(f"{value:.8f}" for value in points_of_line)
            yield f"WAV {table} {'&' if first else 'X'} PNT 1 {len(points_of_line)} {points}"


def read_pi_waves(content: bytes, rate: float) -> Commanded:
    """Return the motion of such commands, output at ``rate`` points a second.

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
    rotation = scipy.spatial.transform.Rotation.from_euler(ORDER, values[:, :2:-1], degrees=True).as_matrix()
    return Commanded(np.arange(len(values)) / rate, 1e-3 * values[:, :3], rotation, np.zeros((len(values), 0)))


def moog_packets(motion: Commanded) -> bytes:
    """Return a stream of packets of 32 bytes, big-endian: command word, six degrees of freedom as floats, a spare.

    Metres and radians; heave is down and lateral is to the right, in ``MOOG_DOFS``' order.
    """
    rotation = DOWN @ motion.rotation @ DOWN
    yaw, pitch, roll = scipy.spatial.transform.Rotation.from_matrix(rotation).as_euler(ORDER).T
    surge, lateral, heave = (motion.position @ DOWN).T
    packets = np.zeros(len(motion.t), MOOG_PACKET)
    packets["command"] = NEW_POSITION
    packets["dof"] = np.stack([roll, pitch, heave, surge, yaw, lateral], axis=1)
    return packets.tobytes()


def read_moog_packets(content: bytes, rate: float) -> Commanded:
    """Return the motion of such a stream, sent at ``rate`` packets a second.

    Raises:
        ValueError: another length, or another command.
    """
    packets = np.frombuffer(content, MOOG_PACKET)
    if (packets["command"] != NEW_POSITION).any():
        raise ValueError("another command word")
    roll, pitch, heave, surge, yaw, lateral = packets["dof"].astype(float).T
    turn = scipy.spatial.transform.Rotation.from_euler(ORDER, np.stack([yaw, pitch, roll], axis=1))
    rotation = DOWN @ turn.as_matrix() @ DOWN
    position = np.stack([surge, lateral, heave], axis=1) @ DOWN
    return Commanded(np.arange(len(packets)) / rate, position, rotation, np.zeros((len(packets), 0)))
