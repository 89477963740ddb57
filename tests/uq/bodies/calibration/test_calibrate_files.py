"""Calibration by a known body, against a laboratory that shares no code with the engine."""

import json
import re
from dataclasses import replace
from datetime import date

import numpy as np
import pytest

from identify.exceptions import RunError
from rig.exceptions import RigError
from tests.helpers.calibration_study import MOTIONS, known_body
from tests.helpers.laboratory import measure
from tests.helpers.laboratory_files import document, source, write
from uq.bodies.calibration.calibrate_files import calibrate_files
from uq.cli.main import main
from uq.experiment.experiment import Experiment
from uq.files.mistakes import ExperimentError
from uq.files.toml_text import toml_text
from uq.runs.identification.identify_files import identify_files
from uq.runs.identification.static_centre import centre_file

GAIN, SECONDS = 0.006, 10.0
RIG = {"cell_gain": (0.0, 0.0, 0.0, GAIN, GAIN, GAIN), "gyro_scale": (0.002, -0.003, 0.001), "seconds": SECONDS}
"""A gain that all axes of the moment share, of which an unknown body's data show nothing."""
BODY = {"inertia": np.diag([0.25, 0.31, 0.2]), "mass": 14.0}


def runs_of(folder, options, first=100):
    measured = [measure(first + k, **options, **motion) for k, motion in enumerate(MOTIONS[:2])]
    return [write(folder / f"run{first + k}.mcap", run) for k, run in enumerate(measured)], measured[0]


@pytest.fixture(scope="module")
def rig(tmp_path_factory):
    """The known body's file and runs, and the experiment; the calibration that they make."""
    folder = tmp_path_factory.mktemp("calibration")
    paths, measured = runs_of(folder, RIG)
    body = known_body(folder / "standard.toml", np.random.default_rng(1))
    experiment = Experiment.from_dict(document(measured, "source"))
    result = calibrate_files([(body, paths)], experiment, due=date(2030, 1, 1))
    (folder / "rig.toml").write_text(toml_text(result.sources()))
    return folder, body, paths, experiment, result


@pytest.fixture(scope="module")
def other(rig):
    """Another body on the same rig: its run, and the experiment's content."""
    folder = rig[0]
    measured = measure(500, **RIG, **BODY)
    return write(folder / "other.mcap", measured), document(measured, "source"), measured


def error_named(result, target, kind):
    return next(e for e in result.errors if (e.source.target, e.source.kind) == (target, kind))


def test_what_no_unknown_body_shows_is_found(rig):
    *_, result = rig
    gain, scale = (error_named(result, target, "scale") for target in ("M", "omega"))
    np.testing.assert_allclose(gain.mean, GAIN, atol=3 * gain.standard_uncertainty.max())
    assert gain.standard_uncertainty.max() < 0.7 * gain.prior.max()
    assert (np.abs(scale.mean - RIG["gyro_scale"]) < 3 * scale.standard_uncertainty).all()


@pytest.mark.parametrize("method", ["source", "joint"])
def test_another_body_is_corrected_and_covered(rig, other, method):
    """Without the calibration the gain is an error of 0.6 % that nothing tells, outside the first interval."""
    path, content, measured = other
    content = content | {"recording": {**content["recording"], "method": method}}
    plain = identify_files([path], Experiment.from_dict(content))
    corrected = identify_files([path], Experiment.from_dict(content | {"include": ["rig.toml"]}, rig[0]))
    moments = [0, 3, 5]
    off = np.abs(corrected.inertia - measured.truth)[moments] / measured.truth[moments]
    before = np.abs(plain.inertia - measured.truth)[moments] / measured.truth[moments]
    assert off.max() < 0.6 * before.max()
    low, high = corrected.interval95.T
    assert ((low <= measured.truth) & (measured.truth <= high)).all()
    assert not {"moment_gain", "gyro_scale"} & {row.error for row in corrected.undeclared.rows}
    assert rig[-1].group in corrected.ledger.budget
    assert (np.abs(corrected.bias) < 0.1 * corrected.standard_uncertainty).all()
    assert not [text for text in corrected.warnings if "gyro noise" in text]


def test_correlated_rows_are_one_and_their_sum_is_sharp(rig, other):
    """The known body tells the sum of gain and cross-talk better than either: apart they would be wider than together."""
    path, content, _ = other
    experiment = Experiment.from_dict(content | {"include": ["rig.toml"]}, rig[0])
    together = identify_files([path], experiment).ledger.budget[rig[-1].group][4:]
    apart = identify_files([path], replace(experiment, mixing=())).ledger.budget
    names = [name for name in apart if name.startswith(rig[-1].group)]
    assert len(names) > 3
    squares = np.sum([apart[name][4:] ** 2 for name in names], axis=0)
    assert (together[[0, 3, 5]] ** 2 < 0.8 * squares[[0, 3, 5]]).all()


def test_the_file_says_when_and_on_which_runs(rig):
    folder, _, paths, _, result = rig
    experiment = Experiment.from_dict({"include": ["rig.toml"]}, folder)
    (calibration,) = experiment.calibrations
    assert [run.file for run in calibration.run] == [path.name for path in paths]
    assert all(len(run.sha256) == 64 and run.body == "standard" for run in calibration.run)
    assert (calibration.due, calibration.performed) == (date(2030, 1, 1), date(2023, 11, 14))
    assert {source.group for source in experiment.sources} == {result.group}


@pytest.mark.slow
@pytest.mark.parametrize(
    ("figure", "factor", "named"),
    [("mass", 1.02, "the mass of standard is "), ("I11", 1.02, "the I11 of standard is ")],
)
def test_a_wrong_drawing_is_named(rig, figure, factor, named):
    """A mass or a moment 2 % off: it is named beside the errors of the rig that would do the same."""
    folder, _, paths, experiment, _ = rig
    wrong = known_body(folder / f"wrong_{figure}.toml", np.random.default_rng(1), {figure: factor})
    result = calibrate_files([(wrong, paths)], experiment)
    assert any(named in text for text in result.warnings)


@pytest.mark.slow
def test_a_right_drawing_and_a_usual_rig_are_no_news(rig, tmp_path):
    paths, measured = runs_of(tmp_path, {"seconds": SECONDS}, first=300)
    result = calibrate_files([(rig[1], paths)], Experiment.from_dict(document(measured, "source")))
    assert not [text for text in result.warnings if "larger than expected" in text]
    assert result.chance > 0.01


@pytest.mark.slow
def test_a_body_that_is_not_held_is_named(rig, tmp_path):
    paths, measured = runs_of(tmp_path, {"seconds": SECONDS, "slip": (0.003, 0.0, 0.0)}, first=400)
    result = calibrate_files([(rig[1], paths)], Experiment.from_dict(document(measured, "source")))
    assert any(text.startswith("standard: ") for text in result.warnings)


def test_what_a_result_must_say_of_its_calibration(rig, other):
    path, content, _ = other
    folder, *_, result = rig
    past_due = result.sources()
    past_due["calibration"][0] |= {"due": date(2023, 1, 1), "warnings": ["the drawing may be wrong"]}
    (folder / "late.toml").write_text(toml_text(past_due))
    warnings = identify_files([path], Experiment.from_dict(content | {"include": ["late.toml"]}, folder)).warnings
    assert any("was due on 2023-01-01, before the run of 2023-11-14: calibrate again" in text for text in warnings)
    assert any(text.endswith("the drawing may be wrong") for text in warnings)


@pytest.mark.slow
def test_two_known_bodies(rig, tmp_path):
    """A second body: of the first, its own figures alone are doubted."""
    _, body, paths, experiment, by_first = rig
    options = RIG | BODY
    more, _ = runs_of(tmp_path, options, first=600)
    text = re.sub(r'name = "standard"', 'name = "second"', body.read_text())
    tensor = dict(zip(("I11", "I12", "I13", "I22", "I23", "I33"), BODY["inertia"][np.triu_indices(3)], strict=True))
    for name, value in (tensor | {"mass": 14.0}).items():
        text = re.sub(rf'(?m)^({name} = \{{ value = ")[^ ]+', rf"\g<1>{value:.6g}", text)
    second = tmp_path / "second.toml"
    second.write_text(text)
    both = calibrate_files([(body, paths), (second, more)], experiment)
    alone, together = (error_named(result, "M", "scale") for result in (by_first, both))
    assert (together.standard_uncertainty < alone.standard_uncertainty).all()
    np.testing.assert_allclose(together.mean, GAIN, atol=3 * together.standard_uncertainty.max())


def test_refusals(rig, other, tmp_path):
    folder, body, paths, experiment, _ = rig
    with pytest.raises(ExperimentError, match="includes a calibration: take it out of include"):
        calibrate_files([(body, paths)], Experiment.from_dict(other[1] | {"include": ["rig.toml"]}, folder))
    with pytest.raises(RunError, match="a known body has no runs"):
        calibrate_files([(body, [])], experiment)
    mass_alone = tmp_path / "body.toml"
    mass_alone.write_text('[cad]\nabout = "CG"\nproducts = "tensor"\n')
    with pytest.raises(ExperimentError, match="inertia"):
        calibrate_files([(mass_alone, paths)], experiment)


def test_another_serial_number_is_refused(rig, other, monkeypatch):
    path, content, _ = other
    folder, *_, result = rig
    numbered = result.sources()
    numbered["calibration"][0]["instrument"] = [{"name": "cell", "serial_number": "123"}]
    (folder / "numbered.toml").write_text(toml_text(numbered))
    experiment = Experiment.from_dict(content | {"include": ["numbered.toml"]}, folder)
    from uq.experiment import calibration_table

    recorded = [calibration_table.Instrument(name="cell", serial_number="456", recorded=True)]
    monkeypatch.setattr(calibration_table, "recorded_instruments", lambda inputs: recorded)
    with pytest.raises(RigError, match="made with cell of serial number 123, a run was recorded with 456"):
        identify_files([path], experiment)


@pytest.mark.slow
def test_the_command(rig, tmp_path, capsys, monkeypatch):
    _, body, paths, *_ = rig
    monkeypatch.chdir(tmp_path)
    (tmp_path / "e.toml").write_text(
        toml_text(document(measure(100, **RIG), "source", [source("gain", "M", "scale", [1] * 3)]))
    )
    given = ["calibrate", *map(str, paths), "--known", str(body), "--experiment", "e.toml"]
    assert main([*given, "-o", "rig.toml", "--out", "out", "--due", "2030-01-01"]) == 0
    printed = capsys.readouterr().out
    assert "Calibration of the rig by standard, 2 runs" in printed
    assert 'use it in an experiment: include = ["rig.toml"]' in printed
    content = json.loads((tmp_path / "out" / "result.json").read_text())
    assert content["kind"] == "inertia calibrate"
    assert content["errors"]
    for more, line in (
        (["-o", "rig.toml"], "exists: give another name to -o"),
        (["--due", "soon"], "--due is 'soon': write a date"),
        (["--known", str(body), str(paths[0])], "stands before --known: name the runs of each body behind it"),
    ):
        assert main([*given, *more]) == 2
        assert line in capsys.readouterr().err


def test_static_poses_are_corrected_too(rig, tmp_path):
    """A load cell that reads 1 % too much force: the mass of poses is too large by as much, without the calibration."""
    up = np.vstack([np.eye(3), -np.eye(3), np.full((1, 3), 3**-0.5)])
    mass, r_cg, gravity = 5.0, np.array([0.01, -0.02, 0.05]), 9.81
    force = 1.01 * mass * gravity * up
    rows = np.hstack([-gravity * up, force, np.cross(r_cg, force)])
    np.savetxt(tmp_path / "poses.csv", rows, delimiter=",", header="gx,gy,gz,fx,fy,fz,mx,my,mz", comments="")
    gains = {"target": "F", "kind": "scale", "group": "calibration_1", "mean": "1 %", "sigma": "0.01 %"}
    moments = gains | {"target": "M", "mean": "1 %"}
    content = {
        "calibration": [{"group": "calibration_1"}],
        "source": [{"name": "a", **gains}, {"name": "b", **moments}],
        "correlation": [{"sources": ["a", "b"], "coefficient": 0.5}],
        "platform": {"gravity": "9.81 m/s^2"},
        "poses": {
            "gravity": ["gx", "gy", "gz"], "force": ["fx", "fy", "fz"], "moment": ["mx", "my", "mz"],
        },
    }  # fmt: skip
    centre = centre_file(tmp_path / "poses.csv", Experiment.from_dict(content))
    np.testing.assert_allclose([centre.mass, *centre.r_cg], [mass, *r_cg], rtol=1e-4, atol=1e-5)
    assert all(name.startswith("calibration_1 ") for name in centre.lasting_names)


def test_a_turn_that_alone_is_calibrated_is_the_joint_estimates_prior(tmp_path):
    """Of one source nothing is correlated: its mean is that of the alignment."""
    measured = measure(700, seconds=SECONDS, imu_turn=(0.02, 0.0, -0.01))
    turn = {"name": "axes", "target": "omega", "kind": "misalignment", "group": "calibration_1"}
    turn |= {"mean": ["0.02 rad", "0 rad", "-0.01 rad"], "sigma": ["0.1 mrad"] * 3}
    content = document(measured, "joint", [turn]) | {"calibration": [{"group": "calibration_1"}]}
    result = identify_files([write(tmp_path / "run.mcap", measured)], Experiment.from_dict(content))
    np.testing.assert_allclose(result.rotation.value, [0.02, 0.0, -0.01], atol=4e-4)
    assert not result.declarations
