"""Every attitude that static poses may have tells the motion of a log, too; a position tells its specific force."""

import tomllib

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from rig import runs
from tests.helpers import posed_runs
from uq.cli.main import main
from uq.experiment.experiment import Experiment
from uq.runs.identification.identify_files import identify_files
from uq.runs.tables.import_table import import_table
from uq.runs.tables.table_map import Map

ATTITUDES = {
    "matrix": (lambda turn: turn.as_matrix().reshape(-1, 9), ""),
    "rotation_vector": (lambda turn: turn.as_rotvec(degrees=True), 'angle_unit = "deg"'),
    "euler": (lambda turn: turn.as_euler("ZYX"), 'angle_unit = "rad"\neuler_convention = "kuka"'),
    "quaternion": (lambda turn: turn.as_quat()[:, [3, 0, 1, 2]], ""),
}


@pytest.fixture(scope="module")
def clean():
    return posed_runs.measured(3, seconds=8.0, rate=125.0)


def table(path, run, attitude, *more):
    names = [f"q{k}" for k in range(attitude.shape[1])]
    head = ["t", *names, "Fx", "Fy", "Fz", "Mx", "My", "Mz", *("px", "py", "pz")[: 3 * len(more)]]
    columns = np.column_stack([run.t, attitude, run.force, run.moment, *more])
    np.savetxt(path, columns, delimiter=",", header=",".join(head), comments="", fmt="%.12g")
    return names


@pytest.mark.parametrize("takes", ["sensor_to_level", "level_to_sensor"])
@pytest.mark.parametrize("kind", ATTITUDES)
def test_an_attitude_of_a_map_is_that_of_poses(tmp_path, clean, kind, takes):
    write, keys = ATTITUDES[kind]
    told = clean.attitude if takes == "sensor_to_level" else clean.attitude.inv()
    names = table(tmp_path / "t.csv", clean, write(told))
    columns = dict(zip("wxyz", names, strict=True)) if kind == "quaternion" else names
    named = str(columns).replace("'w':", "w =").replace("'x':", "x =").replace("'y':", "y =").replace("'z':", "z =")
    (tmp_path / "m.toml").write_text(
        f'[columns]\ntime = "t"\ntime_unit = "s"\nforce = ["Fx", "Fy", "Fz"]\nmoment = ["Mx", "My", "Mz"]\n{kind} = {named}\n'
        f'takes = "{takes}"\n{keys}\n[recording]\nwrench = "on_body"\nforce_unit = "N"\nmoment_unit = "N*m"\n'
    )
    import_table([tmp_path / "t.csv"], Map.load(tmp_path / "m.toml"), tmp_path / "run.mcap")
    got = Rotation.from_quat(runs.read_any(tmp_path / "run.mcap").motion.orientation)
    assert (got * clean.attitude.inv()).magnitude().max() < 1e-9


@pytest.mark.parametrize(
    "names", [pytest.param("timestamp,rx,ry,rz,px,py,pz", marks=pytest.mark.slow), "timestamp,P_3,P_4,P_5,P_0,P_1,P_2"]
)
def test_a_robots_log_of_position_and_rotation_vector_tells_the_mass(tmp_path, clean, capsys, names):
    path, out = tmp_path / "t.csv", tmp_path / "run.mcap"
    table(path, clean, clean.attitude.as_rotvec(), 1e3 * clean.place)
    names, text = names.replace("P", "actual_TCP_pose").split(","), path.read_text()
    for old, new in zip(["t", "q0", "q1", "q2", "px", "py", "pz"], names, strict=True):
        text = text.replace(old, new, 1)
    path.write_text(text)
    assert main(["import", str(path), "-o", str(out)]) == 1
    mapping = tmp_path / "run.map.toml"
    assert 'position_unit = "mm"' in mapping.read_text()
    assert main(["import", str(path), "--map", str(mapping), "-o", str(out)]) == 0
    document = {
        "platform": {"gravity": "9.81 m/s^2"}, "recording": {"method": "joint"},
        "estimator": [{"name": "s", "differentiator": "savitzky-golay", "band": "3 Hz"}],
    }  # fmt: skip
    result = identify_files(out, Experiment.from_dict(document))
    assert result.mass == pytest.approx(posed_runs.MASS, abs=4e-3)
    assert result.warnings == ()
    capsys.readouterr()


@pytest.mark.parametrize(
    ("lines", "words"),
    [
        ('euler = ["a", "b", "c"]\ntakes = "sensor_to_level"\nangle_unit = "deg"', "euler_convention"),
        ('rotation_vector = ["a", "b", "c"]\nangle_unit = "deg"', "takes"),
        ('angular_velocity = ["a", "b", "c"]\nposition = ["d", "e", "f"]', "belongs to an attitude alone"),
    ],
)
def test_what_a_map_lacks_is_one_line(tmp_path, capsys, lines, words):
    (tmp_path / "m.toml").write_text(
        f'[columns]\nrate = "100 Hz"\nforce = ["Fx", "Fy", "Fz"]\nmoment = ["Mx", "My", "Mz"]\n{lines}\n'
        '[recording]\nwrench = "on_body"\nforce_unit = "N"\nmoment_unit = "N*m"\nangular_velocity_unit = "rad/s"\n'
    )
    (tmp_path / "t.csv").write_text("Fx\n1\n")
    command = ["import", str(tmp_path / "t.csv"), "--map", str(tmp_path / "m.toml"), "-o", str(tmp_path / "r.mcap")]
    assert main(command) == 2
    assert words in capsys.readouterr().err


def test_the_limit_of_the_band_that_is_printed_is_accepted(tmp_path, clean):
    """At a rate too low for the motion as it seems; below the limit it is read without a declared band."""
    from identify.signals.angular_velocity_from_attitude import differentiator

    draw = np.random.default_rng(1)
    for rate in (20.0, 31.3, 62.5, 100.0):
        with pytest.raises(Exception, match="here at most") as refused:
            differentiator(draw.normal(size=(400, 4)), rate, "x", band=rate / 3, by_turning=0.2)
        limit = float(str(refused.value).split("at most ")[1].split()[0])
        assert len(differentiator(draw.normal(size=(400, 4)), rate, "x", band=limit, by_turning=0.2))


def test_columns_that_never_change_are_no_sensor(tmp_path, clean, capsys):
    """An exporter fills what nothing measures with zeros: here the accelerometer, then the load cell."""
    nothing = np.zeros((len(clean.t), 3))
    for values, signals in (
        ((clean.omega, nothing, clean.force, clean.moment), ["time", "angular_velocity", "force", "moment"]),
        ((clean.omega, nothing, nothing, nothing), []),
    ):
        head = "t,wx,wy,wz,ax,ay,az,Fx,Fy,Fz,Mx,My,Mz"
        np.savetxt(tmp_path / "t.csv", np.column_stack([clean.t, *values]), delimiter=",", header=head, comments="")
        status = main(["import", str(tmp_path / "t.csv"), "-o", str(tmp_path / "run.mcap")])
        if signals:
            columns = tomllib.loads((tmp_path / "run.map.toml").read_text())["columns"]
            assert set(columns) == {*signals, "time_unit"}
        else:
            assert status == 2
            assert "needs a wrist sensor: torques of joints are not used" in capsys.readouterr().err


def test_an_attitude_and_a_position_that_never_change_are_not_proposed(tmp_path, clean, capsys):
    """As of a robot's recorder that writes what it does not know as it was at first: the joints count."""
    rest = np.tile([0.4, 0.1, 0.5], (len(clean.t), 1))
    for vector, names in (
        (rest, {"joints", "joint_unit"}),
        (clean.attitude.as_rotvec(), {"rotation_vector", "takes", "angle_unit"}),
    ):
        head = "timestamp,Fx,Fy,Fz,Mx,My,Mz,rx,ry,rz,px,py,pz," + ",".join(f"actual_q_{k}" for k in range(6))
        columns = np.column_stack([clean.t, clean.force, clean.moment, vector, rest, clean.joints])
        np.savetxt(tmp_path / "t.csv", columns, delimiter=",", header=head, comments="")
        assert main(["import", str(tmp_path / "t.csv"), "-o", str(tmp_path / "run.mcap")]) == 1
        columns = tomllib.loads((tmp_path / "run.map.toml").read_text())["columns"]
        assert set(columns) - {"time", "time_unit", "force", "moment"} == names
        (tmp_path / "run.map.toml").unlink()
    capsys.readouterr()


def test_a_recording_without_a_wrench_is_told_what_it_needs(tmp_path, clean, capsys):
    run = runs.read_any(posed_runs.write(tmp_path / "run", clean, "joints", "mcap"))
    runs.write(tmp_path / "bare.mcap", imu=run.motion)
    posed_runs.experiment(tmp_path, "joints")
    for command in (["inspect"], ["identify", "--experiment", str(tmp_path / "e.toml")]):
        main([command[0], str(tmp_path / "bare.mcap"), *command[1:]])
        said = " ".join("".join(capsys.readouterr()).split())
        assert "needs a wrist sensor: torques of joints are not used" in said
