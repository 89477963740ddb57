"""What looks like a wrong mass or a rotated IMU: each rival is told with its effect, and its cure leads to the truth."""

import re
from dataclasses import replace

import numpy as np
import pytest

from identify.rigid_body.inertia import COMPONENTS
from tests.helpers.laboratory import FINE, measure
from tests.helpers.laboratory_files import document, quantities, write
from tests.helpers.laboratory_mechanics import GRAVITY, R_CG, base_motion, carried, still_point
from uq.experiment.experiment import Experiment
from uq.runs.identification.identify_files import identify_files
from uq.runs.identification.tare import tare_files

pytestmark = pytest.mark.usefixtures("undrawn")
SHORT = {"seconds": 15.0}


def pulled(measured, force, at):
    """A further force on the load cell, (n, 3), and its moment from a place."""
    return replace(measured, force=measured.force + force, moment=measured.moment + np.cross(at, force))


def lifted(measured, newton):
    """Air that lifts the body by so much at its centre of gravity."""
    up = base_motion(measured.setup).up[:: FINE // measured.setup.rate]
    return pulled(measured, -newton * up, R_CG)


def with_adapter(measured, mass, at):
    """A small part beside the body."""
    base = base_motion(measured.setup)
    felt = carried(base.fixed, base.omega, base.alpha, still_point(measured.setup) - R_CG + at)
    return pulled(measured, mass * felt[:: FINE // measured.setup.rate], at)


def identified(measured, folder, method, **tables):
    """The result of an experiment with other tables: those of ``body`` and ``recording`` beside the usual keys."""
    content = document(measured, method)
    for name, table in tables.items():
        content[name] = content.get(name, {}) | table
    experiment = Experiment.from_dict(content)
    return identify_files([write(folder / "run0.mcap", measured)], experiment), experiment


def line(result, label):
    """The only warning of a label."""
    (text,) = [text for text in result.warnings if f"({label});" in text]
    return text


def shifts(text, words):
    """The component and the shift [g·m²] that stand behind some words."""
    name, by = re.search(rf"{words}.*?it would shift (I\d\d) by (\S+) g", text).groups()
    return COMPONENTS.index(name), float(by.replace("−", "-"))


def covers(result, truth):
    low, high = result.interval95.T
    return ((truth > low - (high - low) / 2) & (truth < high + (high - low) / 2)).all()


@pytest.mark.parametrize("method", ["source", pytest.param("joint", marks=pytest.mark.slow)])
def test_gravity_of_another_place_is_a_rival_of_the_mass(tmp_path, method):
    measured = measure(3, still=True, **SHORT)
    elsewhere, _ = identified(measured, tmp_path, method, platform={"gravity": "9.78 m/s^2"})
    text = line(elsewhere, "mass")
    told = re.search(r"gravity of (\S+ m/s)² \(correct platform.gravity", text)[1]
    uncertainty = float(re.search(r"mass were off by \S+ ± (\S+) kg", text)[1]) * GRAVITY / measured.mass
    assert uncertainty < 5e-3  # the zeros of the load cell; three are passed by chance once in 400
    assert float(told.split()[0]) == pytest.approx(GRAVITY, abs=3 * uncertainty)
    cured, _ = identified(measured, tmp_path, method, platform={"gravity": f"{told}^2"})
    assert cured.consistency == ()
    assert covers(cured, measured.truth)


@pytest.mark.slow  # with an accelerometer: below
def test_what_air_lifts_is_a_rival_of_the_mass_about_a_point_at_rest(tmp_path):
    measured = lifted(measure(3, still=True, **SHORT), 3.0)
    text = line(identified(measured, tmp_path, "joint")[0], "mass")
    newton = float(re.search(r"(\S+) N by which air lifts the body \(state body.mass as weighed in air", text)[1])
    weighed = measured.mass - newton / GRAVITY
    cured, _ = identified(measured, tmp_path, "joint", body={"mass": f"{weighed} kg"})
    assert cured.consistency == ()
    assert covers(cured, measured.truth)


@pytest.mark.parametrize("method", ["source", pytest.param("gls", marks=pytest.mark.slow)])
def test_an_accelerometer_tells_a_lift_from_a_wrong_mass(tmp_path, method):
    """No mass, no gain, no centre of gravity is blamed; the method that the line names is right."""
    measured = lifted(measure(3, **SHORT), 3.0)
    joint, _ = identified(measured, tmp_path, "joint")
    assert [verdict.cause for verdict in joint.consistency] == ["weight"]
    assert not [text for text in joint.warnings if "comes to" in text]
    component, by = shifts(line(joint, "weight"), "methods source and gls take the force as it is")
    assert 1e3 * (joint.inertia - measured.truth)[component] == pytest.approx(by, rel=0.3)
    result, _ = identified(measured, tmp_path, method)
    assert {verdict.cause for verdict in result.consistency} <= {"weight"}
    assert np.ptp(result.interval95, axis=1).max() < np.ptp(joint.interval95, axis=1).max()
    assert covers(result, measured.truth)


@pytest.mark.parametrize("still", [pytest.param(True, marks=pytest.mark.slow), False])
def test_a_forgotten_adapter_is_a_rival_of_the_mass(tmp_path, still):
    at = np.array([0.0, 0.0, 0.01])
    measured = with_adapter(measure(3, still=still, **SHORT), 0.4, at)
    result, _ = identified(measured, tmp_path, "source")
    text = line(result, "mass")
    kg = float(
        re.search(r"(\S+) kg at Q beside the body, such as an adapter \(state it with its place in \[fixture\]", text)[
            1
        ]
    )
    assert kg == pytest.approx(0.4, abs=0.06)  # the declared centre of gravity takes up a part
    component, by = shifts(text, "such as an adapter")
    assert 1e3 * (result.inertia - measured.truth)[component] == pytest.approx(by, rel=0.3)
    total = measured.mass + 0.4
    r_cg = (measured.mass * measured.r_cg + 0.4 * at) / total
    body = {"mass": f"{total} kg", "r_cg_from_q": quantities(r_cg, "m")}
    nothing = dict.fromkeys(("I11", "I22", "I33"), "1e-9 kg*m^2")
    fixture = {"mass": "0.4 kg", "r_cg_from_q": quantities(at, "m"), "inertia": nothing}
    both, experiment = identified(measured, tmp_path, "source", body=body, fixture=fixture)
    assert both.consistency == ()
    assert covers(tare_files(both, [], experiment), measured.truth)


@pytest.mark.slow  # gravity, air and adapter are others: above
def test_a_gain_that_force_and_moment_share_is_a_rival_of_the_mass(tmp_path):
    measured = measure(3, still=True, cell_gain=(0.02,) * 6, **SHORT)
    result, _ = identified(measured, tmp_path, "source")
    text = line(result, "mass")
    told = re.search(r"gains of the load cell of \+(\S+) % \(calibrate it, or declare a scale of F and M", text)[1]
    assert float(told) == pytest.approx(2.0, abs=0.11)
    component, by = shifts(text, "declare a scale of F and M")
    assert 1e3 * (result.inertia - measured.truth)[component] == pytest.approx(by, abs=0.3)
    calibrated, _ = identified(measured, tmp_path, "source", recording={"calibration": (np.eye(6) / 1.02).tolist()})
    assert calibrated.consistency == ()
    assert covers(calibrated, measured.truth)


@pytest.mark.slow  # by inspection: runs/inspection/test_rotation_findings.py
@pytest.mark.parametrize("method", ["source", "gls"])
def test_a_rotated_load_cell_is_a_rival_of_the_imu(tmp_path, method):
    measured = measure(3, still=True, cell_turn=(0.0, 0.0, np.radians(1.0)), **SHORT)
    result, _ = identified(measured, tmp_path, method)
    text = line(result, "rotation")
    assert shifts(text, "correct imu_rotation_to_body")[1] == pytest.approx(4.0, abs=0.2)
    component, by = shifts(text, "correct wrench_rotation_to_body")
    assert 1e3 * (result.inertia - measured.truth)[component] == pytest.approx(by, abs=0.2)
