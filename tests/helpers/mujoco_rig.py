"""A hexapod in MuJoCo: a body on its moving platform, MuJoCo's sensors, recordings that rosbags writes.

The platform's pose is prescribed; MuJoCo's inverse dynamics give what its force, torque, gyro and accelerometer sites
read. Nothing here is shared with the packages. SI units.
"""

from dataclasses import dataclass
from typing import NamedTuple

import mujoco
import numpy as np

from rig.channels import ImuChannel, WrenchChannel
from tests.helpers.bags import merged, write_rosbag2

RATE = 200.0
GRAVITY = 9.81
NOISE = np.repeat([0.1, 3e-3, 1e-3, 0.02], 3)
"""Standard deviation of a sample: force, moment, angular velocity, specific force."""
START = 1_700_000_000_000_000_000


@dataclass(frozen=True)
class Load:
    """What the load cell carries; the tensor is I11, I12, I13, I22, I23, I33 about the centre of gravity."""

    mass: float
    r_cg: tuple
    inertia: tuple

    def __add__(self, other):
        """Both, rigidly together: masses, first moments and tensors about one point add."""
        mass = self.mass + other.mass
        r_cg = (self.mass * np.array(self.r_cg) + other.mass * np.array(other.r_cg)) / mass
        tensor = sum(load._about(r_cg) for load in (self, other))
        return Load(mass, tuple(r_cg), tuple(tensor[np.triu_indices(3)]))

    def _about(self, point):
        i11, i12, i13, i22, i23, i33 = self.inertia
        d = np.subtract(self.r_cg, point)
        about_cg = np.array([[i11, i12, i13], [i12, i22, i23], [i13, i23, i33]])
        return about_cg + self.mass * (d @ d * np.eye(3) - np.outer(d, d))


class Rig(NamedTuple):
    """How the sensors are mounted: rotation vectors [rad] of their axes from the body's, and the IMU's place and delay."""

    imu_position: tuple = (0.08, -0.05, -0.03)
    imu_turn: tuple = (0.0, 0.0, 0.0)
    cell_turn: tuple = (0.0, 0.0, 0.0)
    delay: float = 0.0
    zeros: tuple = (0.0,) * 12
    force_gain: tuple = (0.0, 0.0, 0.0)


ALIGNED = Rig()
MODEL = """
<mujoco>
  <compiler angle="radian"/>
  <option gravity="0 0 -{gravity}"/>
  <worldbody>
    <body name="platform">
      <joint type="slide" axis="1 0 0"/><joint type="slide" axis="0 1 0"/><joint type="slide" axis="0 0 1"/>
      <joint type="hinge" axis="0 0 1"/><joint type="hinge" axis="0 1 0"/><joint type="hinge" axis="1 0 0"/>
      <geom type="cylinder" size="0.2 0.01" mass="8"/>
      <site name="imu" pos="{imu_position}" quat="{imu_turn}"/>
      <body name="load">
        <inertial pos="{r_cg}" mass="{mass}" fullinertia="{inertia}"/>
        <site name="Q" quat="{cell_turn}"/>
      </body>
    </body>
  </worldbody>
  <sensor><force site="Q"/><torque site="Q"/><gyro site="imu"/><accelerometer site="imu"/></sensor>
</mujoco>
"""


def numbers(values):
    return " ".join(f"{float(x):.15g}" for x in np.atleast_1d(values))


def quaternion(rotation_vector):
    angle = float(np.linalg.norm(rotation_vector))
    result = np.zeros(4)
    mujoco.mju_axisAngle2Quat(result, np.asarray(rotation_vector, float) / (angle or 1.0), angle)
    return result


def model_of(load, rig):
    i11, i12, i13, i22, i23, i33 = load.inertia
    return mujoco.MjModel.from_xml_string(
        MODEL.format(
            gravity=GRAVITY, mass=load.mass, r_cg=numbers(load.r_cg),
            inertia=numbers([i11, i22, i33, i12, i13, i23]), imu_position=numbers(rig.imu_position),
            imu_turn=numbers(quaternion(rig.imu_turn)), cell_turn=numbers(quaternion(rig.cell_turn)),
        )
    )  # fmt: skip


SIZE = np.array([0.03, 0.025, 0.02, 0.3, 0.25, 0.25])
"""Amplitudes of the platform's coordinates [m, rad]: three displacements, yaw, pitch, roll."""
LINES = np.array([[0.8, 1.9], [0.95, 1.7], [1.1, 1.6], [0.9, 1.8], [1.05, 2.0], [1.2, 1.5]])
"""Two frequencies of each [Hz]."""


def platform(t):
    """Coordinates, speeds and accelerations of the platform at an instant, six each; it starts and ends in motion."""
    k = np.arange(12).reshape(6, 2)
    angular, size = 2 * np.pi * LINES, SIZE[:, None] * [0.7, 0.3]
    phase = angular * t + 1.3 * k
    return (
        (size * np.sin(phase)).sum(axis=1),
        (size * angular * np.cos(phase)).sum(axis=1),
        (-size * angular**2 * np.sin(phase)).sum(axis=1),
    )


def readings(load, rig, states):
    """What the twelve channels read without zeros and noise, (n, 12), for coordinates, speeds and accelerations."""
    model = model_of(load, rig)
    data = mujoco.MjData(model)
    rows = []
    for data.qpos[:], data.qvel[:], data.qacc[:] in states:
        mujoco.mj_inverse(model, data)
        rows.append(data.sensordata.copy())
    return np.array(rows)


def moving(load, rig=ALIGNED, *, seconds=20.0, seed=1, noise=1.0):
    """A run: instants [s] and the twelve channels with zeros and so many times ``NOISE``."""
    t = np.arange(0, seconds, 1 / RATE)
    read = readings(load, rig, map(platform, t))
    if rig.delay:
        read[:, 6:] = readings(load, rig, map(platform, t - rig.delay))[:, 6:]
    read[:, :3] *= np.add(1, rig.force_gain)
    return t, read + rig.zeros + noise * NOISE * np.random.default_rng([18, seed]).normal(size=read.shape)


def write(folder, t, read):
    """The run as a rosbag2 folder of ROS 2 messages by rosbags; returns it."""
    stamp = START + np.round(1e9 * t).astype(np.int64)
    wrench = WrenchChannel("/ft_sensor/raw", "cell", stamp, stamp, read[:, :3], read[:, 3:6])
    imu = ImuChannel("/imu/data", "imu", stamp, stamp, read[:, 6:9], read[:, 9:])
    write_rosbag2(folder, merged(wrench, imu))
    return folder


def static_poses(load, rig, *, poses=12, seed=2):
    """Readings in each pose, (poses, 12), tilted about two axes by up to 20°."""
    rng = np.random.default_rng([19, seed])
    tilts = rng.uniform(-0.35, 0.35, (poses, 2))
    states = [(np.r_[0, 0, 0, 0, tilt], np.zeros(6), np.zeros(6)) for tilt in tilts]
    read = readings(load, rig, states)
    read[:, :3] *= np.add(1, rig.force_gain)
    return read + rig.zeros + NOISE * rng.normal(size=read.shape)


def write_poses(path, read):
    """A CSV of poses: force, moment, accelerometer."""
    head = "fx,fy,fz,tx,ty,tz,ax,ay,az"
    np.savetxt(path, read[:, [0, 1, 2, 3, 4, 5, 9, 10, 11]], delimiter=",", header=head, comments="")
    return path
