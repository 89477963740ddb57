"""Motion of a robot's link from that of its joints: a URDF through the optional package Pinocchio."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from identify.signals.run import RunError
from rig.exceptions import listed, quoted
from uq.experiment.recording_table import RecordingTable
from uq.files.mistakes import ExperimentError
from uq.runs.recorded.urdf_model import frame_number, joint_axis, urdf_model

ONE_TURN = 2 * np.pi * (1 + 1e-6)
"""Range of an angle that is recorded within one turn [rad], with its rounding."""
GAP = 3.0
"""Step between samples over their median, beyond which their mean velocity does not tell the way."""
UNLIKE = 0.3
"""Departure from one, of recorded velocities over the rate of recorded positions, that no noise or delay makes."""


@dataclass(frozen=True)
class Chain:
    """The joints between a robot's base and a frame."""

    model: Any
    """Pinocchio's model of the robot."""
    data: Any
    """Workspace of Pinocchio's algorithms for ``model``."""
    frame: int
    """Number of the frame in the model."""
    joints: tuple[tuple[int, int], ...]
    """Numbers of each joint that moves the frame: in the model, and among the recorded joints."""
    notes: tuple[str, ...] = ()
    """Notes on the names by which the joints were found."""

    @classmethod
    def load(cls, declared: RecordingTable, names: tuple[str, ...], topic: str) -> "Chain":
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
                f"{topic} has joint states: declare the robot by recording.urdf and recording.urdf_frame, "
                "or name another recording.motion_topic"
            )
        model = urdf_model(declared.urdf, "recording.urdf", "joint states")
        frame = frame_number(model, declared.urdf_frame, declared.urdf, "recording.urdf_frame")
        moving = [number for number in model.supports[model.frames[frame].parentJoint] if number > 0]
        joints = [model.names[number] for number in moving]
        recorded, notes = _recorded_names(joints, names)
        for number, joint in zip(moving, joints, strict=True):
            if recorded[joint] not in names:
                raise RunError(
                    f"joint {quoted(joint)} of {Path(declared.urdf).name} is not in {topic}: it has {listed(names)}"
                )
            if model.joints[number].nv != 1:
                raise RunError(f"joint {quoted(model.names[number])} of {Path(declared.urdf).name} has several axes")
            joint_axis(model, number, declared.urdf)
        columns = [names.index(recorded[joint]) for joint in joints]
        return cls(model, model.createData(), frame, tuple(zip(moving, columns, strict=True)), notes)

    def jacobian(self, position: np.ndarray) -> np.ndarray:
        """Return the angular Jacobian in the frame's own axes at recorded positions (k,), (3, joints)."""
        import pinocchio

        q = self._configuration(position)
        full = pinocchio.computeFrameJacobian(self.model, self.data, q, self.frame, pinocchio.LOCAL)
        return np.reshape(full, (6, -1))[3:, self._moving]  # of one joint Pinocchio gives six numbers

    def unwrapped(self, position: np.ndarray) -> tuple[np.ndarray, tuple[str, ...]]:
        """Return positions without the jumps of angles that are recorded within one turn, and notes on them.

        Args:
            position: of the recorded joints, (n, k).
        """
        continuous, notes = position.copy(), []
        for number, k in self.joints:
            angle = position[:, k]
            if not self._turns(number) or np.ptp(angle) > ONE_TURN:
                continue
            continuous[:, k] = np.unwrap(angle)
            if (continuous[:, k] != angle).any():
                notes.append(f"the jumps of joint {quoted(self.model.names[number])} by a turn are taken out")
        return continuous, tuple(notes)

    def _turns(self, number: int) -> bool:
        return bool(np.any(joint_axis(self.model, number, "the URDF")[3:]))

    def check_limits(self, position: np.ndarray, name: str) -> None:
        """Refuse positions far beyond the URDF's limits: their units are mixed up.

        Args:
            position: of the recorded joints, (n, k).
            name: what messages call them.

        Raises:
            RunError: so it is.
        """
        for number, k in self.joints:
            if self.model.joints[number].nq != 1:
                continue
            at = self.model.joints[number].idx_q
            low, high = float(self.model.lowerPositionLimit[at]), float(self.model.upperPositionLimit[at])
            reached = float(max(low - position[:, k].min(), position[:, k].max() - high))
            if np.isfinite(high - low) and high > low and reached > high - low:
                least, most = position[:, k].min(), position[:, k].max()
                raise RunError(
                    f"joint {quoted(self.model.names[number])} of {name} goes from {least:.4g} to {most:.4g}, far "
                    f"beyond its limits in the URDF, {low:.4g} to {high:.4g}: record positions in rad or m"
                )

    def check_velocities(self, t: np.ndarray, position: np.ndarray, velocity: np.ndarray, name: str) -> None:
        """Refuse velocities that are not the rate of the positions: units are mixed up. Gaps tell nothing.

        Args:
            t: instants [s], (n,), increasing.
            position: of the recorded joints, (n, k).
            velocity: the same.
            name: what messages call them.

        Raises:
            RunError: so it is.
        """
        columns, steps = [k for _, k in self.joints], np.diff(t)
        near = steps <= GAP * np.median(steps)
        travelled = np.diff(position[:, columns], axis=0)[near]
        integrated = (0.5 * (velocity[1:] + velocity[:-1])[:, columns] * steps[:, None])[near]
        power = float((travelled**2).sum())
        ratio = float((integrated * travelled).sum()) / power if power > 0 else 1.0
        if abs(ratio - 1) > UNLIKE:
            raise RunError(
                f"velocities of {name} are {ratio:.3g} times the rate of its positions: record both in rad and "
                "rad/s, of the same joints, or remove the velocities"
            )

    def angular_velocity(self, position: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """Return the frame's angular velocity in its own axes [rad/s], (n, 3), of recorded joints (n, k)."""
        columns = [k for _, k in self.joints]
        rows = zip(position, velocity[:, columns], strict=True)
        return np.array([self.jacobian(at) @ speed for at, speed in rows]).reshape(-1, 3)

    def specific_force(
        self, position: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray, gravity: np.ndarray
    ) -> np.ndarray:
        """Return what an accelerometer at the frame's origin reads, in the frame's own axes [m/s²], (n, 3).

        Args:
            position: of the recorded joints, (n, k).
            velocity: the same.
            acceleration: the same.
            gravity: along the axes of the base, which rests [m/s²].
        """
        import pinocchio

        columns, readings = [k for _, k in self.joints], np.empty((len(position), 3))
        speed, slope = np.zeros((2, self.model.nv))
        for k in range(len(position)):
            speed[self._moving], slope[self._moving] = velocity[k, columns], acceleration[k, columns]
            pinocchio.forwardKinematics(self.model, self.data, self._configuration(position[k]), speed, slope)
            pinocchio.updateFramePlacement(self.model, self.data, self.frame)
            frame_arguments = self.model, self.data, self.frame, pinocchio.LOCAL
            turn = self.data.oMf[self.frame].rotation
            readings[k] = pinocchio.getFrameClassicalAcceleration(*frame_arguments).linear - turn.T @ gravity
        return readings

    def attitude(self, position: np.ndarray) -> np.ndarray:
        """Return the rotations from the frame's axes to the base's, (n, 3, 3), at recorded positions (n, k)."""
        import pinocchio

        turns = np.empty((len(position), 3, 3))
        for k in range(len(position)):
            pinocchio.forwardKinematics(self.model, self.data, self._configuration(position[k]))
            turns[k] = pinocchio.updateFramePlacement(self.model, self.data, self.frame).rotation
        return turns

    def spread(self, position: np.ndarray, sigma: np.ndarray) -> np.ndarray:
        """Return the frame's angular noise on each axis, root mean square, of the joints' own noise (k,)."""
        joint_sigma = sigma[[k for _, k in self.joints]]
        step = max(len(position) // 200, 1)
        squares = [self.jacobian(at) ** 2 @ joint_sigma**2 for at in position[::step]]
        return np.sqrt(np.mean(squares, axis=0))

    @property
    def _moving(self) -> list[int]:
        """Return the indices of the model's speeds that belong to the joints that move the frame."""
        return [self.model.joints[number].idx_v for number, _ in self.joints]

    def _configuration(self, position: np.ndarray) -> np.ndarray:
        """The model's configuration at recorded positions (k,)."""
        import pinocchio

        q = pinocchio.neutral(self.model)
        for number, k in self.joints:
            at = self.model.joints[number].idx_q
            if self.model.joints[number].nq == 2:  # a continuous joint, which Pinocchio keeps as cosine and sine
                q[at], q[at + 1] = np.cos(position[k]), np.sin(position[k])
            else:
                q[at] = position[k]
        return np.asarray(q)


def _recorded_names(joints: list[str], names: tuple[str, ...]) -> tuple[dict[str, str], tuple[str, ...]]:
    """The recorded name of each joint of the URDF, without or with a prefix that all have; a note on the prefix."""
    missing = next((joint for joint in joints if joint not in names), None)
    if missing is None:
        return {joint: joint for joint in joints}, ()
    longer = {name.removesuffix(missing) for name in names if name.endswith(missing)}
    shorter = {missing.removesuffix(name) for name in names if name and missing.endswith(name)}
    fitting = [(prefix, {joint: prefix + joint for joint in joints}, "recorded") for prefix in sorted(longer)] + [
        (prefix, {joint: joint.removeprefix(prefix) for joint in joints}, "URDF's") for prefix in sorted(shorter)
    ]
    fitting = [entry for entry in fitting if set(entry[1].values()) <= set(names)]
    if len(fitting) != 1:  # none, or two robots on one topic
        return {joint: joint for joint in joints}, ()
    prefix, recorded, whose = fitting[0]
    return recorded, (f"the joints are matched by name without the {whose} prefix {quoted(prefix)}",)
