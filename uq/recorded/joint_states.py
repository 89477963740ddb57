"""How fast a link of a robot turns, from its joints: a URDF through the optional package Pinocchio."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from identify.signals.run import RunError
from rig.exceptions import listed, quoted
from uq.experiment.recording_table import Recording
from uq.files.document import ExperimentError
from uq.recorded.urdf_model import frame_number, joint_axis, urdf_model


@dataclass(frozen=True)
class Chain:
    """The joints between a robot's base and a frame."""

    model: Any
    """Pinocchio's model."""
    data: Any
    """Its workspace."""
    frame: int
    """Number of the frame in the model."""
    joints: tuple[tuple[int, int], ...]
    """Number of each joint that moves the frame, in the model and among the recorded joints."""

    @classmethod
    def load(cls, declared: Recording, names: tuple[str, ...], topic: str) -> "Chain":
        """Read the URDF that ``[recording]`` declares.

        Args:
            declared: with ``urdf`` and ``urdf_frame``.
            names: of the recorded joints.
            topic: what messages call them.

        Raises:
            ExperimentError: the URDF is not declared, missing, no URDF, or without the frame.
            RunError: a joint that moves the frame was not recorded, or turns about no fixed axis.
            RigError: Pinocchio is not installed.
        """
        if declared.urdf is None or declared.urdf_frame is None:
            raise ExperimentError(
                f"{topic} holds joint states: declare the robot by recording.urdf and recording.urdf_frame, "
                "or name another recording.motion_topic"
            )
        model = urdf_model(declared.urdf, "recording.urdf", "joint states")
        frame = frame_number(model, declared.urdf_frame, declared.urdf, "recording.urdf_frame")
        moving = [number for number in model.supports[model.frames[frame].parentJoint] if number > 0]
        for number in moving:
            if model.names[number] not in names:
                raise RunError(
                    f"joint {quoted(model.names[number])} of {Path(declared.urdf).name} is not in {topic}: it has "
                    f"{listed(names)}"
                )
            if model.joints[number].nv != 1:
                raise RunError(f"joint {quoted(model.names[number])} of {Path(declared.urdf).name} has several axes")
            joint_axis(model, number, declared.urdf)
        return cls(
            model, model.createData(), frame, tuple((number, names.index(model.names[number])) for number in moving)
        )

    def jacobian(self, position: np.ndarray) -> np.ndarray:
        """Return the angular Jacobian in the frame's own axes at recorded positions (k,), (3, joints)."""
        import pinocchio

        q = pinocchio.neutral(self.model)
        for number, k in self.joints:
            at = self.model.joints[number].idx_q
            if self.model.joints[number].nq == 2:  # a continuous joint, which Pinocchio keeps as cosine and sine
                q[at], q[at + 1] = np.cos(position[k]), np.sin(position[k])
            else:
                q[at] = position[k]
        full = pinocchio.computeFrameJacobian(self.model, self.data, q, self.frame, pinocchio.LOCAL)
        return np.asarray(full[3:, [self.model.joints[number].idx_v for number, _ in self.joints]])

    def angular_velocity(self, position: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """Return the frame's angular velocity in its own axes [rad/s], (n, 3), of recorded joints (n, k)."""
        columns = [k for _, k in self.joints]
        rows = zip(position, velocity[:, columns], strict=True)
        return np.array([self.jacobian(at) @ speed for at, speed in rows]).reshape(-1, 3)

    def spread(self, position: np.ndarray, sigma: np.ndarray) -> np.ndarray:
        """Return the frame's angular noise on each axis, root mean square, of the joints' own noise (k,)."""
        of_joints = sigma[[k for _, k in self.joints]]
        step = max(len(position) // 200, 1)
        squares = [self.jacobian(at) ** 2 @ of_joints**2 for at in position[::step]]
        return np.sqrt(np.mean(squares, axis=0))
