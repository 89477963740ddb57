"""Gyro and accelerometer in two Imu topics: used together, each at its own stamps."""

import numpy as np
import pytest

from rig.exceptions import RigError
from tests.helpers import posed_runs
from uq.runs.identification.identify_files import identify_files
from uq.runs.inspection.inspect_run import inspect_run
from uq.runs.recorded.load_run import load


@pytest.fixture(scope="module")
def clean():
    return posed_runs.measured(3, seconds=8.0, rate=100.0)


@pytest.mark.parametrize(
    "keys",
    [
        {},
        pytest.param({"motion_topic": "/motion"}, marks=pytest.mark.slow),
        {"motion_topic": "/motion", "accelerometer_topic": "/accelerometer"},
    ],
)
def test_both_are_used_at_their_own_stamps(tmp_path, clean, keys):
    path = posed_runs.write(tmp_path / "run", clean, "apart", "mcap")
    experiment = posed_runs.experiment(tmp_path, "apart", **keys)
    assert inspect_run(path).findings == inspect_run(path, experiment).findings == []
    recorded = load(path, experiment.recording, marks=False)
    between = recorded.run.specific_force[50:-50]
    truth = np.stack([np.interp(recorded.run.t, clean.t, column) for column in clean.specific_force.T], axis=1)[50:-50]
    assert np.abs(between - truth).max() < 6 * posed_runs.NOISE["accelerometer"]
    assert "the acceleration that of /accelerometer" in " ".join(recorded.assumptions)
    result = identify_files(path, experiment)
    assert result.mass == pytest.approx(posed_runs.MASS, abs=4e-3)
    assert result.warnings == ()


def test_a_topic_that_is_not_there_is_named(tmp_path, clean):
    path = posed_runs.write(tmp_path / "run", clean, "apart", "mcap")
    wrong = posed_runs.experiment(tmp_path, "apart", motion_topic="/motion", accelerometer_topic="/acc")
    with pytest.raises(RigError, match=r"no topic /acc in .*choose one of /accelerometer, /motion"):
        load(path, wrong.recording, marks=False)
