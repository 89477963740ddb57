"""An accelerometer without gravity: put back by an attitude, else not used; named, and proposed in a table's map."""

import json
import tomllib

import numpy as np
import pytest

from identify.judge.conventions.convention_fit import ImuSignal, WrenchSignal
from identify.judge.conventions.wrench_findings import imu_findings
from identify.signals.run import RunError
from tests.helpers import posed_runs
from uq.cli.main import main
from uq.experiment.experiment import Experiment
from uq.runs.identification.identify_files import identify_files
from uq.runs.recorded.load_run import load

DECLARED = {"accelerometer_at_rest": "zero"}


@pytest.fixture(scope="module")
def clean():
    return posed_runs.measured(3, seconds=8.0, rate=100.0)


@pytest.fixture(scope="module")
def linear(clean):
    return posed_runs.linear_acceleration(clean)


def table(path, run):
    """A table of the run, with the quaternion."""
    names = "t,qx,qy,qz,qw,wx,wy,wz,lin_acc_x,lin_acc_y,lin_acc_z,Fx,Fy,Fz,Mx,My,Mz"
    columns = np.column_stack([run.t, run.quaternion, run.omega, run.specific_force, run.force, run.moment])
    np.savetxt(path, columns, delimiter=",", header=names, comments="", fmt="%.9g")
    return path


def test_without_an_attitude_it_is_not_used_and_the_mass_is_not_determined(tmp_path, linear):
    path = posed_runs.write(tmp_path / "run", linear, "imu", "mcap")
    experiment = posed_runs.experiment(tmp_path, "imu", **DECLARED)
    recorded = load(path, experiment.recording, marks=False)
    assert recorded.run.specific_force is None
    assert "holds no gravity" in " ".join(recorded.assumptions)
    result = identify_files(path, experiment)
    assert result.mass is None
    assert not [text for text in result.warnings if "suspicious" in text]


def test_the_proposed_map_of_a_table_leads_to_the_mass(tmp_path, linear, capsys):
    """Its size is that of 0.1 g, and no gravity."""
    path, out = table(tmp_path / "t.csv", linear), tmp_path / "run.mcap"
    assert main(["import", str(path), "-o", str(out)]) == 1
    mapping = tmp_path / "run.map.toml"
    recording = tomllib.loads(mapping.read_text())["recording"]
    assert (recording["acceleration_unit"], recording["accelerometer_at_rest"]) == ("m/s^2", "zero")
    assert main(["import", str(path), "--map", str(mapping), "-o", str(out)]) == 0
    capsys.readouterr()
    assert main(["inspect", str(out), "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["findings"] == []
    document = {"platform": {"gravity": "9.81 m/s^2"}, "recording": {"method": "joint"}}
    result = identify_files(out, Experiment.from_dict(document))
    assert result.mass == pytest.approx(posed_runs.MASS, abs=4e-3)
    np.testing.assert_allclose(result.r_cg, posed_runs.R_CG, atol=3e-4)
    assert result.warnings == ()


def test_readings_with_gravity_are_refused_where_it_is_declared_without(tmp_path, clean):
    path = posed_runs.write(tmp_path / "run", clean, "quaternion", "mcap")
    with pytest.raises(RunError, match=r"accelerometer_at_rest is zero, and .* holds gravity \(9\.8"):
        load(path, posed_runs.experiment(tmp_path, "quaternion", **DECLARED).recording, marks=False)
    joints = posed_runs.write(tmp_path / "joints", clean, "joints", "mcap")
    with pytest.raises(RunError, match="holds no accelerometer"):
        load(joints, posed_runs.experiment(tmp_path, "joints", **DECLARED).recording, band=3.0, marks=False)


def test_a_lever_that_explains_the_acceleration_falls_only_if_nothing_weighs(clean, linear):
    """As of a rig that turns about a point nearby: then the force tells a fall from gravity that was removed."""
    time, alpha = clean.t, np.gradient(clean.omega, clean.t, axis=0)
    lever = np.array([0.2, 0.1, -0.1])
    turning = np.cross(alpha, lever) + np.cross(clean.omega, np.cross(clean.omega, lever))
    imu = ImuSignal(time, clean.omega, turning)
    falling = WrenchSignal(time, posed_runs.MASS * turning, clean.moment)
    weighing = WrenchSignal(time, clean.force, clean.moment)
    assert imu_findings(imu, "/imu") == imu_findings(imu, "/imu", falling) == []
    (finding,) = imu_findings(imu, "/imu", weighing)
    assert finding.label == "linear acceleration"
