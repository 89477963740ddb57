"""A robot's wrench along axes that rest, or without the payload's weight, is never taken for a load cell's silently."""

import dataclasses

import numpy as np
import pytest

from identify.signals.run import RunError
from rig import runs
from rig.inspection.inspect import inspect
from tests.helpers.rig_lab import JOINTS, joints_run
from tests.helpers.rig_samples import imu_channel, wrench_channel
from uq.experiment.recording_table import RecordingTable
from uq.runs.recorded.load_run import load_run

ROBOT = {"robot.topic": "/wrench", "robot.compensated": "gravity", "imu.topic": "/imu", "imu.compensated": "none"}


def written(path, *, frame="tool0", metadata=None):
    wrench, imu = wrench_channel(n=2000, frame=frame), imu_channel(n=2000)
    imu = dataclasses.replace(imu, stamp=wrench.stamp)
    runs.write(path, wrench=wrench, imu=imu, metadata={} if metadata is None else {"rig.run": metadata})
    return path


@pytest.mark.parametrize("frame", ["base", "/base", "world"])
def test_a_wrench_along_axes_that_rest_is_refused(tmp_path, frame):
    with pytest.raises(RunError, match=r"run\.mcap is along the axes of '\w+', which do not turn with the body"):
        load_run(written(tmp_path / "run.mcap", frame=frame))


def test_a_wrench_in_the_tools_frame_is_read(tmp_path):
    run = load_run(written(tmp_path / "run.mcap"))
    assert np.isfinite(run.force).all()


@pytest.mark.parametrize("declared", [None, "none"])
def test_a_removed_weight_that_the_experiment_does_not_know_of_is_refused(tmp_path, declared):
    path = written(tmp_path / "run.mcap", metadata=ROBOT)
    with pytest.raises(RunError, match='removed the weight of its payload: set compensated = "gravity"'):
        load_run(path, RecordingTable(compensated=declared))


def test_a_removed_weight_that_is_declared_is_read(tmp_path):
    load_run(written(tmp_path / "run.mcap", metadata=ROBOT), RecordingTable(compensated="gravity"))
    other = ROBOT | {"robot.compensated": "none"}
    load_run(written(tmp_path / "other.mcap", metadata=other))


def coaxial(path):
    """An arm whose joints, named as a robot's, all turn about one vertical axis."""
    links = "".join(f'<link name="link{k}"/>' for k in range(7))
    joint = (
        '<joint name="{name}" type="revolute"><parent link="link{k}"/><child link="link{next}"/><axis xyz="0 0 1"/>'
        '<limit lower="-9" upper="9" effort="1" velocity="9"/></joint>'
    )
    joints = "".join(joint.format(name=name, k=k, next=k + 1) for k, name in enumerate(JOINTS))
    path.write_text(f'<robot name="coaxial">{links}{joints}</robot>')
    return path


def test_the_joints_of_a_recorded_robot_tell_the_angular_velocity(tmp_path):
    """Joint k turns with k cos t, so the tool with 21 cos t."""
    joints_run(tmp_path / "run.mcap")
    urdf = coaxial(tmp_path / "arm.urdf")
    run = load_run(tmp_path / "run.mcap", RecordingTable(urdf=str(urdf), urdf_frame="link6"))
    np.testing.assert_allclose(run.omega[:, 2], 21 * np.cos(run.t), atol=1e-9)
    np.testing.assert_allclose(run.omega[:, :2], 0, atol=1e-9)
    kinds = [finding.kind for finding in inspect(tmp_path / "run.mcap").findings]
    assert kinds == []  # joints tell the motion: no IMU is missing
