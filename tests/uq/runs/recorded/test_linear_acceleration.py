"""An accelerometer without gravity: put back by an attitude, else not used; named, and proposed in a table's map."""

import json
import tomllib
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

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


def test_an_attitude_whose_heading_is_unknown_and_drifts_puts_gravity_back(tmp_path, linear):
    """As of a fusion without a magnetometer: here by 1 deg/s."""
    heading = Rotation.from_euler("z", (70 + linear.t)[:, None], degrees=True)
    drifting = replace(linear, quaternion=(heading * Rotation.from_quat(linear.quaternion)).as_quat())
    path = posed_runs.write(tmp_path / "run", drifting, "quaternion", "mcap")
    result = identify_files(path, posed_runs.experiment(tmp_path, "quaternion", **DECLARED))
    assert result.mass == pytest.approx(posed_runs.MASS, abs=4e-3)
    assert result.warnings == ()


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


@pytest.mark.parametrize(
    ("sign", "length"), [(1.0, posed_runs.G), pytest.param(-1.0, posed_runs.G, marks=pytest.mark.slow), (-1.0, 1.0)]
)
def test_columns_of_gravity_put_it_back(tmp_path, clean, linear, capsys, sign, length):
    """As IMU drivers export it, up or down, of its size or as a direction, beside a load cell that reads the reaction."""
    path, out = tmp_path / "t.csv", tmp_path / "run.mcap"
    vectors = sign * length * clean.attitude.inv().apply([0, 0, 1.0])
    head = "t,wx,wy,wz,lin_acc_x,lin_acc_y,lin_acc_z,gravity_x,gravity_y,gravity_z,Fx,Fy,Fz,Mx,My,Mz"
    columns = np.column_stack([clean.t, clean.omega, linear.specific_force, vectors, -clean.force, -clean.moment])
    np.savetxt(path, columns, delimiter=",", header=head, comments="", fmt="%.9g")
    assert main(["import", str(path), "-o", str(out)]) == 1
    mapping = tmp_path / "run.map.toml"
    text = mapping.read_text().replace('wrench = "on_body"', 'wrench = "on_sensor"')
    proposed = tomllib.loads(text)["columns"]
    assert proposed["gravity_points"] == ("up" if sign > 0 else "down")
    other = {"up": "down", "down": "up"}[proposed["gravity_points"]]
    mapping.write_text(text.replace(f'gravity_points = "{proposed["gravity_points"]}"', f'gravity_points = "{other}"'))
    assert main(["import", str(path), "--map", str(mapping), "-o", str(out)]) == 2
    assert f'write gravity_points = "{proposed["gravity_points"]}"' in capsys.readouterr().err
    mapping.write_text(text)
    assert main(["import", str(path), "--map", str(mapping), "-o", str(out)]) == 0
    result = identify_files(
        out, Experiment.from_dict({"platform": {"gravity": "9.81 m/s^2"}, "recording": {"method": "joint"}})
    )
    assert result.mass == pytest.approx(posed_runs.MASS, abs=4e-3)
    np.testing.assert_allclose(result.r_cg, posed_runs.R_CG, atol=3e-4)
    assert result.warnings == ()


@pytest.mark.parametrize(
    ("columns", "line", "words"),
    [
        ("", "", "leave the heading open: give the gyro's table as well, or take `inertia centre`"),
        ("", 'rate = "9 Hz"\n', "gravity leaves the heading open: add angular_velocity"),
        (",wx,wy,wz", 'rate = "9 Hz"\nangular_velocity = ["wx", "wy", "wz"]\n', "gravity leaves the heading open"),
        (
            ",wx,wy,wz,ax,ay,az",
            'rate = "9 Hz"\nangular_velocity = ["wx", "wy", "wz"]\nacceleration = ["ax", "ay", "az"]\n',
            'recording.accelerometer_at_rest: write "zero" if columns.gravity was taken out',
        ),
    ],
    ids=["proposal", "alone", "beside a gyro", "beside an accelerometer"],
)  # fmt: skip
def test_what_gravity_alone_cannot_tell_is_one_line(tmp_path, capsys, columns, line, words):
    head = f"t,Fx,Fy,Fz,Mx,My,Mz,gravity_x,gravity_y,gravity_z{columns}"
    rows = np.column_stack([np.arange(40) / 100, np.random.default_rng(0).normal(size=(40, head.count(",")))])
    np.savetxt(tmp_path / "t.csv", rows, delimiter=",", header=head, comments="")
    command = ["import", str(tmp_path / "t.csv"), "-o", str(tmp_path / "run.mcap")]
    if line:
        (tmp_path / "m.toml").write_text(
            f'[columns]\n{line}force = ["Fx", "Fy", "Fz"]\nmoment = ["Mx", "My", "Mz"]\n'
            'gravity = ["gravity_x", "gravity_y", "gravity_z"]\n[recording]\nwrench = "on_body"\n'
        )
        command += ["--map", str(tmp_path / "m.toml")]
    assert main(command) == 2
    (said,) = capsys.readouterr().err.splitlines()
    assert words in said
    assert len(said) - len(str(tmp_path)) < 200


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
