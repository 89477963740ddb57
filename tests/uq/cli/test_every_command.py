"""Every command once, by its cheapest real use, against what its input is known to hold: what `make quick` runs of them."""

import json
import re
import shutil
import tomllib
from importlib import resources

import jsonschema
import numpy as np
import pytest

from rig import runs
from rig.channels import ImuChannel, WrenchChannel
from uq.cli.main import COMMANDS, main
from uq.experiment.experiment import Experiment

E = "t1-10s.toml"
INERTIA = {"I11": 0.3813, "I22": 0.0185, "I33": 0.3791}
"""Tensor of the body in that experiment, products zero [kg m²]."""
N, RATE = 4000, 400


@pytest.fixture(scope="module")
def bench(tmp_path_factory):
    """A folder with the examples, one of them simulated, as `examples` and `simulate` write them."""
    folder = tmp_path_factory.mktemp("bench")
    assert main(["examples", "-o", str(folder)]) == 0
    assert main(["simulate", str(folder / E), "-o", str(folder / "simulated.mcap")]) == 0
    return folder


@pytest.fixture
def said(bench, capsys, monkeypatch):
    """Call a command in the folder; return what it prints."""
    monkeypatch.chdir(bench)
    monkeypatch.setenv("COLUMNS", "120")

    def said(*arguments, status=0):
        assert main([*arguments]) == status
        return capsys.readouterr().out

    return said


def numbers(row):
    return [float(cell.replace("−", "-")) for cell in re.findall(r"(?<![\w.])−?\d+\.?\d*", row)]


def test_each_command_has_a_test():
    assert {f"test_{name}" for name in COMMANDS} <= set(globals())


def test_examples(bench):
    shipped = resources.files("uq").joinpath("examples", E).read_text("utf-8").splitlines()
    copied = (bench / E).read_text("utf-8").splitlines()
    assert copied[1:] == shipped[1:]  # the first line names the installed schema


def test_simulate(bench):
    """Noise of 5 N in 4000 samples: its standard deviation is known within 1.1 %; of three axes, five of that."""
    run = runs.read(bench / "simulated.mcap")
    assert len(run.wrench.force) == len(run.imu.angular_velocity) == N
    white = np.sqrt((np.diff(run.wrench.force, 4, axis=0) ** 2).mean(axis=0) / 70)  # of fourth differences
    np.testing.assert_allclose(white, [5, 5, 10], rtol=0.08)


def test_calibrate(bench, said):
    """No error of the rig acts: each mean is within three of its standard uncertainties of zero."""
    (bench / "open.toml").write_text((bench / E).read_text("utf-8").replace('undeclared = "none"', ""))
    moments = [f'{name} = "{value} g*m^2"' for name, value in (("I11", 381.3), ("I22", 18.5), ("I33", 379.1))]
    lines = ['about = "CG"', 'products = "tensor"', 'mass = "19.7 kg"', 'cg = ["0 mm", "0 mm", "53 mm"]']
    (bench / "standard.toml").write_text("\n".join(["[cad]", *lines, "[cad.inertia]", *moments]))
    options = ["--known", "standard.toml", "--experiment", "open.toml", "-o", "rig.toml"]
    assert "rig.toml is written" in said("calibrate", "simulated.mcap", *options)
    sources = Experiment.from_dict({"include": ["rig.toml"]}, bench).sources
    assert all((np.abs(source.mean) < 3 * source.sigma + 1e-12).all() for source in sources)


def test_inspect(said):
    found = json.loads(said("inspect", "simulated.mcap", "--json"))
    assert found["findings"] == []
    assert {(c["topic"], c["samples"], round(c["rate_hz"])) for c in found["channels"]} == {
        ("/imu", N, RATE), ("/wrench", N, RATE),
    }  # fmt: skip


def test_identify(said, bench):
    """Each component within five standard uncertainties: 3e-6 that one of the six is beyond."""
    said("identify", "simulated.mcap", "--experiment", E, "--out", "identified")
    result = json.loads((bench / "identified" / "result.json").read_text("utf-8"))
    for name, value in result["inertia"].items():
        assert abs(value - INERTIA.get(name, 0.0)) < 5 * result["standard_uncertainty"][name], name
    assert (bench / "identified" / "report.html").exists()


def test_recover(said, bench):
    """Of three quarters of a file the whole chunks, an eighth of the run each; status 1, since something is missing."""
    content = (bench / "simulated.mcap").read_bytes()
    (bench / "cut.mcap").write_bytes(content[: 3 * len(content) // 4])
    said("recover", "cut.mcap", "-o", "whole.mcap", status=1)
    saved, whole = (runs.read(bench / name).wrench.force for name in ("whole.mcap", "simulated.mcap"))
    assert 0.6 * N < len(saved) < 0.8 * N
    np.testing.assert_array_equal(saved, whole[: len(saved)])


def test_record(said, bench):
    """An emulator of the sensor's serial line plays the simulated run for a second."""
    shutil.copy(bench / "rig-emulated.toml", bench / "rig.toml")
    summary = json.loads(said("record", "rig.toml", "-o", "recorded.mcap", "--seconds", "1", "--json"))
    assert summary["complete"]
    assert [device["missing"] for device in summary["devices"].values()] == [0, 0]
    recorded, played = (runs.read(bench / name) for name in ("recorded.mcap", "simulated.mcap"))
    for sensor, rate in ((recorded.wrench, 800), (recorded.imu, RATE)):
        assert len(sensor.stamp) > rate / 2
        assert np.median(np.diff(sensor.stamp)) == pytest.approx(1e9 / rate, rel=0.01)
    rows = recorded.imu.angular_velocity[::50]
    assert all(np.abs(played.imu.angular_velocity - row).max(axis=1).min() < 1e-6 for row in rows)  # single precision


def test_import(said, bench, generator):
    force, moment, omega = (generator.normal(size=(50, 3)) for _ in range(3))
    table = np.column_stack([0.01 * np.arange(50), force / 4.4482216152605, 1e3 * moment, np.degrees(omega)])
    names = "t,fx,fy,fz,mx,my,mz,wx,wy,wz"
    np.savetxt(bench / "table.csv", table, delimiter=",", header=names, comments="", fmt="%.17g")
    (bench / "map.toml").write_text(
        '[columns]\ntime = "t"\ntime_unit = "s"\nforce = ["fx", "fy", "fz"]\nmoment = ["mx", "my", "mz"]\n'
        'angular_velocity = ["wx", "wy", "wz"]\n[recording]\nwrench = "on_body"\nforce_unit = "lbf"\n'
        'moment_unit = "N*mm"\nangular_velocity_unit = "deg/s"\n'
    )
    said("import", "table.csv", "--map", "map.toml", "-o", "imported.mcap")
    run = runs.read(bench / "imported.mcap")
    for got, value in ((run.wrench.force, force), (run.wrench.moment, moment), (run.imu.angular_velocity, omega)):
        np.testing.assert_allclose(got, value, rtol=1e-12)


def test_noise(said, bench, generator):
    """White noise in 20,000 samples: its level is known within 0.5 %; six times that."""
    n = 20_000
    time = 10**9 + np.arange(n) * (10**9 // RATE)
    force, moment, omega, f = (size * generator.normal(size=(n, 3)) for size in (0.1, 0.005, 1e-3, 0.01))
    about = {"frame_id": "body", "log_time": time, "stamp": time}
    wrench = WrenchChannel(topic="/wrench", force=force, moment=moment, **about)
    imu = ImuChannel(topic="/imu", angular_velocity=omega, linear_acceleration=f + [0, 0, 9.81], **about)
    runs.write(bench / "still.mcap", wrench=wrench, imu=imu)
    said("noise", "still.mcap", "-o", "sources.toml")
    sources = tomllib.loads((bench / "sources.toml").read_text("utf-8"))["source"]
    found = {source["target"]: [float(axis.split()[0]) for axis in source["white"]] for source in sources}
    for target, size in (("F", 0.1), ("M", 0.005), ("omega", 1e-3)):
        np.testing.assert_allclose(found[target], size / np.sqrt(RATE), rtol=0.03)


def test_centre(said, bench):
    """Of a simulated weighing of 19.7 kg, 53 mm above Q; each within five standard uncertainties (2e-6)."""
    said("centre", "weigh.csv", "--experiment", "weigh.toml", "--out", "centre")
    centre = json.loads((bench / "centre" / "centre.json").read_text("utf-8"))
    for name, truth in (("mass", 19.7), ("cg", [0, 0, 0.053])):
        error = np.subtract(centre[name]["value"], truth)
        assert (np.abs(error) < 5 * np.array(centre[name]["standard_uncertainty"])).all(), name


def test_plan(said, bench):
    """White noise is nearly all: half the 3σ takes four times what is between the ramps, which take up to 3 s."""
    said("plan", E, "--out", "planned")
    printed = " ".join(json.loads((bench / "planned" / "result.json").read_text("utf-8"))["answers"])
    durations = [float(seconds) for seconds in re.findall(r"measure for ([\d.]+) s", printed)]
    assert len(durations) == 2
    assert all(4 * (10 - 3) + 3 < seconds < 40 for seconds in durations), durations


def test_design(bench, capsys):
    """A search takes a minute (``test_design.py``): here the experiment is read, and a trajectory missed."""
    assert main(["design", str(bench / E), "--reference", "T9"]) == 2
    assert "unknown trajectory 'T9'" in capsys.readouterr().err


def test_montecarlo(said):
    """200 trials beside the law of propagation: twelve figures within 4.5 standard errors (8e-5)."""
    printed = said("montecarlo", E, "--estimator", "smoothed", "--trials", "200", "--law")
    apart = [
        numbers(row) for row in printed.partition("Law of propagation")[2].splitlines() if re.match(r"I\d\d ", row)
    ]
    assert len(apart) == 6
    assert (np.abs(np.array(apart)[:, [3, 7]]) < 4.5).all()


def test_paper(said):
    """200 trials: an average 3σ has a standard error of 3 %; eight of them within five of it of the paper's figure."""
    printed = said("paper", "--trials", "200")
    rows = re.findall(r"3σ moments ([\d.]+) \(([\d.]+)\)", printed)
    assert len(rows) == 8
    ours, papers = np.array(rows, float).T
    np.testing.assert_allclose(ours, papers, rtol=0.15)


@pytest.mark.parametrize("kind", ["experiment", "rig"])
def test_schema(said, bench, kind):
    schema = json.loads(said("schema", kind))
    file = {"experiment": E, "rig": "rig-emulated.toml"}[kind]
    jsonschema.validate(tomllib.loads((bench / file).read_text("utf-8")), schema)
    with pytest.raises(jsonschema.ValidationError):
        jsonschema.validate({"no such key": 1}, schema)
