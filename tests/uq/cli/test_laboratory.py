"""The complete example of an experiment file: every table once, and every command that it names runs."""

import json
import tomllib
from pathlib import Path

import numpy as np
import pytest

from tests.helpers.result_schema import contradictions
from uq.cli.main import main

ROOT = Path(__file__).parents[3]
FILE = ROOT / "uq" / "examples" / "laboratory.toml"


def poses(path: Path) -> None:
    """Twelve static poses of the file's body, by Newton's second law; no code of the program."""
    rng = np.random.default_rng(1)
    mass, r_cg, gravity = 19.7, np.array([0, 0, 0.053]), 9.8127
    up = rng.normal(size=(12, 3))
    f = gravity * up / np.linalg.norm(up, axis=1, keepdims=True)
    force = mass * f + [4, -7, 2.5] + rng.normal(scale=0.2, size=f.shape)
    moment = np.cross(r_cg, mass * f) + [0.3, -0.1, 0.7] + rng.normal(scale=0.005, size=f.shape)
    names = "fx,fy,fz,tx,ty,tz,ax,ay,az"
    np.savetxt(path, np.hstack([force, moment, f]), delimiter=",", header=names, comments="")


def test_every_table_of_the_schema_is_in_the_complete_example():
    schema = json.loads((ROOT / "uq" / "schemas" / "experiment.json").read_text("utf-8"))
    other_files = {"include", "calibration"}  # the second is in a file that `inertia calibrate` writes
    assert set(tomllib.loads(FILE.read_text("utf-8"))) == set(schema["properties"]) - other_files


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    folder = tmp_path_factory.mktemp("laboratory")
    poses(folder / "poses.csv")
    run = str(folder / "run.mcap")
    assert main(["simulate", str(FILE), "-o", run]) == 0
    assert main(["centre", str(folder / "poses.csv"), "--experiment", str(FILE), "--out", str(folder / "weighed")]) == 0
    centre = str(folder / "weighed" / "centre.json")
    arguments = ["--experiment", str(FILE), "--centre", centre, "--out", str(folder / "certificate")]
    assert main(["identify", run, *arguments]) == 0
    return folder


def test_its_result_files_follow_the_shipped_schema_which_misses_a_key(bench):
    for path in (bench / "weighed" / "centre.json", bench / "certificate" / "result.json"):
        content = json.loads(path.read_text("utf-8"))
        assert contradictions(json.dumps(content)) == []
        for key in ("version", "covariance", "warnings"):
            assert contradictions(json.dumps({name: value for name, value in content.items() if name != key})) != []


def test_inspection_of_its_recording_has_no_finding(bench):
    assert main(["inspect", str(bench / "run.mcap"), "--experiment", str(FILE)]) == 0


def test_its_certificate_holds_the_declared_body_without_its_fixture(bench):
    """Against the parallel-axis theorem by hand, from the file's own figures; chance of a false alarm 1e-3."""
    mass, fixture_mass = 19.7, 1.8
    r_cg, fixture_r_cg = np.array([0, 0, 0.053]), np.array([0.001, 0.002, 0.018])
    whole = np.diag([0.3813, 0.0185, 0.3791])
    fixture = np.array([[6, 0, 0.5], [0, 4, 0], [0.5, 0, 9]]) * 1e-3
    body_r_cg = (mass * r_cg - fixture_mass * fixture_r_cg) / (mass - fixture_mass)

    def steiner(mass, offset):
        return mass * (offset @ offset * np.eye(3) - np.outer(offset, offset))

    body = whole + steiner(mass, r_cg - body_r_cg) - fixture - steiner(fixture_mass, fixture_r_cg - body_r_cg)
    result = json.loads((bench / "certificate" / "result.json").read_text("utf-8"))
    names = list(result["inertia"])
    truth = np.array([body[int(name[1]) - 1, int(name[2]) - 1] for name in names])
    deviation = np.array(list(result["inertia"].values())) - truth
    covariance = np.array(result["covariance"])  # in the order of the components in the file
    assert deviation @ np.linalg.solve(covariance, deviation) < 22.46  # chi-squared, 6 degrees of freedom
    assert result["standard_uncertainty"]["I11"] < 0.003
