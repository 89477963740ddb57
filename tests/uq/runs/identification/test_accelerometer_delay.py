"""An accelerometer with a slower filter than the gyro's: it is named, not the gyro, and its key leads to the truth."""

import re

import numpy as np
import pytest

from identify.exceptions import RunError
from identify.judge.conventions.findings.accelerometer_delay import AccelerometerLags
from tests.helpers.laboratory import measure
from tests.helpers.laboratory_files import document, identified_files, source, write
from uq.cli.main import main
from uq.experiment.experiment import Experiment
from uq.files.mistakes import ExperimentError
from uq.runs.inspection.experiment_findings import experiment_findings
from uq.runs.inspection.topic_finding import topic_finding
from uq.runs.recorded.load_run import load_run

pytestmark = pytest.mark.usefixtures("undrawn")
GYRO, BESIDE = np.sqrt(2) / (2 * np.pi * 90), np.sqrt(2) / (2 * np.pi) * (1 / 20 - 1 / 90)
"""Delays of a filter of second order at 90 Hz, and of one at 20 Hz beside it [s]."""
FILTERS = {"imu_filter": GYRO, "accelerometer_filter": BESIDE, "seconds": 20.0}
DECLARED = {"delay": f"{float(GYRO)!r} s", "sigma_delay": "0.3 ms"}


def told(text):
    """The delay that a finding's line declares, and the line [s]."""
    value = re.search(r'set accelerometer_delay = "(\S+) ms" in \[recording\]', text)[1]
    return float(value) / 1e3, {"accelerometer_delay": f"{value} ms"}


def judged(measured, folder, **recording):
    experiment = Experiment.from_dict(document(measured, **recording))
    return experiment_findings(load_run(write(folder / "run.mcap", measured), experiment.recording), experiment)


def test_the_accelerometers_delay_is_named_and_its_key_leads_to_the_truth(tmp_path):
    measured = measure(3, **FILTERS)
    before = identified_files(measured, tmp_path, "joint", recording=DECLARED)
    assert not [text for text in before.warnings if "gyro's axes" in text or "removed by the driver" in text]
    named = next(text for text in before.warnings if "(accelerometer delay)" in text)
    lag = float(re.search(r"lagged behind the gyro by (\S+) ", named)[1])
    assert lag == pytest.approx(1e3 * BESIDE, abs=0.3)
    assert "set accelerometer_delay in [recording]" in named
    cured = identified_files(measured, tmp_path, "joint", recording=DECLARED | {"accelerometer_delay": f"{lag} ms"})
    assert cured.warnings == ()
    assert cured.consistency == ()
    assert (np.abs(cured.inertia - measured.truth) < np.ptp(cured.interval95, axis=1)).all()


@pytest.mark.parametrize("method", ["source", pytest.param("gls", marks=pytest.mark.slow)])
@pytest.mark.slow
def test_least_squares_need_no_accelerometer_and_blame_no_gyro(tmp_path, method):
    late = source("late", "omega", "delay", 3e-4) | {"mean": f"{float(GYRO)!r} s"}
    result = identified_files(measure(3, **FILTERS), tmp_path, method, [late])
    assert result.consistency == ()


@pytest.mark.parametrize(
    "filters",
    [
        FILTERS,
        pytest.param({"accelerometer_filter": 4.5e-3}, marks=pytest.mark.slow),
        pytest.param({"accelerometer_filter": 0.0225}, marks=pytest.mark.slow),
    ],
)
def test_inspection_names_the_accelerometers_delay_in_place_of_a_weight(tmp_path, filters):
    measured = measure(3, **filters)
    (finding,) = judged(measured, tmp_path)
    assert finding.kind == "accelerometer delay"
    lag, cure = told(finding.text)
    assert lag == pytest.approx(filters["accelerometer_filter"], abs=5e-4)
    assert judged(measured, tmp_path, **cure) == []
    lags = AccelerometerLags(topic=finding.topic, lag=lag)
    assert topic_finding(lags, imported=True) == finding  # a map has no such key


@pytest.mark.parametrize("delay", [-0.02, *(pytest.param(delay, marks=pytest.mark.slow) for delay in (0.02, 0.04))])
def test_a_delay_of_the_whole_imu_is_none_of_the_accelerometer(tmp_path, delay):
    assert judged(measure(3, imu_delay=delay, seconds=20.0), tmp_path) == []


def test_a_delay_without_an_accelerometer_is_refused(tmp_path, capsys):
    measured = measure(3, seconds=5.0)
    measured.acceleration[:] = 0.0
    path, content = write(tmp_path / "run.mcap", measured), document(measured, accelerometer_delay="5 ms")
    with pytest.raises(RunError, match=r"holds no accelerometer's specific force: remove it"):
        load_run(path, Experiment.from_dict(content).recording)
    with pytest.raises(ExperimentError, match="accelerometer_delay"):
        Experiment.from_dict(document(measured, accelerometer_delay="11 s"))
    (tmp_path / "e.toml").write_text('[recording]\nwrench = "on_body"\naccelerometer_delay = "5 ms"\n')
    assert main(["inspect", str(path), "--experiment", str(tmp_path / "e.toml")]) == 2
    assert capsys.readouterr().err.startswith("error: recording.accelerometer_delay is declared, and /imu in run.mcap")
