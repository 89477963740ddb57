"""Motion of a robot's link from that of its joints, by the robot's URDF, at many instants at once.

The recursion is that of :mod:`identify.motion.serial_arm.serial_chain`, which is JAX's for derivatives, here in NumPy:
nothing is compiled for a recording.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from identify.rigid_body.dynamics import acceleration_at
from identify.rigid_body.rotation import exponential
from identify.signals.run import RunError
from rig.exceptions import listed, quoted
from uq.experiment.recording_table import RecordingTable
from uq.files.mistakes import ExperimentError
from uq.runs.recorded.urdf_model import MovedLink, Pose, urdf_model

ONE_TURN = 2 * np.pi * (1 + 1e-6)
"""Range of an angle that is recorded within one turn [rad], with its rounding."""
GAP = 3.0
"""Step between samples over their median, beyond which their mean velocity does not tell the way."""
UNLIKE = 0.3
"""Departure from one, of recorded velocities over the rate of recorded positions, that no noise or delay makes."""


class FrameMotion(NamedTuple):
    """Motion of a frame at n instants, in its own axes."""

    omega: Float[np.ndarray, "n 3"]
    """Angular velocity of the frame [rad/s]."""
    specific_force: Float[np.ndarray, "n 3"]
    """Acceleration of the frame's origin less gravity [m/s²]."""


@dataclass(frozen=True)
class Chain:
    """The joints between a robot's base and a frame."""

    links: tuple[MovedLink, ...]
    """The links that move the frame, from the base."""
    frame: Pose
    """Pose of the frame in the last of them."""
    columns: tuple[int, ...]
    """Number of each one's joint among the recorded joints."""
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
        """
        if declared.urdf is None or declared.urdf_frame is None:
            raise ExperimentError(
                f"{topic} has joint states: declare the robot by recording.urdf and recording.urdf_frame, "
                "or name another recording.motion_topic"
            )
        model = urdf_model(declared.urdf, "recording.urdf")
        link = model.link_of(declared.urdf_frame, "recording.urdf_frame")
        moving = [joint for joint in model.joints_to(link) if joint.moves]
        joints = [joint.name for joint in moving]
        recorded, notes = _recorded_names(joints, names)
        for joint in moving:
            if recorded[joint.name] not in names:
                raise RunError(
                    f"joint {quoted(joint.name)} of {Path(declared.urdf).name} is not in {topic}: "
                    f"it has {listed(names)}"
                )
            if not joint.has_one_axis:
                raise RunError(f"joint {quoted(joint.name)} of {Path(declared.urdf).name} has several axes")
        links, frame = model.chain_to(link)
        return cls(tuple(links), frame, tuple(names.index(recorded[joint]) for joint in joints), notes)

    def unwrapped(self, position: np.ndarray) -> tuple[np.ndarray, tuple[str, ...]]:
        """Return positions without the jumps of angles that are recorded within one turn, and notes on them.

        Args:
            position: of the recorded joints, (n, k).
        """
        continuous, notes = position.copy(), []
        for link, k in zip(self.links, self.columns, strict=True):
            angle = position[:, k]
            if link.joint.slides or np.ptp(angle) > ONE_TURN:
                continue
            continuous[:, k] = np.unwrap(angle)
            if (continuous[:, k] != angle).any():
                notes.append(f"the jumps of joint {quoted(link.joint.name)} by a turn are taken out")
        return continuous, tuple(notes)

    def check_limits(self, position: np.ndarray, name: str) -> None:
        """Refuse positions far beyond the URDF's limits: their units are mixed up.

        Args:
            position: of the recorded joints, (n, k).
            name: what messages call them.

        Raises:
            RunError: so it is.
        """
        for link, k in zip(self.links, self.columns, strict=True):
            low, high = link.joint.range
            reached = float(max(low - position[:, k].min(), position[:, k].max() - high))
            if np.isfinite(high - low) and high > low and reached > high - low:
                least, most = position[:, k].min(), position[:, k].max()
                raise RunError(
                    f"joint {quoted(link.joint.name)} of {name} goes from {least:.4g} to {most:.4g}, far "
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
        columns, steps = list(self.columns), np.diff(t)
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

    def motion(
        self, position: np.ndarray, velocity: np.ndarray, acceleration: np.ndarray, gravity: np.ndarray
    ) -> FrameMotion:
        """Return the frame's angular velocity and what an accelerometer at its origin reads.

        Args:
            position: of the recorded joints, (n, k).
            velocity: the same.
            acceleration: the same.
            gravity: along the axes of the base, which rests [m/s²].
        """
        omega = alpha = np.zeros((len(position), 3))
        force = np.tile(-gravity, (len(position), 1))
        for number, (turn, at) in enumerate(self._poses(position)):
            force = force + acceleration_at(at, omega, alpha)
            omega, alpha, force = (np.einsum("...ji,...j->...i", turn, vector) for vector in (omega, alpha, force))
            if number < len(self.links):
                axis, k = self.links[number].axis, self.columns[number]
                along, rate = acceleration[:, k, None] * axis, velocity[:, k, None]
                if self.links[number].joint.slides:
                    force = force + along + 2 * rate * np.cross(omega, axis)
                else:
                    alpha, omega = alpha + along + rate * np.cross(omega, axis), omega + rate * axis
        return FrameMotion(omega, force)

    def angular_velocity(self, position: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """Return the frame's angular velocity in its own axes [rad/s], (n, 3), of recorded joints (n, k)."""
        return self.motion(position, velocity, np.zeros_like(position), np.zeros(3)).omega

    def attitude(self, position: np.ndarray) -> np.ndarray:
        """Return the rotations from the frame's axes to the base's, (n, 3, 3), at recorded positions (n, k)."""
        turns = np.tile(np.eye(3), (len(position), 1, 1))
        for turn, _ in self._poses(position):
            turns = turns @ turn
        return turns

    def spread(self, position: np.ndarray, sigma: np.ndarray) -> np.ndarray:
        """Return the frame's angular noise on each axis, root mean square, of the joints' own noise (k,)."""
        some = position[:: max(len(position) // 200, 1)]
        rates = np.zeros((len(self.columns), *some.shape))
        rates[range(len(self.columns)), :, self.columns] = sigma[list(self.columns), None]
        squares = (self.angular_velocity(some, rate) ** 2 for rate in rates)
        return np.sqrt(np.mean(sum(squares, np.zeros((len(some), 3))), axis=0))

    def _poses(self, position: np.ndarray) -> Iterator[Pose]:
        """Yield the pose of each link in the one before, then of the frame, at recorded positions (n, k)."""
        for link, k in zip(self.links, self.columns, strict=True):
            along = position[:, k, None] * link.axis
            if link.joint.slides:
                yield link.rotation, link.position + along @ link.rotation.T
            else:
                yield link.rotation @ exponential(along), link.position
        yield self.frame


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
