"""A robot's wrench along axes that rest, or without the payload's weight, is never taken for a load cell's silently."""

import dataclasses

import numpy as np
import pytest

from identify.signals.run import RunError
from rig import runs
from tests.rig_samples import imu_channel, wrench_channel
from uq.experiment.recording_table import Recording
from uq.recorded.load_run import load_run

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
        load_run(path, Recording(compensated=declared))


def test_a_removed_weight_that_is_declared_is_read(tmp_path):
    load_run(written(tmp_path / "run.mcap", metadata=ROBOT), Recording(compensated="gravity"))
    other = ROBOT | {"robot.compensated": "none"}
    load_run(written(tmp_path / "other.mcap", metadata=other))
