"""Recordings and tables in other people's conventions: what is named, and that a cure that is obeyed leads to the truth.

``expected.toml`` has a row for each; ``tests/helpers/posed_runs.py`` makes the recordings.
"""

import json
import tomllib
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from identify.rigid_body.inertia import pack
from identify.signals.run import RunError
from tests.helpers import posed_runs
from uq.experiment.experiment import Experiment
from uq.files.mistakes import ExperimentError
from uq.runs.identification.identify_files import identify_files
from uq.runs.identification.static_centre import centre_file
from uq.runs.inspection.experiment_findings import experiment_findings
from uq.runs.recorded.gravity_compensation import undo
from uq.runs.recorded.load_run import load

EXPECTED = tomllib.loads((Path(__file__).parent / "expected.toml").read_text())


def name_of(row):
    words = [row.get(key, "sound") for key in ("source", "container", "attitude", "convention") if key in row]
    return "-".join(words + ["known"] * row.get("known", False))


@pytest.fixture(scope="module")
def clean():
    return posed_runs.measured(3, seconds=8.0, rate=100.0)


def judged(path, folder, row, **declared):
    """The run as declared, its weight put back, and the labels and texts of what is suspicious."""
    experiment = posed_runs.experiment(folder, row["source"], body_declared=row.get("known", False), **declared)
    try:
        recorded = load(path, experiment.recording, band=posed_runs.BAND, marks=False).run
    except RunError as error:
        return None, [("refused", str(error))]
    run, _ = undo(recorded, (), experiment)
    return run, [(finding.kind, finding.text) for finding in experiment_findings(run, experiment, undone=True)]


def by_cost(rows):
    """Each kind of recording once, and each convention once, or three of those of one finding; the others are slow."""
    seen, of_finding = set(), Counter()
    for row in rows:
        recording, convention = (row["source"], row["container"]), row["convention"]
        covered = convention in seen or of_finding[row["finding"]] >= 3
        fast = recording not in seen or not covered
        yield pytest.param(row, id=name_of(row), marks=[] if fast else [pytest.mark.slow])
        seen |= {recording, convention}
        of_finding[row["finding"]] += fast


@pytest.mark.parametrize("row", [*by_cost(EXPECTED["recording"])])
def test_a_recording_in_this_convention(tmp_path, clean, row):
    recorded = posed_runs.CONVENTIONS[row["convention"]](clean)
    path = posed_runs.write(tmp_path / "run", recorded, row["source"], row["container"])
    _, findings = judged(path, tmp_path, row)
    assert [kind for kind, _ in findings][:1] == ([row["finding"]] if row["finding"] else [])
    if "obeyed" not in row:
        return
    run, remaining = judged(path, tmp_path, row, **row["obeyed"])
    assert remaining == []
    named = findings[0][1]
    assert any(f"{key} = " in named or f" {key}" in named for key in row["obeyed"])
    if row["finding"] == "unit":
        assert all(f'{key} = "{value}"' in named for key, value in row["obeyed"].items())
    if row["convention"] == "linear_acceleration" and row["source"] == "quaternion":
        assert np.abs(run.specific_force - clean.specific_force).max() < 4e-3  # standard gravity is put back
    if row["finding"] == "unit" or row["convention"] in (
        "wrench_at_rest",
        "half_turned_base",
        "compensated",
        "other_payload",
        "in_bunches",
        "low_passed_at_3_Hz",
        "reversed_wrench",
        "reversed_force",
    ):
        for values, truth, noise in ((run.force, clean.force, 0.05), (run.moment, clean.moment, 2e-3)):
            expected = np.stack([np.interp(run.t, clean.t, column) for column in truth.T], axis=1)
            assert np.abs(values - expected).mean() < 2 * noise  # of white noise, and none between the instants


# Tables of static poses


ORDER = {"quaternion": ["q1", "q2", "q3", "q0"]}


def table(path, row, count=10):
    """Ten poses in a convention; returns the keys of ``[poses]`` that declare them as if they were sound."""
    kind, convention = row["attitude"], row.get("convention", "sound")
    turn = Rotation.random(count, rng=np.random.default_rng(5))
    along = {"wall": np.array([-1.0, 0, 0]), "ceiling": np.array([0, 0, -1.0])}.get(convention, np.array([0, 0, 1.0]))
    force = posed_runs.MASS * turn.inv().apply(posed_runs.G * along)
    moment = np.cross(posed_runs.R_CG, force) + posed_runs.ZERO[3:]
    force = force + posed_runs.ZERO[:3] + 0.01 * np.random.default_rng(6).normal(size=force.shape)
    if convention == "zero_drifts":
        force = force + np.linspace(0, 1, count)[:, None] * [1.0, 0.5, 2.0]
    if convention == "wrench_at_rest":
        force, moment = turn.apply(force), turn.apply(moment)
    written = turn.inv() if convention == "inverse" else turn
    euler = {"kuka": "ZYX", "fanuc": "xyz"}
    if kind == "quaternion":
        values = written.as_quat()[:, [3, 0, 1, 2]]
        names = ["q1", "q2", "q3", "q0"] if convention == "scalar_first" else ["q0", "q1", "q2", "q3"]
        keys = {"quaternion": dict(zip("wxyz", names, strict=True))}
    elif kind == "matrix":
        values, keys = written.as_matrix().reshape(count, 9), {"matrix": [f"q{k}" for k in range(9)]}
    elif kind == "rotation_vector":
        values, keys = written.as_rotvec(), {"rotation_vector": ["q0", "q1", "q2"], "angle_unit": "rad"}
    else:
        values = written.as_euler(euler[kind], degrees=True)
        keys = {"euler": ["q0", "q1", "q2"], "euler_convention": kind, "angle_unit": "deg"}
    head = [f"q{k}" for k in range(values.shape[1])] + ["fx", "fy", "fz", "tx", "ty", "tz"]
    np.savetxt(path, np.hstack([values, force, moment]), delimiter=",", header=",".join(head), comments="", fmt="%.9g")
    return {"force": ["fx", "fy", "fz"], "moment": ["tx", "ty", "tz"], "takes": "sensor_to_level"} | keys


def as_toml(value):
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{key} = {as_toml(item)}" for key, item in value.items()) + " }"
    return json.dumps(value)


def weighed(path, poses, recording):
    """The centre by a table, with these tables of the experiment."""
    tables = {"platform": {"gravity": f"{posed_runs.G} m/s^2"}, "recording": {"wrench": "on_body"} | recording}
    document = {**tables, "poses": poses}
    return centre_file(path, Experiment.from_dict(document))


@pytest.mark.parametrize("row", EXPECTED["poses"], ids=name_of)
def test_a_table_of_poses_in_this_convention(tmp_path, row):
    """The line that the finding names is added to the experiment: mass and centre are then the true ones."""
    path, recording = tmp_path / "poses.csv", {}
    poses = table(path, row)
    if row["finding"]:
        try:
            text = " ".join(weighed(path, poses, recording).warnings)
        except Exception as error:
            text = str(error)
        assert row["finding"] in text
        (poses if "frame" not in row["finding"] and "gravity" not in row["finding"] else recording).update(
            tomllib.loads(row["finding"])
        )
    centre = weighed(path, poses, recording)
    assert row.get("named", "") in " ".join(centre.warnings)
    assert not [text for text in centre.warnings if "suspicious" in text or "residuals" in text]
    assert centre.mass == pytest.approx(posed_runs.MASS, abs=2e-3)
    np.testing.assert_allclose(centre.r_cg, posed_runs.R_CG, atol=2e-4)


def test_two_lines_are_an_experiment_where_the_motion_tells_all(tmp_path, clean):
    """Neither mass nor centre of gravity are declared; a weight to be put back asks for them."""
    path = posed_runs.write(tmp_path / "run", clean, "imu", "mcap")
    result = identify_files(path, Experiment.from_dict({"recording": {"method": "joint"}}))
    assert result.mass == pytest.approx(posed_runs.MASS, rel=2e-3)  # local gravity is not declared
    np.testing.assert_allclose(result.r_cg, posed_runs.R_CG, atol=3e-4)
    error = result.inertia - pack(posed_runs.TENSOR)
    assert (np.abs(error) < 5 * result.standard_uncertainty).all()
    assert (result.standard_uncertainty < 2e-4).all()
    assert (result.warnings, result.contradicted) == ((), "")
    removed = {"body": {"mass": "2 kg"}, "recording": {"method": "joint", "compensated": "gravity"}}
    with pytest.raises(ExperimentError, match=r"missing key body\.r_cg_from_q"):
        identify_files(path, Experiment.from_dict(removed))


def test_a_table_of_poses_by_joint_angles(tmp_path):
    """In degrees, as a pendant shows them; a base upside down is named."""
    posed_runs.urdf(tmp_path / "arm.urdf")
    angles = np.random.default_rng(5).uniform(-2.5, 2.5, (10, 6))
    turn = Rotation.identity(len(angles))
    for k, axis in enumerate(posed_runs.AXES):
        turn = turn * Rotation.from_euler(axis, angles[:, [k]])
    force = posed_runs.MASS * turn.inv().apply(posed_runs.UP)
    moment = np.cross(posed_runs.R_CG, force) + posed_runs.ZERO[3:]
    columns = np.hstack([np.degrees(angles), force + posed_runs.ZERO[:3], moment])
    head = ",".join([*posed_runs.NAMES, "fx", "fy", "fz", "tx", "ty", "tz"])
    np.savetxt(tmp_path / "p.csv", columns, delimiter=",", header=head, comments="", fmt="%.9g")
    poses = {
        "force": ["fx", "fy", "fz"], "moment": ["tx", "ty", "tz"],
        "joints": {name: name for name in posed_runs.NAMES}, "angle_unit": "deg",
    }  # fmt: skip
    recording = {"urdf": str(tmp_path / "arm.urdf"), "urdf_frame": "tool"}
    centre = weighed(tmp_path / "p.csv", poses, recording)
    assert centre.mass == pytest.approx(posed_runs.MASS, abs=1e-4)
    np.testing.assert_allclose(centre.r_cg, posed_runs.R_CG, atol=1e-5)
    assert centre.warnings == ()
    up = {"urdf_gravity": ["0 m/s^2", "0 m/s^2", "9.81 m/s^2"]}
    with pytest.raises(RunError, match=r"gravity is upside down.*-9\.810"):
        weighed(tmp_path / "p.csv", poses, recording | up)
