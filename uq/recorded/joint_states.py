"""How fast a link of a robot turns, from its joints: a URDF through the optional package Pinocchio."""

import contextlib
import os
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from identify.signals.run import RunError
from rig.exceptions import RigError, listed, on_one_line, quoted, reason
from uq.experiment.recording_table import Recording
from uq.files.document import ExperimentError


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
        model = _model(declared.urdf)
        if not model.existFrame(declared.urdf_frame):
            frames = listed(frame.name for frame in model.frames if frame.name != "universe")
            raise ExperimentError(
                f"unknown frame {quoted(declared.urdf_frame)} at recording.urdf_frame: {declared.urdf} has {frames}"
            )
        frame = model.getFrameId(declared.urdf_frame)
        moving = [number for number in model.supports[model.frames[frame].parentJoint] if number > 0]
        for number in moving:
            if model.names[number] not in names:
                raise RunError(
                    f"joint {quoted(model.names[number])} of {Path(declared.urdf).name} is not in {topic}: it has "
                    f"{listed(names)}"
                )
            if model.joints[number].nv != 1:
                raise RunError(f"joint {quoted(model.names[number])} of {Path(declared.urdf).name} has several axes")
            if not _has_direction(model.joints[number]):
                raise ExperimentError(
                    f"no direction in the axis of joint {quoted(model.names[number])} of {Path(declared.urdf).name}: "
                    'correct it, such as xyz="0 0 1"'
                )
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


def _has_direction(joint: Any) -> bool:
    """Whether the axis of a joint is a unit vector: of zeros or of huge numbers, the library makes none."""
    data = joint.createData()
    joint.calc(data, np.array([1.0, 0.0][: joint.nq]), np.zeros(1))
    return abs(float(np.linalg.norm(data.S)) - 1.0) < 1e-9


def _model(urdf: str) -> Any:
    try:
        import pinocchio
    except ImportError:
        raise RigError("joint states need Pinocchio: `pip install inertia-uq[urdf]` installs it") from None
    if not Path(urdf).is_file():
        raise ExperimentError(f"no file {urdf} at recording.urdf: give its path from the experiment's folder")
    try:
        with _silence():
            model = pinocchio.buildModelFromXML(Path(urdf).read_bytes().decode())
        _ = list(model.names), [frame.name for frame in model.frames]
    except (ValueError, RuntimeError) as error:
        first = on_one_line(str(error).strip().partition("\n")[0]) or "it cannot be parsed"
        raise ExperimentError(
            f"no URDF {urdf} at recording.urdf ({reason(first)}): give a robot's description"
        ) from None
    return model


@contextlib.contextmanager
def _silence() -> Iterator[None]:
    """Keep what a C++ library writes from standard error: what it raises is said."""
    sys.stderr.flush()
    try:
        before = os.dup(2)
    except OSError:  # it is closed
        yield
        return
    nothing = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nothing, 2)
    os.close(nothing)
    try:
        yield
    finally:
        os.dup2(before, 2)
        os.close(before)
