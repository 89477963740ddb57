"""A trajectory as files that platforms read: made, read back and checked against the motion."""

import dataclasses
import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import jax.numpy as jnp
import numpy as np

from identify.display.reporting import Result
from identify.motion.euler_angles import ORDER
from identify.motion.leg_limits import leg_lengths
from identify.motion.stewart_platform import Pose
from uq.experiment.experiment import Experiment, ExperimentError, TrajectorySpec
from uq.files.output_folder import HasFiles
from uq.plan.measurement.platform_run import motion_at
from uq.plan.motion_design.commanded import PlatformCommand
from uq.plan.motion_design.motion_formats import MotionFile, formats, written

FINE = 600
"""Instants a second at which the attitude is integrated; a multiple of every format's rate [Hz]."""
MEANING = {
    "frames": "A: earth, z up; B: platform, parallel to A at home; x y z: platform centre OMB from home, in A",
    "rotation": "R_AB = Rz(yaw) Ry(pitch) Rx(roll) takes components in B to components in A; q is the same rotation",
    "rotation_order": f"{ORDER}, about turned axes: z by yaw, y' by pitch, x'' by roll; right-handed",
    "legs": "between the centres of the joints, leg 1 to 6 as in the experiment",
}


@dataclass(frozen=True, repr=False)
class MotionExport(HasFiles, Result):
    """Files of one motion, read back and checked, not yet written.

    Example: ``export_motion(experiment, experiment.trajectories["T1"]).write("folder")``.
    """

    contents: Mapping[str, bytes]
    """Bytes by file name."""
    differences: Mapping[str, float]
    """Largest difference between a file and the motion, by file name: position [m] or attitude [rad]."""
    speed: float
    """Factor on the motion's speed: below 1 in a rehearsal."""
    amplitude: float
    """Factor on the motion's amplitude."""
    seconds: float
    """Duration of what is exported [s]."""
    name: str = "motion"
    provenance: Mapping[str, Any] = field(default_factory=dict)

    def records(self) -> list[dict[str, Any]]:
        """Return bytes of each file, and how far it is from the motion: position [m] or attitude [rad]."""
        return [
            {"file": name, "bytes": len(content), "difference": self.differences.get(name, np.nan)}
            for name, content in self.contents.items()
        ]

    def to_dict(self) -> dict[str, Any]:
        """Return what result.json says."""
        return {
            "files": list(self.contents), "read_back": dict(self.differences), "speed": self.speed,
            "amplitude": self.amplitude, "seconds": self.seconds,
        }  # fmt: skip


def export_motion(
    experiment: Experiment,
    spec: TrajectorySpec,
    *,
    speed: float = 1.0,
    amplitude: float = 1.0,
    name: str = "motion",
) -> MotionExport:
    """Export a trajectory as poses and leg lengths, PI wave tables and Moog packets.

    Every file is read back, and what it says is compared with the motion and, through the inverse kinematics, with the
    legs' lengths.

    Args:
        experiment: with a platform whose legs are known.
        spec: the trajectory, and the point that keeps still.
        speed: part of the motion's own speed, the time stretched: the path stays, the legs' speeds shrink with it.
        amplitude: part of the motion's own amplitude, at its own frequencies.
        name: stem of the files.

    Raises:
        ExperimentError: the platform's legs are not stated, a part that is not above 0 and at most 1, or a trajectory
            whose amplitude cannot be changed.
        RuntimeError: a file does not say what it should.
    """
    for what, share in (("speed", speed), ("amplitude", amplitude)):
        if not 0 < share <= 1:
            raise ExperimentError(f"a rehearsal at {share:g} of the {what}: give a part above 0 and at most 1")
    command = commanded(experiment, spec, speed=speed, amplitude=amplitude)
    files = list(written(command, name))
    about = _about(experiment, files, {"speed": speed, "amplitude": amplitude})
    contents = {file.name: file.content for file in files}
    contents[f"{name}.json"] = (json.dumps(about, indent=2, ensure_ascii=False) + "\n").encode()
    return MotionExport(
        contents=contents, differences={file.name: file.difference for file in files}, speed=speed,
        amplitude=amplitude, seconds=float(command.t[-1]), name=name, provenance=experiment.inputs(),
    )  # fmt: skip


def commanded(
    experiment: Experiment, spec: TrajectorySpec, *, speed: float = 1.0, amplitude: float = 1.0
) -> PlatformCommand:
    """Return what a platform is commanded to run a trajectory, ``FINE`` times a second, its last instant at rest."""
    platform, home = experiment.platform, np.asarray(experiment.platform.home)
    rates = [motion_format.rate for motion_format in formats(PlatformCommand)]
    step = FINE // np.gcd.reduce(rates)  # so that every format ends at the same instant, at rest
    count = int(np.ceil(spec.duration / speed * FINE / step)) * step + 1
    t = np.arange(count) / FINE
    if amplitude != 1:
        spec = dataclasses.replace(spec, trajectory=spec.trajectory.scaled(amplitude))
    pose = motion_at(experiment, spec, t * speed).pose
    position, rotation = np.asarray(pose.position) - home, np.asarray(pose.rotation)

    def legs(position: np.ndarray, rotation: np.ndarray) -> np.ndarray:
        return np.asarray(leg_lengths(platform, Pose(jnp.asarray(position + home), jnp.asarray(rotation))))

    return PlatformCommand(t, position, rotation, np.asarray(leg_lengths(platform, pose)), legs)


def _about(experiment: Experiment, files: Sequence[MotionFile], rehearsal: Mapping[str, float]) -> dict[str, Any]:
    """The sidecar: what the files' numbers mean."""
    platform = experiment.platform
    return {
        **MEANING,
        **rehearsal,
        "home_m": np.asarray(platform.home).tolist(),
        "base_joints_m": np.asarray(platform.base).tolist(),
        "platform_joints_m": np.asarray(platform.joints).tolist(),
        "files": {
            file.name: {
                "rate_Hz": file.format.rate,
                **file.format.meaning,
                "sha256": hashlib.sha256(file.content).hexdigest(),
                "largest_difference": file.difference,
            }
            for file in files
        },
    }
