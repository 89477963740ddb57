"""Gyro channels that hold the rates of Euler angles: named, with a cure that leads to the truth."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.helpers import posed_runs
from tests.helpers.laboratory import RATE, measure
from tests.helpers.laboratory_files import document, write
from tests.helpers.laboratory_mechanics import FINE, base_angles, base_motion
from uq.experiment.experiment import Experiment
from uq.runs.identification.identify_files import identify_files
from uq.runs.inspection.experiment_findings import experiment_findings
from uq.runs.recorded.load_run import load, load_run
from uq.runs.tables.import_table import import_table
from uq.runs.tables.table_map import Map

pytestmark = pytest.mark.usefixtures("undrawn")
SECONDS = 20.0


def angles():
    """Roll, pitch and yaw of the laboratory's base, and their rates, (n, 3)."""
    t = np.arange(round(SECONDS * FINE) + 1) / FINE
    return [values[:: FINE // RATE, ::-1] for values in base_angles(t, SECONDS)[:2]]


def with_rates(measured, order="ZYX"):
    """The run with the rates of some Euler angles for its angular velocity, and the gyro's noise."""
    rates = angles()[1]
    if order != "ZYX":
        turned = Rotation.from_euler("ZYX", angles()[0][:, ::-1]).as_euler(order)
        rates = np.empty_like(turned)
        rates[:, ["XYZ".index(axis) for axis in order]] = np.gradient(turned, 1 / RATE, axis=0)
    noise = measured.omega - base_motion(measured.setup).omega[:: FINE // RATE]
    return replace(measured, omega=rates + noise)


def judged(path, content):
    experiment = Experiment.from_dict(content)
    return experiment_findings(load_run(path, experiment.recording), experiment)


def covers(result, truth):
    return (np.abs(result.inertia - truth) < np.ptp(result.interval95, axis=1)).all()


def test_the_formula_that_is_told_leads_to_the_truth(tmp_path):
    measured = measure(3, seconds=SECONDS)
    rates = with_rates(measured)
    path, content = write(tmp_path / "run.mcap", rates), document(rates)
    (finding,) = judged(path, content)
    assert finding.kind == "euler rates"
    assert "turned axes ZYX" in finding.text
    for part in (
        "wx = roll' - yaw' sin(pitch)", "wy = pitch' cos(roll) + yaw' cos(pitch) sin(roll)",
        "wz = yaw' cos(pitch) cos(roll) - pitch' sin(roll)",
    ):  # fmt: skip
        assert part in finding.text
    warned = identify_files([path], Experiment.from_dict(content))
    assert any("hold the rates of Euler angles" in text for text in warned.warnings)
    (roll, pitch, _), (p, q, r) = angles()[0].T, rates.omega.T
    obeyed = [
        p - r * np.sin(pitch), q * np.cos(roll) + r * np.cos(pitch) * np.sin(roll),
        r * np.cos(pitch) * np.cos(roll) - q * np.sin(roll),
    ]  # fmt: skip
    path = write(tmp_path / "cured.mcap", replace(rates, omega=np.stack(obeyed, axis=1)))
    assert judged(path, content) == []
    cured = identify_files([path], Experiment.from_dict(content))
    assert cured.consistency == ()
    assert covers(cured, measured.truth)
    assert np.abs(warned.inertia - measured.truth).max() > 5 * np.abs(cured.inertia - measured.truth).max()


@pytest.mark.slow  # maps of an attitude: tables/test_attitudes_of_a_map.py
def test_the_import_of_the_attitude_that_is_told_leads_to_the_truth(tmp_path):
    measured = measure(3, seconds=SECONDS)
    quaternion = Rotation.from_euler("ZYX", angles()[0][:, ::-1]).as_quat()[:, [3, 0, 1, 2]]
    rows = np.column_stack([measured.t_wrench, measured.force, measured.moment, quaternion])
    head = "t,Fx,Fy,Fz,Mx,My,Mz,qw,qx,qy,qz"
    np.savetxt(tmp_path / "t.csv", rows, delimiter=",", header=head, comments="", fmt="%.10g")
    (tmp_path / "map.toml").write_text(
        '[columns]\ntime = "t"\ntime_unit = "s"\nforce = ["Fx", "Fy", "Fz"]\nmoment = ["Mx", "My", "Mz"]\n'
        'quaternion = { w = "qw", x = "qx", y = "qy", z = "qz" }\n'
        '[recording]\nwrench = "on_body"\nforce_unit = "N"\nmoment_unit = "N*m"\n'
    )
    import_table([tmp_path / "t.csv"], Map.load(tmp_path / "map.toml"), tmp_path / "run.mcap")
    content = document(measured)
    del content["recording"]["imu_position"]
    assert covers(identify_files([tmp_path / "run.mcap"], Experiment.from_dict(content)), measured.truth)


@pytest.mark.parametrize("order", ["XYZ", pytest.param("YXZ", marks=pytest.mark.slow)])
def test_other_angles_are_told_by_their_order(tmp_path, order):
    rates = with_rates(measure(4, seconds=SECONDS), order)
    (finding,) = judged(write(tmp_path / "run.mcap", rates), document(rates))
    assert f"turned axes {order}" in finding.text
    assert "roll'" not in finding.text


@pytest.mark.slow  # of another order: above
def test_rates_in_the_order_of_turning_are_told(tmp_path):
    """Yaw, pitch and roll in the channels x, y and z, as some functions return them."""
    rates = with_rates(measure(4, seconds=SECONDS))
    swapped = replace(rates, omega=rates.omega[:, ::-1])
    (finding,) = judged(write(tmp_path / "run.mcap", swapped), document(swapped))
    assert "turned axes ZYX, x, y, z in the order ZYX" in finding.text
    assert "wx = roll' - yaw' sin(pitch)" in finding.text


def test_rates_beside_an_attitude_are_told_by_it(tmp_path):
    run = posed_runs.measured(2)
    turned = run.attitude.as_euler("ZYX")[:, ::-1]
    rates = replace(run, omega=np.gradient(np.unwrap(turned, axis=0), run.t, axis=0) + 1e-3)
    swapped = replace(rates, omega=rates.omega[:, ::-1])
    for number, (recorded, kinds) in enumerate([(rates, ["euler rates"]), (swapped, ["euler rates"]), (run, [])]):
        path = posed_runs.write(tmp_path / f"{number}", recorded, "quaternion", "mcap")
        experiment = posed_runs.experiment(tmp_path, "quaternion", body_declared=True)
        loaded = load(path, experiment.recording, band=posed_runs.BAND, marks=False).run
        assert [finding.kind for finding in experiment_findings(loaded, experiment)] == kinds
