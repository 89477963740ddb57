"""MuJoCo's body on a moving base, with MuJoCo's own sensors, written by rosbags, identified by the command."""

import json

import mujoco
import numpy as np
import pytest
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as RosbagWriter
from rosbags.typesys import Stores, get_typestore
from scipy.integrate import solve_ivp

from uq.cli.main import main

MODEL = """
<mujoco>
  <compiler angle="radian"/>
  <option gravity="0 0 -9.81"/>
  <worldbody>
    <body name="plate" pos="0 0 1">
      <freejoint/>
      <geom type="cylinder" size="0.2 0.01" mass="8"/>
      <body name="load" pos="0.01 -0.02 0.06">
        <inertial pos="0.012 -0.008 0.053" mass="19.7" fullinertia="0.3813 0.0185 0.3791 0.004 -0.006 0.002"/>
        <geom type="box" size="0.02 0.02 0.02" mass="0"/>
        <site name="Q" pos="0 0 0"/>
      </body>
    </body>
  </worldbody>
  <sensor>
    <force site="Q"/>
    <torque site="Q"/>
    <gyro site="Q"/>
    <accelerometer site="Q"/>
  </sensor>
</mujoco>
"""
INERTIA = {"I11": 0.3813, "I22": 0.0185, "I33": 0.3791, "I12": 0.004, "I13": -0.006, "I23": 0.002}
EXPERIMENT = """
[body]
r_cg_from_q = ["12 mm", "-8 mm", "53 mm"]

[[estimator]]
name = "smoothed"
differentiator = "savitzky-golay"
band = "1.2 Hz"

[recording]
wrench = "{wrench}"
"""
RATE = 500.0


def angular_velocity(t):
    phase = 2 * np.pi * np.multiply.outer(t, [0.9, 1.1, 0.7])
    return 0.5 * np.sin(phase + [0.0, 1.0, 2.0]) + 0.2 * np.cos(0.6 * phase)


def angular_acceleration(t, h=1e-5):
    return (angular_velocity(t + h) - angular_velocity(t - h)) / (2 * h)


def mujoco_signals():
    """Force, moment, angular velocity and specific force as MuJoCo's sensors give them, (n, 12), and the instants."""
    model = mujoco.MjModel.from_xml_string(MODEL)
    data = mujoco.MjData(model)
    t = np.arange(0, 30, 1 / RATE)

    def slope(time, q):
        w = angular_velocity(np.array(time))
        x, y, z = w
        return 0.5 * np.array([[0, -x, -y, -z], [x, 0, z, -y], [y, -z, 0, x], [z, y, -x, 0]]) @ q

    attitude = solve_ivp(slope, (0, t[-1]), [1.0, 0, 0, 0], t_eval=t, rtol=1e-10, atol=1e-10).y.T
    swing = 2 * np.pi * np.array([0.5, 0.8, 0.3])
    readings = []
    for time, q in zip(t, attitude, strict=True):
        data.qpos[:] = [*(0.05 * np.sin(swing * time)), *(q / np.linalg.norm(q))]
        data.qvel[:] = [*(0.05 * swing * np.cos(swing * time)), *angular_velocity(time)]
        data.qacc[:] = [*(-0.05 * swing**2 * np.sin(swing * time)), *angular_acceleration(time)]
        mujoco.mj_inverse(model, data)
        readings.append(data.sensordata.copy())
    return t, np.array(readings)


def write_with_rosbags(folder, t, readings):
    """Write the run as a rosbag2 folder with MCAP storage; return the MCAP file."""
    types = get_typestore(Stores.ROS2_HUMBLE)
    wrench_type, imu_type = "geometry_msgs/msg/WrenchStamped", "sensor_msgs/msg/Imu"
    vector, header = types.types["geometry_msgs/msg/Vector3"], types.types["std_msgs/msg/Header"]
    time_type, wrench = types.types["builtin_interfaces/msg/Time"], types.types["geometry_msgs/msg/Wrench"]
    level = types.types["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0)
    unknown = np.array([-1.0, *[0.0] * 8])
    with RosbagWriter(folder, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        wrenches = writer.add_connection("/ft_sensor/raw", wrench_type, typestore=types)
        imus = writer.add_connection("/imu/data", imu_type, typestore=types)
        for time, row in zip(t, readings, strict=True):
            stamp = 1_700_000_000_000_000_000 + round(time * 1e9)
            head = header(stamp=time_type(stamp // 10**9, stamp % 10**9), frame_id="cell")
            parts = [vector(*map(float, row[k : k + 3])) for k in (0, 3, 6, 9)]
            message = types.types[wrench_type](header=head, wrench=wrench(force=parts[0], torque=parts[1]))
            writer.write(wrenches, stamp, types.serialize_cdr(message, wrench_type))
            message = types.types[imu_type](head, level, unknown, parts[2], unknown, parts[3], unknown)
            writer.write(imus, stamp, types.serialize_cdr(message, imu_type))
    return next(folder.glob("*.mcap"))


@pytest.fixture(scope="module")
def signals():
    return mujoco_signals()


@pytest.mark.parametrize(("wrench", "sign"), [("on_body", 1.0), ("on_sensor", -1.0)])
def test_mujocos_body_is_identified(tmp_path, signals, wrench, sign, capsys):
    t, readings = signals
    # At rest MuJoCo's force sensor reads the weight upward: the force on the load.
    assert readings[:, 2].mean() == pytest.approx(19.7 * 9.81, rel=0.1)
    run = write_with_rosbags(tmp_path / "bag", t, readings * np.r_[np.full(6, sign), np.ones(6)])
    experiment = tmp_path / "e.toml"
    experiment.write_text(EXPERIMENT.format(wrench=wrench))
    out = tmp_path / "out"
    assert main(["identify", str(run), "--experiment", str(experiment), "--out", str(out)]) == 0
    assert "I33" in capsys.readouterr().out
    found = json.loads((out / "result.json").read_text())["inertia"]
    for name, true in INERTIA.items():
        i, j = int(name[1]), int(name[2])
        scale = np.sqrt(INERTIA[f"I{i}{i}"] * INERTIA[f"I{j}{j}"])
        assert abs(found[name] - true) <= 0.002 * scale, name
