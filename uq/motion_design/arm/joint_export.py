"""A joint motion as files, each read back and compared with the motion."""

import numpy as np

from identify.serial_arm.joint_series import JointSeries, JointStates
from uq.motion_design.arm.arm import Arm
from uq.motion_design.commanded import JointCommand
from uq.motion_design.motion_formats import written


def joint_files(arm: Arm, series: JointSeries, name: str = "motion", speed: float = 1.0) -> dict[str, bytes]:
    """Return the motion's files by name, from rest to rest at the arm's rate; ``speed`` stretches the time.

    Raises:
        RuntimeError: a file does not say what it should.
    """
    count = int(np.ceil(series.duration / speed * arm.declared.rate - 1e-9)) + 1
    t = np.arange(count) / arm.declared.rate
    position, rate, acceleration = series.sampled(t * speed)
    joints = JointStates(position, speed * rate, speed**2 * acceleration)
    command = JointCommand(arm.names, t, joints, turning=not any(arm.chain.prismatic))
    return {file.name: file.content for file in written(command, name)}
