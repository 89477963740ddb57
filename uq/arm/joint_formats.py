"""A joint motion in the formats that arms take: a CSV table, a ROS 2 ``JointTrajectory``, URScript; and back.

The ROS 2 file holds the message ``trajectory_msgs/msg/JointTrajectory`` as YAML in its flow style, which is JSON, too.
"""

import json
import re
from collections.abc import Sequence

import numpy as np

from identify.serial_arm.joint_series import JointStates

COLUMNS = {"position": "q", "speed": "qd", "acceleration": "qdd"}
"""Suffixes of a joint's columns in the table, by quantity."""
UR_JOINTS = 6


def csv(names: Sequence[str], t: np.ndarray, joints: JointStates) -> bytes:
    """Return the table: instants, then position, speed and acceleration of every joint in SI, ten decimals."""
    head = ["t_s", *(f"{name}.{end}" for end in COLUMNS.values() for name in names)]
    rows = np.hstack([t[:, None], *joints])
    return "\n".join([",".join(head), *(",".join(f"{x:.10f}" for x in row) for row in rows.tolist()), ""]).encode()


def read_csv(data: bytes) -> tuple[np.ndarray, JointStates]:
    """Return instants and joints from the table."""
    rows = np.loadtxt(data.decode().splitlines(), delimiter=",", skiprows=1, ndmin=2)
    return rows[:, 0], JointStates(*np.split(rows[:, 1:], 3, axis=1))


def joint_trajectory(names: Sequence[str], t: np.ndarray, joints: JointStates) -> bytes:
    """Return the ROS 2 message, to be published or sent as the goal's trajectory."""
    points = []
    for at, position, speed, acceleration in zip(t, *joints, strict=True):
        seconds = int(np.floor(at + 5e-10))
        since = {"sec": seconds, "nanosec": max(round(1e9 * (at - seconds)), 0)}
        values = [[round(x, 10) for x in each.tolist()] for each in (position, speed, acceleration)]
        keys = ("positions", "velocities", "accelerations")
        points.append(json.dumps({**dict(zip(keys, values, strict=True)), "time_from_start": since}))
    lines = ",\n".join(points)
    return f'{{"joint_names": {json.dumps(list(names))},\n"points": [\n{lines}\n]}}\n'.encode()


def read_joint_trajectory(data: bytes) -> tuple[np.ndarray, JointStates]:
    """Return instants and joints from the ROS 2 message."""
    points = json.loads(data)["points"]
    t = np.array([each["time_from_start"]["sec"] + 1e-9 * each["time_from_start"]["nanosec"] for each in points])
    keys = ("positions", "velocities", "accelerations")
    return t, JointStates(*(np.array([each[key] for each in points]) for key in keys))


def urscript(t: np.ndarray, joints: JointStates) -> bytes:
    """Return a program of ``servoj`` rows; it ends at once unless the arm is at home already, within 0.01 rad."""
    step = float(t[1] - t[0])
    rows = [", ".join(f"{x:.10f}" for x in row) for row in joints.position.tolist()]
    lines = [
        "def inertia_motion():",
        f"  home = [{rows[0]}]",
        "  q = get_actual_joint_positions()",
        "  k = 0",
        f"  while k < {UR_JOINTS}:",
        "    if norm(q[k] - home[k]) > 0.01:",
        '      popup("Move the arm to the motion\'s home first.", title="inertia", error=True, blocking=True)',
        "      halt",
        "    end",
        "    k = k + 1",
        "  end",
        *(f"  servoj([{row}], t={step:.10g}, lookahead_time=0.03, gain=300)" for row in rows),
        "  stopj(2.0)",
        "end",
        "inertia_motion()",
        "",
    ]
    return "\n".join(lines).encode()


def read_urscript(data: bytes) -> tuple[float, np.ndarray]:
    """Return the time step [s] and the positions of a program's ``servoj`` rows."""
    rows = re.findall(r"servoj\(\[([^\]]*)\], t=([\d.e-]+)", data.decode())
    return float(rows[0][1]), np.array([[float(x) for x in row.split(",")] for row, _ in rows])
