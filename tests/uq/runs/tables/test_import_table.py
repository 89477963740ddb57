"""Tables of samples become runs that identify as the original does; maps and tables that cannot be used are refused."""

import json

import numpy as np
import pytest

from rig import runs
from uq.cli.main import main
from uq.experiment.recording_table import RecordingTable
from uq.runs.recorded.declared_channels import declared

MAP = """
[columns]
time = "t"
time_unit = "ms"
force = ["Fx", "Fy", "Fz"]
moment = ["Mx", "My", "Mz"]
angular_velocity = ["wx", "wy", "wz"]
acceleration = ["ax", "ay", "az"]
[recording]
wrench = "on_sensor"
force_unit = "lbf"
moment_unit = "N*mm"
angular_velocity_unit = "deg/s"
acceleration_unit = "g"
wrench_rotation_to_body = "y, z, x"
imu_rotation_to_body = "-y, x, z"
"""
CELL = np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0.0]])
IMU = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1.0]])


def signals(draw, n=50):
    """What the run shall hold: on the body, in its frame, SI."""
    return {name: draw.normal(size=(n, 3)) for name in ("force", "moment", "omega", "acceleration")}


def columns(run, start=1_700_000_000_000.0):
    """The same as the table has it, declared by ``MAP``."""
    n = len(run["force"])
    raw = {
        "F": -run["force"] @ CELL / 4.4482216152605,
        "M": -1e3 * run["moment"] @ CELL,
        "w": np.degrees(run["omega"] @ IMU),
        "a": run["acceleration"] @ IMU / 9.80665,
    }
    axes = {f"{name}{axis}": values for name, of in raw.items() for axis, values in zip("xyz", of.T, strict=True)}
    return {"t": start + 2.0 * np.arange(n), "note": ["-"] * n} | axes


def write(path, table):
    lines = [",".join(table), *(",".join(map(str, row)) for row in zip(*table.values(), strict=True))]
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.fixture
def files(tmp_path, generator):
    (tmp_path / "map.toml").write_text(MAP)
    run = signals(generator)
    return run, write(tmp_path / "t.csv", columns(run)), tmp_path / "map.toml", tmp_path / "run.mcap"


def test_units_signs_and_frames_are_undone(files, capsys):
    run, table, mapping, out = files
    assert main(["import", str(table), "--map", str(mapping), "-o", str(out)]) == 0
    said = f"50 samples written to {out}\nassumed: the moment is taken about Q\n"
    assert capsys.readouterr().out == said
    got = runs.read(out)
    assert not declared(
        got, RecordingTable()
    ).cell_axes  # so `centre` cannot tell the cell's own reading without a load
    for values, name in (
        (got.wrench.force, "force"),
        (got.wrench.moment, "moment"),
        (got.imu.angular_velocity, "omega"),
        (got.imu.linear_acceleration, "acceleration"),
    ):
        np.testing.assert_allclose(values, run[name], rtol=1e-12, atol=1e-13)
    np.testing.assert_array_equal(got.wrench.stamp, 1_700_000_000_000_000_000 + 2_000_000 * np.arange(50))
    about = got.metadata["rig.run"]
    assert about["wrench"] == "on_body"
    assert json.loads(about["units"])["moment"] == "N*m"
    assert json.loads(about["imported"])["file"] == "t.csv"
    assert json.loads(about["assumed"]) == ["the moment is taken about Q"]


def test_a_table_without_times_or_accelerations(files):
    _, table, mapping, out = files
    text = MAP.replace('time = "t"\ntime_unit = "ms"', 'rate = "400 Hz"').replace(
        'acceleration = ["ax", "ay", "az"]', ""
    )
    mapping.write_text(text.replace('acceleration_unit = "g"', ""))
    assert main(["import", str(table), "--map", str(mapping), "-o", str(out)]) == 0
    got = runs.read(out)
    np.testing.assert_array_equal(got.imu.stamp, 2_500_000 * np.arange(50))
    assert "no acceleration was imported" in json.loads(got.metadata["rig.run"]["frames"])["/imu"]


def test_times_below_zero_begin_at_zero(files):
    run, table, mapping, out = files
    write(table, columns(run, start=-10.0))
    assert main(["import", str(table), "--map", str(mapping), "-o", str(out)]) == 0
    assert runs.read(out).imu.stamp[:3].tolist() == [0, 2_000_000, 4_000_000]


def refused(capsys, table, mapping, out):
    before = sorted(table.parent.iterdir())
    assert main(["import", str(table), "--map", str(mapping), "-o", str(out)]) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.startswith("error: ")
    assert said.err.count("\n") == 1
    assert sorted(table.parent.iterdir()) == before
    return said.err


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('wrench = "on_sensor"', "", "missing key recording.wrench: add it"),
        ('force_unit = "lbf"', "", "missing key recording.force_unit: add it, t.csv does not state it"),
        ('force_unit = "lbf"', "force_unit = 4.45", "recording.force_unit is 4.45: write a string"),
        ('force_unit = "lbf"', 'force_unit = "lb"', "recording.force_unit is 'lb'"),
        ('time_unit = "ms"', "", "columns.time_unit belongs to a time column: add it"),
        ('time_unit = "ms"', 'time_unit = "mm"', "columns.time_unit is 'mm'"),
        ('time_unit = "ms"', 'time_unit = "ms"\nrate = "100 Hz"', "times in t.csv depart by 0.392 s from 100 Hz"),
        ('time = "t"\ntime_unit = "ms"', "", "columns has neither time nor rate"),
        ('time = "t"\ntime_unit = "ms"', "rate = 100", "columns.rate is 100: write a value with its unit"),
        ('moment = ["Mx", "My", "Mz"]', "", "missing key columns.moment: add it"),
        ('"Mx"', '"Tx"', "no column 'Tx' in t.csv: it has t, note, Fx"),
        ('"Mx"', '"note"', "column 'note' in t.csv is '-' at row 2"),
        ('"Mx"', '"Fx"', "columns names column 'Fx' twice"),
        ("[columns]", "[columns]\ndepth = 3", "unknown key columns.depth"),
        ("[recording]", '[recording]\nzero = "empty"', "unknown key recording.zero: the keys here are"),
        ("[recording]", "[poses]\n[recording]", "unknown key poses"),
        ('"y, z, x"', '"y, z, z"', "is not three signed axes"),
        ("[columns]", "[columns", "not TOML"),
    ],
)
def test_maps_that_cannot_be_used(files, capsys, old, new, words):
    _, table, mapping, out = files
    assert old in MAP
    mapping.write_text(MAP.replace(old, new, 1))
    assert words in refused(capsys, table, mapping, out)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda c: c | {"t": [*c["t"][:9], *c["t"][8:-1]]}, "time in t.csv does not increase after sample 9"),
        (lambda c: c | {"t": c["t"] // 10 * 10}, 'come at 500 Hz: add rate = "500 Hz"'),
        (lambda c: c | {"t": np.roll(c["t"], 9)}, "time in t.csv starts again after sample 9: write rate"),
        (lambda c: c | {"t": 1e6 * c["t"]}, "time in t.csv reaches 1.7e+15 s: correct columns.time_unit"),
        (lambda c: c | {"wy": [*c["wy"][:3], "inf", *c["wy"][4:]]}, "column 'wy' in t.csv is 'inf' at row 5"),
        (lambda c: c | {"wy": [*c["wy"][:3], "3;4", *c["wy"][4:]]}, "column 'wy' in t.csv is '3;4' at row 5"),
    ],
)
def test_tables_that_cannot_be_used(files, capsys, change, words):
    run, table, mapping, out = files
    write(table, change(columns(run)))
    assert words in refused(capsys, table, mapping, out)


def test_a_run_is_not_overwritten(files, capsys):
    _, table, mapping, out = files
    out.write_bytes(b"precious")
    assert "output exists" in refused(capsys, table, mapping, out)
    assert out.read_bytes() == b"precious"
    assert "no folder" in refused(capsys, table, mapping, out.parent / "none" / "run.mcap")
