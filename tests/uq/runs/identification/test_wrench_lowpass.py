"""A wrench behind a low-pass: its corner is named, and what is declared is undone; both intervals hold the truth."""

import re

import numpy as np
import pytest

from identify.judge.conventions.convention_fit import ImuSignal, WrenchSignal
from identify.judge.conventions.findings.filter import filter_findings
from identify.rigid_body.inertia import pack
from tests.helpers import posed_runs
from uq.runs.identification.identify_files import identify_files
from uq.runs.inspection.experiment_findings import experiment_findings
from uq.runs.recorded.load_run import load

CORNER = 3.0


@pytest.fixture(scope="module")
def clean():
    return posed_runs.measured(3, seconds=12.0, rate=100.0)


def test_the_corner_that_is_named_leads_to_the_body(tmp_path, clean):
    """The IMU's delay is exact, as of a robot's own clock, and takes nothing up."""
    filtered = posed_runs.CONVENTIONS["low_passed_at_3_Hz"](clean)
    path = posed_runs.write(tmp_path / "run", filtered, "joints", "mcap")
    experiment = posed_runs.experiment(tmp_path, "joints", sigma_delay="0 s")
    (finding,) = experiment_findings(load(path, experiment.recording, band=posed_runs.BAND).run, experiment)
    named = re.search(r'wrench_lowpass = "(\S+) Hz" in \[recording\]', str(finding))[1]
    assert float(named) == pytest.approx(CORNER, rel=0.02)
    cured = posed_runs.experiment(tmp_path, "joints", sigma_delay="0 s", wrench_lowpass=f"{named} Hz")
    result = identify_files(path, cured)
    assert result.warnings == ()
    assert abs(result.mass - posed_runs.MASS) < 3 * result.mass_uncertainty
    assert (np.abs(result.inertia - pack(posed_runs.TENSOR)) < 4 * result.standard_uncertainty).all()
    assert result.mass_uncertainty < 2e-3


@pytest.mark.parametrize("late", [-0.02, 0.0, 0.02])
def test_a_delay_is_no_filter_and_hides_none(clean, late):
    """Of any delay between wrench and motion the mean of the response is all that there is."""
    imu = ImuSignal(clean.t + late, clean.omega, clean.specific_force)
    assert list(filter_findings(WrenchSignal(clean.t, clean.force, clean.moment), imu, "/wrench")) == []
    filtered = posed_runs.CONVENTIONS["low_passed_at_3_Hz"](clean)
    (finding,) = filter_findings(WrenchSignal(clean.t, filtered.force, filtered.moment), imu, "/wrench")
    assert 2 * np.pi * finding.time_constant == pytest.approx(1 / CORNER, rel=0.05)


@pytest.mark.parametrize("late", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_of_a_slow_motion_delay_and_low_pass_are_both_named(tmp_path, monkeypatch, late):
    """The lag of 5 Hz looked like a turn of the axes by 0.7 deg; the cure that is right leads to the mass."""
    angles = posed_runs._angles
    monkeypatch.setattr(posed_runs, "_angles", lambda t, seed, seconds: angles(t / 2, seed, seconds / 2))
    run = posed_runs.measured(0, seconds=24.0, rate=100.0)
    lag = 1 / (2 * np.pi * 5.0)
    spoiled = posed_runs.replace(run, wrench_late=-lag) if late else posed_runs._low_passed(5.0)(run)
    path = posed_runs.write(tmp_path / "run", spoiled, "imu", "mcap")
    experiment = posed_runs.experiment(tmp_path, "imu")
    (finding,) = experiment_findings(load(path, experiment.recording, marks=False).run, experiment)
    named = re.search(
        r'set delay = "-(\S+) s" .* or wrench_lowpass = "(\S+) Hz" .*larger by about 0.07 %', str(finding)
    )
    assert float(named[1]) == pytest.approx(lag, rel=0.05)
    assert float(named[2]) == pytest.approx(5.0, rel=0.05)
    keys = {"delay": f"-{named[1]} s"} if late else {"wrench_lowpass": f"{named[2]} Hz"}
    result = identify_files(path, posed_runs.experiment(tmp_path, "imu", **keys))
    assert not [text for text in result.warnings if "suspicious" in text]
    assert abs(result.mass - posed_runs.MASS) < 3 * result.mass_uncertainty
    assert result.mass_uncertainty < 1e-3


@pytest.mark.slow  # at 3 Hz: above
def test_a_lag_is_named_where_the_delay_is_said_to_be_exact(tmp_path, clean):
    """At 10 Hz, twice the corner that the motion tells from a delay: the estimate did not converge, without a word of it."""
    path = posed_runs.write(tmp_path / "run", posed_runs._low_passed(10.0)(clean), "joints", "mcap")
    experiment = posed_runs.experiment(tmp_path, "joints", sigma_delay="0 s")
    (finding,) = experiment_findings(load(path, experiment.recording, band=posed_runs.BAND).run, experiment)
    named = re.search(r'or wrench_lowpass = "(\S+) Hz"', str(finding))[1]
    assert float(named) == pytest.approx(10.0, rel=0.05)
    free = posed_runs.experiment(tmp_path, "joints")
    assert experiment_findings(load(path, free.recording, band=posed_runs.BAND).run, free) == []
    cured = posed_runs.experiment(tmp_path, "joints", sigma_delay="0 s", wrench_lowpass=f"{named} Hz")
    result = identify_files(path, cured)
    assert result.warnings == ()
    assert abs(result.mass - posed_runs.MASS) < 3 * result.mass_uncertainty


def test_a_motion_behind_the_low_pass_is_not_said_to_be_the_wrench(clean):
    filtered = posed_runs.CONVENTIONS["low_passed_at_3_Hz"](
        posed_runs.replace(clean, force=clean.omega, moment=clean.specific_force)
    )
    imu = ImuSignal(clean.t, filtered.force, filtered.moment)
    assert list(filter_findings(WrenchSignal(clean.t, clean.force, clean.moment), imu, "/wrench")) == []
