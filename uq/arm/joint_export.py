"""A joint motion as files, each read back and compared with the motion."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from identify.serial_arm.joint_series import JointSeries, JointStates
from uq.arm.arm import Arm
from uq.arm.joint_formats import (
    UR_JOINTS,
    csv,
    joint_trajectory,
    read_csv,
    read_joint_trajectory,
    read_urscript,
    urscript,
)

EXACT = 2e-9
"""Largest difference of a read value from the motion: rounding to decimals, and to nanoseconds of an instant."""


def commanded(arm: Arm, series: JointSeries, speed: float = 1.0) -> tuple[np.ndarray, JointStates]:
    """Return instants at the arm's rate, from rest to rest, and its joints there; ``speed`` stretches the time."""
    count = int(np.ceil(series.duration / speed * arm.declared.rate - 1e-9)) + 1
    t = np.arange(count) / arm.declared.rate
    position, rate, acceleration = map(np.asarray, series.states(t * speed))
    return t, JointStates(position, speed * rate, speed**2 * acceleration)


def joint_files(arm: Arm, series: JointSeries, name: str = "motion", speed: float = 1.0) -> dict[str, bytes]:
    """Return the motion's files by name; URScript for arms of six joints that turn.

    Raises:
        RuntimeError: a file does not say what it should.
    """
    t, joints = commanded(arm, series, speed)
    contents = {
        f"{name}.csv": csv(arm.names, t, joints),
        f"{name}.joint_trajectory.yaml": joint_trajectory(arm.names, t, joints),
    }
    readers = {f"{name}.csv": read_csv, f"{name}.joint_trajectory.yaml": read_joint_trajectory}
    for file, read in readers.items():
        again, states = read(contents[file])
        _compare(file, (t, *joints), (again, *states))
    if arm.count == UR_JOINTS and not any(arm.chain.prismatic):
        contents[f"{name}.script"] = urscript(t, joints)
        step, position = read_urscript(contents[f"{name}.script"])
        _compare(f"{name}.script", (t[1] - t[0], joints.position), (step, position))
    return contents


def _compare(file: str, written: Sequence[Any], read: Sequence[Any]) -> None:
    for expected, value in zip(written, read, strict=True):
        if np.shape(expected) != np.shape(value) or not np.abs(expected - value).max() < EXACT:
            raise RuntimeError(f"{file} does not say what the motion is")
