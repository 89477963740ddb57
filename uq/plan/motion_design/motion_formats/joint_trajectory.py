"""The ROS 2 message ``trajectory_msgs/msg/JointTrajectory`` as YAML in its flow style, which is JSON, too."""

import json
from collections.abc import Iterable
from typing import Any

import numpy as np

from uq.plan.motion_design.commanded import JointCommand
from uq.plan.motion_design.motion_formats import MotionFormat

KEYS = ("positions", "velocities", "accelerations")


def write(motion: JointCommand) -> bytes:
    """Return the message, to be published or sent as the goal's trajectory."""
    points = []
    for at, *states in zip(motion.t, *motion.joints, strict=True):
        seconds = int(np.floor(at + 5e-10))
        since = {"sec": seconds, "nanosec": max(round(1e9 * (at - seconds)), 0)}
        values = [[round(x, 10) for x in state.tolist()] for state in states]
        points.append(json.dumps({**dict(zip(KEYS, values, strict=True)), "time_from_start": since}))
    lines = ",\n".join(points)
    return f'{{"joint_names": {json.dumps(list(motion.names))},\n"points": [\n{lines}\n]}}\n'.encode()


def compared(content: bytes, motion: JointCommand) -> Iterable[tuple[Any, Any]]:
    """Return instants and joints of a message beside the command."""
    points = json.loads(content)["points"]
    since = [point["time_from_start"] for point in points]
    t = np.array([time["sec"] + 1e-9 * time["nanosec"] for time in since])
    joints = [np.array([point[key] for point in points]) for key in KEYS]
    return zip((t, *joints), (motion.t, *motion.joints), strict=True)


FORMAT = MotionFormat(
    ending="joint_trajectory.yaml", description="ROS 2 JointTrajectory", command=JointCommand, write=write,
    compared=compared,
)  # fmt: skip
