"""Messages that are stamped as they arrive, in bunches: named, refused, and stamped again by a declared rate."""

from dataclasses import replace

import numpy as np
import pytest

from identify.signals.run import Run, RunError
from rig.record.device_clock import bunches
from tests.helpers import posed_runs
from uq.cli.main import main
from uq.runs.identification.identify_files import identify_files
from uq.runs.recorded.load_run import load


@pytest.fixture(scope="module")
def clean():
    return posed_runs.measured(3, seconds=8.0, rate=100.0)


@pytest.fixture
def bunched(tmp_path, clean):
    return posed_runs.write(tmp_path / "run", posed_runs.in_bunches(clean), "imu", "mcap")


def test_inspect_and_identify_name_them_and_the_cure_leads_to_the_body(tmp_path, bunched, capsys):
    posed_runs.experiment(tmp_path, "imu")
    cure = 'bunches every 16 ms, stamped as they arrived, as from a serial port that waits so long: set wrench_rate = "100 Hz"'
    for options in ([], ["--experiment", str(tmp_path / "e.toml")]):
        main(["inspect", str(bunched), *options])
        assert cure in " ".join(capsys.readouterr().out.split())
    assert main(["identify", str(bunched), "--experiment", str(tmp_path / "e.toml")]) == 2
    assert cure in capsys.readouterr().err
    result = identify_files(bunched, posed_runs.experiment(tmp_path, "imu", wrench_rate="100 Hz"))
    assert result.mass == pytest.approx(posed_runs.MASS, abs=4e-3)
    assert result.warnings == ()
    assert main(["inspect", str(bunched), "--experiment", str(tmp_path / "e.toml")]) == 0
    assert "nothing suspicious" in capsys.readouterr().out


def test_a_rate_that_is_not_that_of_the_times_is_refused(tmp_path, bunched):
    with pytest.raises(RunError, match=r"wrench_rate is 90 Hz, and /wrench in run has 1\d\d\.?\d* Hz: correct it"):
        load(bunched, posed_runs.experiment(tmp_path, "imu", wrench_rate="90 Hz").recording, marks=False)


def test_the_motion_in_bunches_is_stamped_again_too(tmp_path, clean):
    """The wrench's samples as those of joints: the log has no other clock."""
    late = replace(clean, t=posed_runs.in_bunches(clean).arrives, arrives=clean.t)
    path = posed_runs.write(tmp_path / "run", late, "joints", "mcap")
    with pytest.raises(RunError, match='set motion_rate = "100 Hz"'):
        load(path, posed_runs.experiment(tmp_path, "joints").recording, band=3.0, marks=False)
    declared = posed_runs.experiment(tmp_path, "joints", motion_rate="100 Hz")
    run = load(path, declared.recording, band=3.0, marks=False).run
    path = posed_runs.write(tmp_path / "sound", clean, "joints", "mcap")
    sound = load(path, declared.recording, band=3.0, marks=False).run
    n = min(len(run.t), len(sound.t)) - 10
    assert np.abs(run.omega[:n] - sound.omega[:n]).max() < 0.02


@pytest.mark.parametrize("wait", [0.016, 0.02, 0.05])
@pytest.mark.parametrize("rate", [125.0, 500.0, 1000.0])
def test_bunches_tell_the_rate(rate, wait):
    t = np.arange(0, 20, 1 / rate)
    arrived = wait * np.ceil(t / wait) + 1e-6 * np.random.default_rng(1).uniform(size=len(t))
    told = bunches(np.sort(np.round(1e9 * arrived)).astype(np.int64))
    assert told.rate == rate
    assert told.interval == pytest.approx(wait, rel=0.1)


def test_samples_a_nanosecond_apart_leave_the_run_as_it_is(clean):
    """Two pairs of a thousand: the spline through both samples of a pair would leap by their noise over 1 ns."""
    t = clean.t.copy()
    t[[200, 500]] = t[[199, 499]] + 1e-9
    run = Run.from_channels(t, clean.force, clean.moment, clean.t, clean.omega)
    assert dict(run.left_out) == {"beside another": 2}
    assert np.abs(run.force).max() < 1.1 * np.abs(clean.force).max()
