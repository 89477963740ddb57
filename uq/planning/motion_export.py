"""A trajectory as files that platforms read: made, read back and checked against the motion."""

import dataclasses
import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from identify.compiled_program import CompiledProgram
from identify.motion.leg_limits import platform_motion
from identify.motion.multisine import Multisine
from identify.motion.stewart_platform import Pose, StewartPlatform, lengths
from identify.motion.trajectory import Harmonic, Sphere, Trajectory
from identify.reporting import Result
from uq.experiment.experiment import Experiment, ExperimentError, TrajectorySpec
from uq.planning.motion_formats import (
    CSV_COLUMNS,
    MOOG_DOFS,
    NEW_POSITION,
    ORDER,
    PI_AXES,
    Commanded,
    csv,
    moog_packets,
    pi_waves,
    read_csv,
    read_moog_packets,
    read_pi_waves,
)

FINE, RATE, MOOG_RATE = 600, 100, 60
"""Instants a second at which the attitude is integrated, of table and waves, and of Moog's packets [Hz]."""
EXACT, SINGLE = 2e-9, 2e-6
"""Largest differences of a read position [m] or attitude [rad] from the motion: in decimals, and in single
precision."""
MEANING = {
    "frames": "A: earth, z up; B: platform, parallel to A at home; x y z: platform centre OMB from home, in A",
    "rotation": "R_AB = Rz(yaw) Ry(pitch) Rx(roll) takes components in B to components in A; q is the same rotation",
    "rotation_order": f"{ORDER}, about turned axes: z by yaw, y' by pitch, x'' by roll; right-handed",
    "legs": "between the centres of the joints, leg 1 to 6 as in the experiment",
}


@dataclass(frozen=True, repr=False)
class MotionExport(Result):
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

    def files(self) -> dict[str, bytes]:
        """Return the files' bytes by name."""
        return dict(self.contents)

    def write(self, folder: str | Path) -> None:
        """Write the files into a folder, all or none; a file of the same name is replaced.

        Raises:
            OSError: the folder cannot be made or written.
        """
        from uq.files.output_folder import place

        place(self.contents, Path(folder))

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
    platform = experiment.platform
    for what, share in (("speed", speed), ("amplitude", amplitude)):
        if not 0 < share <= 1:
            raise ExperimentError(f"a rehearsal at {share:g} of the {what}: give a part above 0 and at most 1")
    motion = commanded(experiment, spec, speed=speed, amplitude=amplitude)
    table, packets = motion.every(FINE // RATE), motion.every(FINE // MOOG_RATE)
    contents = {f"{name}.csv": csv(table), f"{name}.pi.txt": pi_waves(table), f"{name}.moog.bin": moog_packets(packets)}
    differences = _read_back(platform, contents, name, table, packets)
    about = _about(experiment, contents, name, {"speed": speed, "amplitude": amplitude}, differences)
    contents[f"{name}.json"] = (json.dumps(about, indent=2, ensure_ascii=False) + "\n").encode()
    return MotionExport(
        contents=contents, differences=differences, speed=speed, amplitude=amplitude, seconds=float(motion.t[-1]),
        name=name, provenance=experiment.inputs(),
    )  # fmt: skip


def commanded(experiment: Experiment, spec: TrajectorySpec, *, speed: float = 1.0, amplitude: float = 1.0) -> Commanded:
    """Return what a platform is commanded to run a trajectory, ``FINE`` times a second, its last instant at rest."""
    still = np.asarray(experiment.r_cg_from_omb) if spec.still == "cg" else np.zeros(3)
    step = FINE // np.gcd(RATE, MOOG_RATE)  # so that every format ends at the same instant, at rest
    count = int(np.ceil(spec.duration / speed * FINE / step)) * step + 1
    t = np.arange(count) / FINE
    platform = experiment.platform
    motion = platform_motion(platform, scaled(spec.trajectory, amplitude), jnp.asarray(t * speed), jnp.asarray(still))
    length = leg_lengths(platform, motion.pose)
    position = np.asarray(motion.pose.position) - np.asarray(platform.home)
    return Commanded(t, position, np.asarray(motion.pose.rotation), np.asarray(length))


@CompiledProgram
def leg_lengths(platform: StewartPlatform, poses: Pose) -> jax.Array:
    """Return the legs' lengths [m] in each of several poses, (poses, 6)."""
    return jax.vmap(lambda pose: lengths(platform, pose))(poses)


def scaled(trajectory: Trajectory, amplitude: float) -> Trajectory:
    """Return a trajectory of another amplitude at the same frequencies.

    Raises:
        ExperimentError: there is no such trajectory.
    """
    if amplitude == 1.0:
        return trajectory
    factor = np.array(amplitude)
    if isinstance(trajectory, Multisine):
        return dataclasses.replace(trajectory, cosine=factor * trajectory.cosine, sine=factor * trajectory.sine)
    if isinstance(trajectory, (Sphere, Harmonic)):
        return dataclasses.replace(
            trajectory,
            angular_velocity=factor * np.asarray(trajectory.angular_velocity),
            angular_acceleration=factor * np.asarray(trajectory.angular_acceleration),
        )
    raise ExperimentError(f"a {type(trajectory).__name__.lower()} has no amplitude: rehearse it at a lower speed")


def _read_back(
    platform: StewartPlatform, contents: Mapping[str, bytes], name: str, table: Commanded, packets: Commanded
) -> dict[str, float]:
    """Return the largest difference of each file from the motion.

    Raises:
        RuntimeError: too far.
    """
    from_csv, by_quaternion = read_csv(contents[f"{name}.csv"])
    from_pi = read_pi_waves(contents[f"{name}.pi.txt"], float(RATE))
    from_moog = read_moog_packets(contents[f"{name}.moog.bin"], float(MOOG_RATE))
    again = leg_lengths(
        platform, Pose(jnp.asarray(from_csv.position + np.asarray(platform.home)), jnp.asarray(by_quaternion))
    )
    differences = {
        f"{name}.csv": max(
            _apart(from_csv, table),
            float(np.abs(by_quaternion - table.rotation).max()),
            float(np.abs(from_csv.length - table.length).max()),
            float(np.abs(np.asarray(again) - table.length).max()),
        ),
        f"{name}.pi.txt": _apart(from_pi, table),
        f"{name}.moog.bin": _apart(from_moog, packets),
    }
    for file, difference in differences.items():
        if not difference < (SINGLE if file.endswith(".bin") else EXACT):
            raise RuntimeError(f"{file} is {difference:.3g} m or rad from the motion")
    return differences


def _apart(motion: Commanded, other: Commanded) -> float:
    """Largest difference of instant, position or attitude; infinite for another number of instants."""
    if motion.t.shape != other.t.shape:
        return np.inf
    pairs = ((motion.t, other.t), (motion.position, other.position), (motion.rotation, other.rotation))
    return max(float(np.abs(a - b).max()) for a, b in pairs)


def _about(
    experiment: Experiment,
    contents: Mapping[str, bytes],
    name: str,
    rehearsal: Mapping[str, float],
    differences: Mapping[str, float],
) -> dict[str, Any]:
    """The sidecar: what the files' numbers mean."""
    platform = experiment.platform
    csv_file, pi_file, moog_file = (f"{name}.{end}" for end in ("csv", "pi.txt", "moog.bin"))
    files: dict[str, dict[str, Any]] = {
        csv_file: {"rate_Hz": RATE, "columns": list(CSV_COLUMNS)},
        pi_file: {
            "rate_Hz": RATE,
            "tables": {str(k): {"axis": axis, "unit": unit} for k, (axis, unit) in enumerate(PI_AXES.items(), start=1)},
            "assumed": [
                "GCS 2 commands WAV … PNT of a hexapod controller; wave generators 1 to 6 are X Y Z U V W",
                "U V W are roll, pitch, yaw: R = Rz(W) Ry(V) Rx(U); the pivot point is OMB, zero is home",
                f"the wave generator puts out one point every {1 / RATE:g} s: set its table rate so",
            ],
        },
        moog_file: {
            "rate_Hz": MOOG_RATE,
            "packet": ["command word, u32", *(f"{dof}, f32" for dof in MOOG_DOFS), "spare, f32"],
            "byte_order": "big-endian",
            "units": {"rotation": "rad", "translation": "m"},
            "assumed": [
                f"degrees-of-freedom mode, command word {NEW_POSITION} (new position), one packet a datagram",
                "axes x forward, y right, z down: surge = x, lateral = -y, heave = -z, pitch and yaw with the other "
                "sign than in the table; R = Rz(yaw) Ry(pitch) Rx(roll) in these axes",
                "zero is home, and the motion base turns about OMB",
            ],
        },
    }
    return {
        **MEANING,
        **rehearsal,
        "home_m": np.asarray(platform.home).tolist(),
        "base_joints_m": np.asarray(platform.base).tolist(),
        "platform_joints_m": np.asarray(platform.joints).tolist(),
        "files": {
            file: {
                **content,
                "sha256": hashlib.sha256(contents[file]).hexdigest(),
                "largest_difference": differences[file],
            }
            for file, content in files.items()
        },
    }
