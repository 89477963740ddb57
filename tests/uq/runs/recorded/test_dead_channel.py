"""A channel that never changes while the others do: named with its topic and axis; of the load cell nothing is estimated."""

from dataclasses import replace

import numpy as np
import pytest

from identify.signals.run import RunError
from tests.helpers import posed_runs
from uq.runs.inspection.inspect_run import inspect_run
from uq.runs.recorded.load_run import load


@pytest.mark.parametrize("level", [0.0, 1.5])
@pytest.mark.parametrize(
    ("signal", "words"),
    [("force", "force"), ("moment", "moment"), ("omega", "angular velocity"), ("specific_force", "acceleration")],
)
def test_a_dead_channel_is_named(tmp_path, signal, words, level):
    run = posed_runs.measured(3, seconds=6.0, rate=100.0)
    values = getattr(run, signal).copy()
    values[:, 2] = level
    path = posed_runs.write(tmp_path / "run", replace(run, **{signal: values}), "imu", "mcap")
    text = f"{words} z stays at {level:g} throughout while the others change"
    experiment = posed_runs.experiment(tmp_path, "imu")
    for found in (inspect_run(path), inspect_run(path, experiment)):
        assert any(text in finding.text for finding in found.findings)
    if signal in ("force", "moment"):
        with pytest.raises(RunError, match=f"^run: /wrench: {text}"):
            load(path, experiment.recording, marks=False)
    else:
        assert any(
            f"/motion: {text}" in warning for warning in load(path, experiment.recording, marks=False).run.warnings
        )


@pytest.mark.parametrize(("signal", "level"), [("moment", 0.0), ("moment", 1.5), ("force", 1.5)])
def test_a_load_cell_that_holds_a_whole_vector_is_refused(tmp_path, signal, level):
    run = posed_runs.measured(3, seconds=6.0, rate=100.0)
    held = replace(run, **{signal: np.full((len(run.t), 3), level)})
    path = posed_runs.write(tmp_path / "run", held, "imu", "mcap")
    with pytest.raises(RunError, match=f"^the {signal} in run never changes: check load cell and driver"):
        load(path, posed_runs.experiment(tmp_path, "imu").recording, marks=False)


def test_a_vector_that_is_not_measured_is_no_dead_channel(tmp_path):
    run = posed_runs.no_accelerometer(posed_runs.measured(3, seconds=6.0, rate=100.0))
    path = posed_runs.write(tmp_path / "run", run, "imu", "mcap")
    assert inspect_run(path).findings == []
    assert np.ptp(load(path, posed_runs.experiment(tmp_path, "imu").recording, marks=False).run.omega) > 0
