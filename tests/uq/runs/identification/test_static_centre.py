"""Mass, centre of gravity and offsets from tables and runs of static poses; bad ones are refused."""

import json
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from identify.estimation.static_poses.centre import centre
from identify.estimation.static_poses.centre_result import PARAMETERS
from identify.signals.run import RunError
from rig import runs
from rig.channels import ImuChannel, WrenchChannel
from tests.helpers.commands import refused
from tests.helpers.pose_lab import FORCE_OFFSET, GRAVITY, MASS, MOMENT_OFFSET, R_CG, TRUTH, directions, log, wrench_of
from uq.cli.main import main
from uq.experiment.experiment import Experiment
from uq.runs.identification.static_centre import centre_file
from uq.runs.recorded.time_window import TimeWindow

pytestmark = pytest.mark.usefixtures("results_follow_their_schema")

ROOT = Path(__file__).parents[4]
POSES = ROOT.parent / "shared" / "data" / "poses" / "calibration_poses.csv"

# Tables

TABLE = """
[platform]
gravity = "9.81 m/s^2"
[recording]
wrench = "on_sensor"
force_unit = "lbf"
moment_unit = "N*mm"
wrench_rotation_to_body = "y, z, x"
wrench_point = ["0 mm", "0 mm", "-30 mm"]
imu_rotation_to_body = "-y, z, -x"
{recording}
[poses]
force = ["Fx", "Fy", "Fz"]
moment = ["Mx", "My", "Mz"]
{poses}
"""
ATTITUDES = {
    "gravity": 'gravity = ["g1", "g2", "g3"]',
    "acceleration": 'acceleration = ["a1", "a2", "a3"]',
    "matrix": 'takes = "sensor_to_level"\nmatrix = ["r1", "r2", "r3", "r4", "r5", "r6", "r7", "r8", "r9"]',
    "quaternion": 'takes = "level_to_sensor"\nquaternion = { w = "qw", x = "qx", y = "qy", z = "qz" }',
}


def experiment(attitude="gravity", *, table=TABLE, extra="", recording=""):
    import tomllib

    if attitude == "acceleration":
        recording += '\nacceleration_unit = "g"'
    return Experiment.from_dict(tomllib.loads(table.format(poses=ATTITUDES[attitude] + extra, recording=recording)))


def rows(generator, n=12):
    """The table of a cell on the other side, its axes turned, in lbf and N·mm about a point below Q."""
    level = Rotation.random(n, rng=generator)  # from the IMU's frame to the level frame
    imu_to_body = np.array([[0, -1, 0], [0, 0, 1], [-1, 0, 0.0]])
    cell_to_body = np.array([[0, 1, 0], [0, 0, 1], [1, 0, 0.0]])
    up = level.as_matrix()[:, 2]
    force, moment = wrench_of(GRAVITY * up @ imu_to_body.T)
    moment = moment - np.cross([0, 0, -0.03], force)
    columns = {f"F{a}": v for a, v in zip("xyz", (-force @ cell_to_body / 4.4482216152605).T, strict=True)}
    columns |= {f"M{a}": v for a, v in zip("xyz", (-1e3 * moment @ cell_to_body).T, strict=True)}
    columns |= {f"g{k}": v for k, v in enumerate(-GRAVITY * up.T, 1)}
    columns |= {f"a{k}": v for k, v in enumerate((1.01 * GRAVITY * up + [0.2, -0.5, 0.3]).T / 9.80665, 1)}
    columns |= {f"r{k}": v for k, v in enumerate(level.as_matrix().reshape(n, 9).T, 1)}
    return columns | {f"q{a}": v for a, v in zip("xyzw", level.inv().as_quat().T, strict=True)}


def write(path, columns, *, delimiter=",", decimal=".", start=""):
    table = zip(*columns.values(), strict=True)
    cells = [[str(value).replace(".", decimal) for value in row] for row in table]
    lines = [delimiter.join(row) for row in [list(columns), *cells]]
    path.write_text(start + "\n".join(lines) + "\n", "utf-8")
    return path


@pytest.mark.parametrize("attitude", list(ATTITUDES))
def test_declared_conventions_and_every_attitude_give_the_same(tmp_path, generator, attitude):
    columns = rows(generator)
    found = centre_file(write(tmp_path / "p.csv", columns), experiment(attitude))
    np.testing.assert_allclose(found.values, TRUTH, rtol=1e-9, atol=1e-10)
    if attitude == "acceleration":
        assert "the accelerometer's offset is (0.200, −0.500, 0.300) m/s², its gain 1.0100" in found.assumptions
    # without a load the cell reads its zero: the offsets in its own sign, axes and about its own point, in SI
    at_point = MOMENT_OFFSET - np.cross([0, 0, -0.03], FORCE_OFFSET)
    expected = -np.concatenate([np.roll(FORCE_OFFSET, 1), np.roll(at_point, 1)])
    np.testing.assert_allclose(found.zero, expected, rtol=1e-9)


@pytest.mark.parametrize("attitude", list(ATTITUDES))
def test_an_attitude_beyond_any_sensor_is_refused_without_a_warning_of_numpy(tmp_path, generator, attitude):
    columns = rows(generator)
    columns[{"gravity": "g1", "acceleration": "a1", "matrix": "r1", "quaternion": "qx"}[attitude]][4] = 1e300
    with pytest.raises(RunError, match=rf"^{attitude} in p.csv is 1.0e\+300 at sample 4: no sensor reads so much"):
        centre_file(write(tmp_path / "p.csv", columns), experiment(attitude))


def test_a_force_beyond_any_sensor_is_refused_before_axes_are_judged(tmp_path, generator):
    columns = rows(generator)
    columns[next(name for name in columns if name.lower().startswith("f"))][0] = -6.7e263
    with pytest.raises(RunError, match=r"^force in p.csv is 6.7e\+263 at sample 0: no sensor reads so much"):
        centre_file(write(tmp_path / "p.csv", columns), experiment("acceleration"))


def test_a_turned_attitude_sensor_is_named_with_its_cure(tmp_path, generator):
    """Declared 3 degrees off: the cure is the rotation that made the table, unless such a turn is declared."""
    path, true = write(tmp_path / "p.csv", rows(generator)), np.array([[0, -1, 0], [0, 0, 1], [-1, 0, 0.0]])
    wrong = (Rotation.from_rotvec(np.radians([1.0, 2.0, 2.0])).as_matrix() @ true).tolist()
    table = TABLE.replace('imu_rotation_to_body = "-y, z, -x"', f"imu_rotation_to_body = {wrong}")
    (text,) = centre_file(path, experiment(table=table)).warnings
    assert 'set imu_rotation_to_body = "-y, z, -x" in [recording]' in text
    stated = experiment(table=table, extra='\nsigma_alignment = "2 deg"')
    assert not any("turn" in text for text in centre_file(path, stated).warnings)


def test_a_spreadsheets_dialect(tmp_path, generator):
    declared = experiment(extra='\ndelimiter = ";"\ndecimal = ","')
    path = write(tmp_path / "p.csv", rows(generator), delimiter=";", decimal=",", start="\ufeff")
    np.testing.assert_allclose(centre_file(path, declared).values, TRUTH, rtol=1e-9)


def test_centre_json_holds_the_covariance_by_name(tmp_path, generator, capsys):
    (tmp_path / "e.toml").write_text(TABLE.format(poses=ATTITUDES["gravity"], recording=""))
    path = write(tmp_path / "p.csv", rows(generator))
    out = tmp_path / "out"
    assert main(["centre", str(path), "--experiment", str(tmp_path / "e.toml"), "--out", str(out)]) == 0
    content = json.loads((out / "centre.json").read_text())
    assert content["parameters"] == list(PARAMETERS)
    assert np.shape(content["covariance"]) == (10, 10)
    assert content["mass"]["value"] == pytest.approx(MASS)
    assert content["cg"]["value"] == pytest.approx(R_CG.tolist())
    assert {"centre.json", "report.html"} <= {file.name for file in out.iterdir()}
    assert "mass 3.700 kg" in capsys.readouterr().out


def test_the_result_shows_itself(generator):
    f = directions(generator, 8, None)
    force, moment = wrench_of(f)
    found = centre(force + 0.1 * generator.normal(size=force.shape), moment, f)
    assert "centre of gravity, mm" in repr(found)
    assert "<table>" in found._repr_html_()
    assert set(found.to_dict()) >= {"mass", "cg", "offsets", "covariance", "parameters", "units", "residual"}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda c: {k: v for k, v in c.items() if k != "Fy"}, "no column 'Fy' in p.csv: it has Fx, Fz"),
        (lambda c: c | {"Mz ": c["Mz"]}, "2 columns 'Mz' in p.csv"),
        (lambda c: c | {"g2": [*c["g2"][:6], "nan", *c["g2"][7:]]}, "column 'g2' in p.csv is empty or NaN at row 8"),
        (lambda c: c | {"Fx": [*c["Fx"][:-1], "1e999"]}, "column 'Fx' in p.csv is 'inf' at row 13"),
        (lambda c: c | {"Fx": ["", *c["Fx"][1:]]}, "column 'Fx' in p.csv is empty or NaN at row 2"),
        (lambda c: c | {"Fx": ["1_0", *c["Fx"][1:]]}, "column 'Fx' in p.csv is '1_0' at row 2"),
        (lambda c: c | {"Fx": ["1,2", *c["Fx"][1:]]}, "a row of p.csv has more cells than others"),
        (lambda c: {k: v[:0] for k, v in c.items()}, "no rows of numbers in p.csv"),
        (lambda c: {k: v[:2] for k, v in c.items()}, "2 poses in p.csv: give three or more"),
        (lambda c: c | dict.fromkeys(("g1", "g2", "g3"), np.zeros(12)), "gravity of pose 1 in p.csv is zero"),
    ],
)
def test_tables_that_cannot_be_used(tmp_path, generator, capsys, change, words):
    (tmp_path / "e.toml").write_text(TABLE.format(poses=ATTITUDES["gravity"], recording=""))
    path = write(tmp_path / "p.csv", change(rows(generator)))
    out = tmp_path / "out"
    assert words in refused(capsys, "centre", path, "--experiment", tmp_path / "e.toml", "--out", out)
    assert not out.exists()


@pytest.mark.parametrize(
    ("attitude", "change", "words"),
    [
        ("matrix", {"r5": 1.0}, "matrix of pose 3 in p.csv is no rotation"),
        ("matrix", {"r1": None}, "matrix of pose 3 in p.csv is left-handed"),
        ("quaternion", {"qw": 2.0}, "quaternion of pose 3 in p.csv has the norm"),
    ],
)
def test_attitudes_that_are_none(tmp_path, generator, attitude, change, words):
    columns = rows(generator)
    for name, value in change.items():
        if value is None:  # the first column mirrored
            for k in (1, 4, 7):
                columns[f"r{k}"][2] *= -1
        else:
            columns[name][2] = value
    with pytest.raises(RunError, match=words):
        centre_file(write(tmp_path / "p.csv", columns), experiment(attitude))


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('["Fx", "Fy", "Fz"]', '["Fx", "Fy"]', "poses.force is ['Fx', 'Fy']: write the names of 3 columns"),
        ('["Fx", "Fy", "Fz"]', "3", "poses.force is 3: write the names of 3 columns"),
        ('["Fx", "Fy", "Fz"]', '["Fx", "Fy", "Mx"]', "poses names column 'Mx' twice"),
        ('gravity = ["g1", "g2", "g3"]', "", "poses describes no attitude"),
        ('gravity = ["g1"', 'acceleration = ["a1", "a2", "a3"]\ngravity = ["g1"', "by gravity and acceleration"),
        ('gravity = ["g1", "g2", "g3"]', ATTITUDES["matrix"].split("\n")[1], "missing key poses.takes"),
        ('gravity = ["g1", "g2", "g3"]', 'quaternion = { w = "qw" }', "missing key poses.quaternion.x"),
        ("[poses]", '[poses]\ndelimiter = "::"', "poses.delimiter is '::'"),
        ("[poses]", '[poses]\ndecimal = ","\ndelimiter = ","', "poses.delimiter is ','"),
        ("[poses]", '[poses]\naccelerometer = "best"', "poses.accelerometer is 'best': choose one of offset, scale"),
        ("[poses]", "[poses]\nheight = 3", "unknown key poses.height"),
        ('"9.81 m/s^2"', "9.81", "platform.gravity is 9.81: write a value with its unit"),
        ('"lbf"', '"m"', "recording.force_unit is 'm'"),
        ('"y, z, x"', '"y, x, z"', "left-handed"),
        ('"on_sensor"', '"on_body"', "force and moment have the reversed sign"),
    ],
)
def test_declarations_that_cannot_be_used(tmp_path, generator, capsys, old, new, words):
    text = TABLE.format(poses=ATTITUDES["gravity"], recording="")
    assert old in text
    (tmp_path / "e.toml").write_text(text.replace(old, new, 1))
    path = write(tmp_path / "p.csv", rows(generator))
    assert words in refused(capsys, "centre", path, "--experiment", tmp_path / "e.toml")


def test_files_that_are_no_tables(tmp_path, capsys):
    (tmp_path / "e.toml").write_text(TABLE.format(poses=ATTITUDES["gravity"], recording=""))
    (tmp_path / "p.csv").write_bytes(b"\x00\x01\xff")
    assert "not a text file" in refused(capsys, "centre", tmp_path / "p.csv", "--experiment", tmp_path / "e.toml")
    (tmp_path / "p.csv").write_text("")
    assert "no rows of numbers in p.csv" in refused(
        capsys, "centre", tmp_path / "p.csv", "--experiment", tmp_path / "e.toml"
    )
    assert "none.csv" in refused(capsys, "centre", tmp_path / "none.csv", "--experiment", tmp_path / "e.toml")
    preset = refused(capsys, "centre", tmp_path / "p.csv", "--experiment", "barreto2016")
    assert "no [poses] table declares the columns of p.csv: name them in [poses]" in preset


def test_an_experiment_without_a_centre_identifies_and_simulates_nothing(tmp_path, generator, capsys):
    (tmp_path / "e.toml").write_text(TABLE.format(poses=ATTITUDES["gravity"], recording=""))
    line = refused(capsys, "identify", tmp_path / "run.mcap", "--experiment", tmp_path / "e.toml")
    assert "estimator" in line or "r_cg_from_q" in line


@pytest.mark.skipif(not POSES.exists(), reason="the table of poses is not at hand")
@pytest.mark.parametrize("attitude", ["matrix", "gravity", "acceleration"])
def test_a_real_load_cells_poses(attitude):
    """Its own least squares: 0.9323 kg, 43.90 mm, (9.08, -1.02, 9.98) N, residuals 0.087 N and 0.0030 N·m."""
    import tomllib

    text = (ROOT / "uq" / "examples" / "poses.toml").read_text()
    document = tomllib.loads(text)
    if attitude != "matrix":
        del document["poses"]["matrix"], document["poses"]["takes"]
        document["poses"][attitude] = {"gravity": ["gx", "gy", "gz"], "acceleration": ["ax", "ay", "az"]}[attitude]
    if attitude == "acceleration":
        document["recording"] |= {"imu_rotation_to_body": "-y, z, -x", "acceleration_unit": "g"}
    found = centre_file(POSES, Experiment.from_dict(document))
    assert found.mass == pytest.approx(0.9323, abs=0.00005 if attitude != "acceleration" else 0.001)
    assert 1e3 * found.r_cg[2] == pytest.approx(43.90, abs=0.005)
    assert found.zero[:3] == pytest.approx([9.08, -1.02, 9.98], abs=0.005)
    assert found.standard_uncertainty[0] == pytest.approx(0.0018 if attitude != "acceleration" else 0.0024, abs=0.0001)
    low, high = 1e3 * found.interval95[3]
    assert (low, high) == pytest.approx((43.90 - 0.33, 43.90 + 0.33), abs=0.02)
    if attitude != "acceleration":
        assert found.residual == pytest.approx((0.087, 0.0030), abs=0.0006)
    else:  # the accelerometer's own offset of 0.08 g is found
        assert "0.759) m/s²" in " ".join(found.assumptions)


def test_a_pose_is_left_out_by_its_number(tmp_path, generator, capsys):
    columns = rows(generator)
    columns["Fx"][4] += 3.0
    (tmp_path / "e.toml").write_text(TABLE.format(poses=ATTITUDES["gravity"], recording=""))
    path = write(tmp_path / "p.csv", columns)
    found = centre_file(path, experiment(), without=[5])
    np.testing.assert_allclose(found.values, TRUTH, rtol=1e-9, atol=1e-10)
    assert "left out as asked: pose 5" in found.assumptions
    command = ["centre", path, "--experiment", tmp_path / "e.toml", "--without"]
    assert main([str(word) for word in [*command, 5]]) == 0
    assert "from 11 poses" in capsys.readouterr().out
    assert "no pose 13 in p.csv: it has 12, counted from 1" in refused(capsys, *command, 13)


def test_a_table_of_samples_is_refused_and_with_its_rate_cut_into_its_still_segments(tmp_path, generator, capsys):
    """Noise of 0.02 N a row; while the body turns, the wrench is 5 % off as if it accelerated."""
    up = log(generator, stops=8, hold=3)
    turns = np.concatenate([np.full(125 * (1 if k % 2 else 3), k % 2) for k in range(15)])
    force, moment = wrench_of(GRAVITY * up)
    force, moment = (w + 0.05 * turns[:, None] * w + 0.02 * generator.normal(size=w.shape) for w in (force, moment))
    columns = dict(zip(("Fx", "Fy", "Fz"), force.T, strict=True))
    columns |= dict(zip(("Mx", "My", "Mz"), moment.T, strict=True))
    columns |= {f"g{k}": v for k, v in enumerate(-GRAVITY * up.T, 1)}
    table = (
        '[platform]\ngravity = "9.81 m/s^2"\n[recording]\nwrench = "on_body"\nforce_unit = "N"\nmoment_unit = "N*m"\n'
    )
    table += '[poses]\nforce = ["Fx", "Fy", "Fz"]\nmoment = ["Mx", "My", "Mz"]\ngravity = ["g1", "g2", "g3"]\n'
    (tmp_path / "e.toml").write_text(table)
    path = write(tmp_path / "log.csv", columns)
    text = refused(capsys, "centre", path, "--experiment", tmp_path / "e.toml")
    assert "the attitude changes from row to row of log.csv" in text
    assert 'rate = "125 Hz"' in text
    (tmp_path / "e.toml").write_text(table + 'rate = "125 Hz"\n')
    found = centre_file(path, Experiment.load(tmp_path / "e.toml"))
    assert found.poses == 8
    assert "8 still segments are its poses" in " ".join(found.assumptions)
    assert (np.abs(found.values - TRUTH) < 5 * found.standard_uncertainty).all()
    early = centre_file(path, Experiment.load(tmp_path / "e.toml"), windows=[TimeWindow(0.0, 19.5)])
    assert early.poses == 5


# Recorded runs


def recorded(
    path, generator, *, poses=8, offset=(0.3, -0.2, 0.5), noise=1.0, accelerometer=True, seconds=3.0, oriented=False
):
    """A run that holds poses for three seconds each and turns to the next in one; its accelerometer is 0.3 m/s² off."""
    rate, still, turn = 200.0, round(seconds * 200), 200
    aims = Rotation.random(poses, rng=generator)
    up, omega, turned = [], [], []
    for k in range(poses):
        step = (aims[k].inv() * aims[(k + 1) % poses]).as_rotvec()
        part = np.linspace(0, 1, turn, endpoint=False)
        smooth, speed = part - np.sin(2 * np.pi * part) / (2 * np.pi), (1 - np.cos(2 * np.pi * part))
        path_of = aims[k] * Rotation.from_rotvec(np.multiply.outer(smooth, step))
        up += [np.tile(aims[k].as_matrix()[2], (still, 1)), path_of.as_matrix()[:, 2]]
        omega += [np.zeros((still, 3)), np.multiply.outer(speed, step)]
        turned += [np.tile(aims[k].as_quat(), (still, 1)), path_of.as_quat()]
    f, omega = GRAVITY * np.vstack(up), np.vstack(omega)
    force, moment = wrench_of(f)
    n = len(f)
    stamp = 10**9 + np.round(np.arange(n) / rate * 1e9).astype(np.int64)
    shake = lambda size: noise * size * generator.normal(size=(n, 3))  # noqa: E731
    seen = f + offset + shake(0.02) if accelerometer else 0 * f
    orientation = np.vstack(turned) if oriented else None
    imu = ImuChannel("/imu", "body", stamp, stamp, omega + shake(1e-3), seen, orientation=orientation)
    wrench = WrenchChannel("/wrench", "body", stamp, stamp, force + shake(0.2), moment + shake(0.005))
    runs.write(path, wrench=wrench, imu=imu, metadata={"rig.run": {"wrench": "on_body"}})
    return path


def test_each_still_segment_of_a_run_is_a_pose(tmp_path, generator):
    """Means over 600 samples: 0.008 N, 0.0002 N·m and 0.0008 m/s² a pose; ten times these in mass, CG and offsets."""
    path = recorded(tmp_path / "run.mcap", generator)
    found = centre_file(path, Experiment.from_dict({"platform": {"gravity": "9.81 m/s^2"}, "poses": {}}))
    assert found.poses == 8
    assert (np.abs(found.values - TRUTH) < 5 * found.standard_uncertainty + 1e-6).all()
    np.testing.assert_allclose(found.mass, MASS, rtol=2e-3)
    np.testing.assert_allclose(found.r_cg, R_CG, atol=2e-4)
    assert "8 still segments are its poses" in " ".join(found.assumptions)
    assert "the accelerometer's offset is (0.3" in " ".join(found.assumptions)


def test_the_quaternion_of_an_imu_without_accelerometer_weighs_the_body(tmp_path, generator):
    path = recorded(tmp_path / "run.mcap", generator, accelerometer=False, oriented=True)
    centre = centre_file(path, Experiment.from_dict({"platform": {"gravity": "9.81 m/s^2"}}))
    assert centre.poses == 8
    assert (np.abs(centre.values - TRUTH) < 5 * centre.standard_uncertainty + 1e-6).all()


def test_only_the_named_parts_of_a_run_count(tmp_path, generator, capsys):
    path = recorded(tmp_path / "run.mcap", generator)
    (tmp_path / "e.toml").write_text('[platform]\ngravity = "9.81 m/s^2"\n[poses]\n')
    command = ["centre", path, "--experiment", tmp_path / "e.toml"]
    assert main([str(a) for a in [*command, "--from", 0, "--to", 15, "--from", 20.5, "--to", 28]]) == 0
    assert "from 6 poses" in capsys.readouterr().out
    assert "2 poses in run.mcap" in refused(capsys, *command, "--to", 7.5)
    assert "no mark 'poses' in run.mcap" in refused(capsys, *command, "--from", "poses")
    assert "is outside run.mcap" in refused(capsys, *command, "--to", 99)


def test_runs_that_hold_no_poses(tmp_path, generator, capsys):
    (tmp_path / "e.toml").write_text("[poses]\n")
    command = ["--experiment", tmp_path / "e.toml"]
    path = recorded(tmp_path / "no.mcap", generator, accelerometer=False)
    assert "neither acceleration nor poses in no.mcap" in refused(capsys, "centre", path, *command)
    path = recorded(tmp_path / "short.mcap", generator, seconds=0.5)
    assert "0 poses in short.mcap" in refused(capsys, "centre", path, *command)
    (tmp_path / "e.toml").write_text('[poses]\n[recording]\ncompensated = "gravity"\n')
    assert "record without compensation" in refused(capsys, "centre", path, *command)
    (tmp_path / "e.toml").write_text('[poses]\n[recording]\nacceleration_unit = "g"\n')
    path = recorded(tmp_path / "units.mcap", generator)
    assert "the accelerometer reads 9.8" in refused(capsys, "centre", path, *command)
    table = write(tmp_path / "p.csv", rows(generator))
    (tmp_path / "e.toml").write_text(TABLE.format(poses=ATTITUDES["gravity"], recording=""))
    assert "is a table, which has no times" in refused(capsys, "centre", table, *command, "--from", 1)
