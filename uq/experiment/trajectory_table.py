"""``[trajectory.NAME]`` of an experiment file: how the platform moves, for how long, at which sample rate."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

import numpy as np
from jaxtyping import Array, Float

from identify.motion.trajectory import Harmonic, Motion, Sphere, Trajectory
from rig.toml_tables import TomlTable, WrongKeyError
from uq.experiment.multisine_table import read_multisine
from uq.files.schema import in_unit

MOST_SAMPLES = 100_000_000


@dataclass(frozen=True)
class TrajectorySpec:
    """A trajectory and how it is sampled and carried."""

    trajectory: Trajectory
    duration: float
    """Duration of the trajectory [s]."""
    rate: float
    """Sample rate of load cell and IMU [Hz]."""
    still: Literal["cg", "omb"]
    """The point that keeps still: the centre of gravity, or the platform's centre OMB."""


class MotionSamples(NamedTuple):
    """True motion of a body at uniform instants, samples first, in arrays of JAX."""

    t: Float[Array, " n"]
    """Uniform instants from the start [s]."""
    omega: Float[Array, "n 3"]
    """Angular velocity in B [rad/s]."""
    alpha: Float[Array, "n 3"]
    """Angular acceleration in B [rad/s²]."""
    specific_force: Float[Array, "n 3"]
    """Specific force of the centre of gravity, its acceleration less gravity, in B [m/s²]."""
    attitude: Float[Array, "n 3 3"]
    """Rotations from B to axes at rest, the third of which is up."""

    @classmethod
    def of(cls, motion: Motion) -> "MotionSamples":
        """Return a motion, samples first."""
        return cls(motion.t, motion.omega.T, motion.alpha.T, motion.specific_force_cg.T, motion.rotation)


class TrajectoryTable(TomlTable, frozen=True, kw_only=True, tag_field="kind"):
    """Keys that all trajectories share."""

    SEGMENTS: ClassVar[int] = 1
    duration: Annotated[float, in_unit("s", above=0)]
    rate: Annotated[float, in_unit("Hz", above=0)]
    """Sample rate of load cell and IMU."""
    ramp: Annotated[float, in_unit("s", above=0)]
    """Time to start and to stop each motion."""

    def __post_init__(self) -> None:
        """Refuse ramps that leave no motion, and numbers of samples beyond sense."""
        segment = self.duration / self.SEGMENTS
        if 2 * self.ramp > segment:
            raise WrongKeyError("ramp", f"at most half of the {segment:g} s that a motion lasts", f"is {self.ramp:g} s")
        if self.duration * self.rate > MOST_SAMPLES:
            raise WrongKeyError("", f"has more than {MOST_SAMPLES:,} samples: lower duration or rate")
        if round(self.duration * self.rate) < 2:
            raise WrongKeyError("", "has fewer than two samples: raise duration or rate")


class RotationTable(TrajectoryTable, frozen=True, kw_only=True):
    """Turns about a point that keeps still."""

    still: Literal["cg", "omb"] = "cg"
    """The point that keeps still: the centre of gravity, or the platform's centre."""
    angular_velocity: Annotated[float, in_unit("rad/s", above=0)]
    """Amplitude of the angular velocity; of a sphere half its diameter."""
    angular_acceleration: Annotated[float, in_unit("rad/s^2", above=0)]
    """Amplitude of the angular acceleration; of a sphere half its diameter."""

    def spec(self, name: str, folder: Path) -> TrajectorySpec:
        """Return the trajectory of this name."""
        figures = self.angular_velocity, self.angular_acceleration, self.duration, self.ramp
        return TrajectorySpec(self.trajectory(*map(np.array, figures)), self.duration, self.rate, self.still)

    def trajectory(self, *figures: Any) -> Trajectory:
        """Return the trajectory in closed form of these sizes of angular velocity and acceleration, duration, ramp."""
        raise NotImplementedError


class SphereTable(RotationTable, frozen=True, kw_only=True, tag="sphere"):
    """Angular velocity and acceleration of constant size whose directions cover a sphere."""

    precessions: int
    """Turns about the pole."""
    pole: Literal["b1", "b2", "b3"] = "b2"
    """The body's axis about which the motion precesses."""

    def trajectory(self, *figures: Any) -> Trajectory:
        """Return the trajectory in closed form, from figures and keys."""
        turns: Any = np.array(float(self.precessions)), ("b1", "b2", "b3").index(self.pole)
        return Sphere(*figures, *turns)


class HarmonicTable(RotationTable, frozen=True, kw_only=True, tag="harmonic"):
    """Harmonic turns about the three axes, one after another."""

    SEGMENTS: ClassVar[int] = 3

    def trajectory(self, *figures: Any) -> Trajectory:
        """Return the trajectory in closed form, from figures."""
        return Harmonic(*figures)


class MultisineTable(TrajectoryTable, frozen=True, kw_only=True, tag="multisine"):
    """Sines of several frequencies in the pose of the platform's centre."""

    still: Literal["omb"] = "omb"
    """A multisine carries the platform's centre."""
    amplitudes: str
    """A table of amplitudes in a file beside the experiment."""

    def spec(self, name: str, folder: Path) -> TrajectorySpec:
        """Return the trajectory of this name, its amplitudes from a file in the folder.

        Raises:
            ExperimentError: the file is missing or holds no amplitudes.
        """
        ends = {"duration": np.array(self.duration), "ramp": np.array(self.ramp)}
        trajectory = read_multisine(f"trajectory.{name}.amplitudes", folder / self.amplitudes, **ends)
        return TrajectorySpec(trajectory, self.duration, self.rate, self.still)
