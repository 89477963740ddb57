"""What recordings tell of attitude and clocks beside the conformance rows: refusals, and readable times."""

from dataclasses import replace

import numpy as np
import pytest

from identify.exceptions import RunError
from rig import runs
from rig.toml_tables import TomlError
from tests.helpers import posed_runs
from uq.files.mistakes import ExperimentError
from uq.runs.identification.identify_files import identify_files
from uq.runs.inspection.experiment_findings import experiment_findings
from uq.runs.recorded.angular_velocity import recorded_attitude
from uq.runs.recorded.load_run import load_run

EXACT = {
    "sigma_delay": "0 s", "sigma_rotation": "0 deg", "sigma_gyro_bias": "0 rad/s", "sigma_accelerometer_bias": "0 m/s^2",
}  # fmt: skip
"""Joints have no errors of an IMU."""


@pytest.fixture(scope="module")
def short():
    return posed_runs.measured(1, seconds=4.0, rate=50.0)


def test_stamps_without_overlap_are_refused_with_both_ranges_and_the_cure(tmp_path, short):
    path = posed_runs.write(tmp_path / "run", posed_runs.booted_clock(short), "imu", "mcap")
    with pytest.raises(RunError, match=r"37\.000 s to .* 2025-06-15 15:06:40\.000 UTC .*time = \"log\"") as refused:
        load_run(path)
    assert "\n" not in str(refused.value)
    experiment = posed_runs.experiment(tmp_path, "imu", time="log")
    assert len(load_run(path, experiment.recording).t) == len(short.t)


def test_a_wrench_at_rest_without_an_attitude_is_refused(tmp_path, short):
    path = posed_runs.write(tmp_path / "run", posed_runs.wrench_at_rest(short), "imu", "mcap")
    experiment = posed_runs.experiment(tmp_path, "imu", wrench_frame="base")
    with pytest.raises(RunError, match="nothing in run gives the attitude that turns its wrench back"):
        load_run(path, experiment.recording)


def test_a_quaternion_that_stands_still_is_no_attitude(tmp_path, short):
    path = posed_runs.write(tmp_path / "run", short, "imu", "mcap")
    assert load_run(path).attitude is None
    beyond = replace(runs.read(path).imu, orientation=np.full((len(short.t), 4), 1e300))  # squares are no numbers
    assert recorded_attitude(beyond, beyond.stamp) is None


def test_a_declared_delay_of_the_clock_is_no_finding(tmp_path):
    run = posed_runs.clocks_apart(posed_runs.measured(1, seconds=6.0))
    path = posed_runs.write(tmp_path / "run", run, "imu", "mcap")
    experiment = posed_runs.experiment(tmp_path, "imu", delay="0.4 s")
    assert experiment_findings(load_run(path, experiment.recording), experiment) == []


@pytest.mark.parametrize(
    ("keys", "text"),
    [
        ({"payload_mass": "1 kg"}, "payload_mass"),
        ({"payload_mass": "1 kg", "payload_r_cg_from_q": ["0 mm", "0 mm", "0 mm"]}, 'set compensated = "gravity"'),
        ({"zero_frame": "base"}, 'set wrench_frame = "base"'),
    ],
)
def test_half_a_declaration_is_refused(tmp_path, keys, text):
    with pytest.raises((ExperimentError, TomlError), match=text):
        posed_runs.experiment(tmp_path, "imu", **keys)


def test_a_zero_along_axes_at_rest_is_estimated_with_mass_and_tensor(tmp_path):
    """Its parts look like weight: acceleration alone tells the mass."""
    path = posed_runs.write(tmp_path / "run", posed_runs.zero_at_rest(posed_runs.measured(3)), "joints", "mcap")
    experiment = posed_runs.experiment(tmp_path, "joints", **EXACT, wrench_frame="base", zero_frame="base")
    result = identify_files([path], experiment)
    body = result.parameters
    mass_and_centre, truth = np.array([body.mass, *body.r_cg]), np.array([posed_runs.MASS, *posed_runs.R_CG])
    assert (np.abs(mass_and_centre - truth) < 4 * np.sqrt(np.diag(body.covariance)[:4])).all()
    assert (np.abs(result.inertia - posed_runs.TENSOR[np.triu_indices(3)]) < 4 * result.standard_uncertainty).all()
    assert not [text for text in result.warnings if "suspicious" in text]


def test_poses_carry_the_platforms_gravity(tmp_path):
    """A body in the same poses that weighs the same where gravity is smaller is heavier in proportion."""
    path = posed_runs.write(tmp_path / "run", posed_runs.measured(3, seconds=8.0), "poses", "mcap")
    declared = posed_runs.experiment(tmp_path, "poses")
    masses = [identify_files([path], replace(declared, gravity=g)).parameters.mass for g in (posed_runs.G, 9.78)]
    # what the motion's acceleration tells of the mass does not change: a part in thousands of the difference
    assert masses[1] / masses[0] - 1 == pytest.approx(posed_runs.G / 9.78 - 1, rel=0.05)
