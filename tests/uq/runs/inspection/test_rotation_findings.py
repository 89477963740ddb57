"""Load cell and IMU turned against each other by any angle: named with its uncertainty, cured by the line that is told."""

import re
import tomllib
from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from tests.helpers.laboratory import measure
from tests.helpers.laboratory_files import document, write
from tests.helpers.spoiled_runs import T1, declared, sensors
from uq.experiment.experiment import Experiment
from uq.runs.identification.identify_files import identify_files
from uq.runs.inspection.experiment_findings import experiment_findings
from uq.runs.recorded.load_run import load_run

pytestmark = pytest.mark.usefixtures("undrawn")


def turns():
    """45° about an axis, then angles from 12° to 180° about axes in any direction; every fifth with the wrench reversed."""
    draw = np.random.default_rng(11)
    for number in range(10):
        axis = draw.normal(size=3)
        vector = np.radians(draw.uniform(12, 180)) * axis / np.linalg.norm(axis)
        vector = np.array([0.0, 0.0, np.pi / 4]) if number == 0 else vector
        yield number, ("imu", "wrench")[number % 2], vector, -1 if number % 5 == 4 else 1


MARKS = [[], [], *([pytest.mark.slow] * 3), *([pytest.mark.study] * 5)]
"""An IMU turned about an axis and a load cell about any direction show it; the others are more of the same."""


@cache
def run(seed):
    return sensors(T1, seed=seed, noise=0.02)


def judged(path, content):
    experiment = Experiment.from_dict(content)
    return experiment_findings(load_run(path, experiment.recording), experiment)


def told(text, key):
    """The value of a key in a finding's cure."""
    match = re.search(rf"{key} = (\[\[.*?\]\]|\".*?\")", text)
    return None if match is None else tomllib.loads(f"value = {match[1]}")["value"]


@pytest.mark.parametrize(
    ("number", "sensor", "vector", "sign"),
    [pytest.param(*turn, marks=MARKS[turn[0]]) for turn in turns()],
)
def test_any_rotation_is_named_measured_and_cured(tmp_path, number, sensor, vector, sign):
    """Angle within 3 u, and the rotation's own error within 4 u, for all: by chance fewer than one in twenty tests."""
    matrix = Rotation.from_rotvec(vector).as_matrix()
    turned = run(number).of_wrench(sign * (matrix if sensor == "wrench" else np.eye(3)))
    turned = turned.of_imu(matrix) if sensor == "imu" else turned
    path = turned.write(tmp_path / "run.mcap")
    (finding,) = judged(path, T1)
    assert finding.kind == "turned"
    angle, expanded = map(float, re.search(r"by ([\d.]+) ± ([\d.]+) deg", finding.text).groups())
    assert abs(angle - np.degrees(np.linalg.norm(vector))) < max(1.5 * expanded, 0.5)
    assert ('wrench = "on_sensor"' in finding.text) == (sign < 0)
    key = f"{sensor}_rotation_to_body"
    cure = {key: told(finding.text, key)} | ({"wrench": "on_sensor"} if sign < 0 else {})
    left = Rotation.from_matrix(np.array(cure[key]) @ matrix).magnitude()
    assert np.degrees(left) < 5
    assert judged(path, declared(T1, cure)) == []


@pytest.mark.parametrize(
    "angle", [133.0, *(pytest.param(angle, marks=pytest.mark.study) for angle in (3.0, 8.0, 45.0, 90.0))]
)
def test_the_cure_heals_the_tensor(tmp_path, angle):
    """The laboratory's rig, its load cell turned: off by more than 1 g·m² a degree before, and by less than 1 g·m² after."""
    measured = measure(3, seconds=20, cell_turn=tuple(np.radians(angle) * np.array([0.36, 0.48, 0.8])))
    path, content = write(tmp_path / "run.mcap", measured), document(measured)
    spoiled = identify_files([path], Experiment.from_dict(content))
    (finding,) = judged(path, content)
    assert [text for text in spoiled.warnings if "wrench_rotation_to_body" in text]
    after_it = [text for text in spoiled.warnings if "suspicious" not in text]
    assert not {verdict.text for verdict in spoiled.consistency} & set(
        after_it
    )  # each says that it may be a consequence
    key = "wrench_rotation_to_body"
    content["recording"][key] = told(finding.text, key)
    cured = identify_files([path], Experiment.from_dict(content))
    assert not [text for text in cured.warnings if "suspicious" in text]
    before, after = (np.abs(result.inertia - measured.truth).max() for result in (spoiled, cured))
    print(f"{angle} deg: off by {1e3 * before:.1f} g·m² before, {1e3 * after:.1f} after")
    assert before > 1e-3 * angle
    assert after < 1e-3


@pytest.mark.parametrize(
    ("turned", "key", "methods"),
    [
        ("cell_turn", "wrench_rotation_to_body", ("source",)),
        pytest.param("cell_turn", "wrench_rotation_to_body", ("gls",), marks=pytest.mark.slow),
        pytest.param("imu_turn", "imu_rotation_to_body", ("source", "gls"), marks=pytest.mark.slow),
    ],
)
def test_of_two_lines_that_fit_equally_each_says_what_it_does_to_the_tensor(tmp_path, turned, key, methods):
    """One degree about z: the data fit either sensor. The true one leads to the truth, each to the I12 that it tells."""
    measured = measure(3, seconds=20, **{turned: (0.0, 0.0, np.radians(1.0))})
    path, content = write(tmp_path / "run.mcap", measured), document(measured)
    (finding,) = judged(path, content)
    says = {
        "imu_rotation_to_body": r"if the IMU is the rotated sensor \(I12 is then about (\S+) g",
        "wrench_rotation_to_body": r"if the load cell is \(I12 is then about (\S+) g",
    }
    for name, pattern in says.items():
        for method in methods if name == key else methods[:1]:
            obeyed = declared(content, {name: told(finding.text, name), "method": method})
            result = identify_files([path], Experiment.from_dict(obeyed))
            stated = float(re.search(pattern, finding.text)[1].replace("−", "-"))
            assert 1e3 * result.inertia[1] == pytest.approx(stated, abs=0.1)
            assert not [text for text in result.warnings if "rotat" in text]
            if name == key:
                half = np.ptp(result.interval95, axis=1) / 2
                assert (np.abs(result.inertia - measured.truth) < 2 * half).all()
                assert 1e3 * measured.truth[1] == pytest.approx(stated, abs=0.1)


@pytest.mark.parametrize(
    ("error", "angle", "axis"),
    [
        ((0.0002, -0.008, -0.0009), 8.1, (-0.87, 0.12, -0.48)),
        pytest.param((0.0038, 0.008, 0.003), 10.9, (0.52, -0.58, -0.63), marks=pytest.mark.slow),
    ],
)
def test_a_drawing_of_the_centre_does_not_decide_which_sensor_is_turned(tmp_path, error, angle, axis):
    """Declared centres that are millimetres off: the line of the turned load cell stands beside that of the IMU."""
    turn = np.radians(angle) * np.array(axis) / np.linalg.norm(axis)
    measured = measure(1, seconds=12, r_cg_error=error, cell_turn=tuple(turn))
    texts = [finding.text for finding in judged(write(tmp_path / "run.mcap", measured), document(measured))]
    assert "wrench_rotation_to_body" in texts[0]


@pytest.mark.parametrize(
    "seed",
    [0, pytest.param(1, marks=pytest.mark.slow), *(pytest.param(k, marks=pytest.mark.study) for k in range(2, 6))],
)
def test_of_the_laboratorys_clean_runs_nothing_is_said(tmp_path, seed):
    measured = measure(seed, seconds=20)
    assert judged(write(tmp_path / "run.mcap", measured), document(measured)) == []


@pytest.mark.parametrize("stated", [pytest.param("r_cg_from_q", marks=pytest.mark.slow), None])
def test_what_is_not_stated_yet_is_not_judged_by(tmp_path, stated):
    """A beginner's experiment has static poses, but no centre of gravity or mass yet; a turned sensor is named all the same."""
    content = declared(T1, {}) | {"poses": {}}
    content["body"] = {key: value for key, value in content["body"].items() if key == stated}
    assert judged(run(1).write(tmp_path / "clean.mcap"), content) == []
    (finding,) = judged(
        run(1).of_imu(Rotation.from_rotvec([0.0, 0.0, 0.5]).as_matrix()).write(tmp_path / "turned.mcap"), content
    )
    assert finding.kind == "turned"
