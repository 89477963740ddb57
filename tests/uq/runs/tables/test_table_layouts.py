"""Tables as instruments write them: each layout imports as the plain table does, by hand or by its proposed map."""

import csv
import io
import json

import numpy as np
import pytest

from rig import runs
from uq.cli.main import main

NAMES = ["time", "Fx", "Fy", "Fz", "Tx", "Ty", "Tz", "wx", "wy", "wz", "ax", "ay", "az"]
UNITS = ["s", "N", "N", "N", "Nm", "Nm", "Nm", "rad/s", "rad/s", "rad/s", "m/s^2", "m/s^2", "m/s^2"]
N, RATE = 60, 250.0
TIME = np.arange(N) / RATE
DATES = [f"2025-06-01 14:03:{7 + t:09.6f}" for t in TIME]


@pytest.fixture
def values():
    """Force, moment, angular velocity and specific force, as a table rounds them."""
    draw = np.random.default_rng(0)
    return np.round(draw.normal(size=(N, 12)) + [20.0, 0, 0, 1, 0, 0, 0, 0, 0, 9.81, 0, 0], 6)


def table(rows, head=NAMES, *, delimiter=",", decimal=".", above="", encoding="utf-8", end=""):
    file = io.StringIO()
    writer = csv.writer(file, delimiter=delimiter, lineterminator=end + "\n")
    writer.writerows([[str(cell).replace(".", decimal) for cell in row] for row in ([head] if head else []) + rows])
    return (above + file.getvalue()).encode(encoding)


def layouts(v):
    """A file by the name of its layout."""
    plain = [[f"{t:.6f}", *row] for t, row in zip(TIME, v, strict=True)]
    labview = "LabVIEW Measurement\t\nDecimal_Separator\t,\n***End_of_Header***\nSamples\t60\n***End_of_Header***\t\n"
    return {
        "plain": table(plain),
        "comments": table(plain, above="# by me\n# 250 Hz\n"),
        "labview": table(plain, [*NAMES, "Comment"], delimiter="\t", decimal=",", above=labview),
        "excel": table(plain, delimiter=";", decimal=",", encoding="utf-8-sig"),
        "dates": table([[date, *row[1:]] for date, row in zip(DATES, plain, strict=True)]),
        "durations": table([[f"{t:.6g} sec", *row[1:]] for t, row in zip(TIME, plain, strict=True)]),
        "days": table([[f"0 days 00:00:{t:09.6f}", *row[1:]] for t, row in zip(TIME, plain, strict=True)]),
        "numbered_sensor": table(plain, ["time", *(f"{name}_1" for name in NAMES[1:7]), *NAMES[7:]]),
        "six_of_a_robot": table(plain, ["timestamp", *(f"ft_raw_wrench_{k}" for k in range(6)), *NAMES[7:]]),
        "catman": table(plain, ["Zeit  1 - Standardmessrate [s]", *NAMES[1:]]),
        "latin1": table([[*row, 21.5] for row in plain], [*NAMES, "Temp °C"], encoding="latin-1"),
        "utf16": table(plain, delimiter="\t", encoding="utf-16")[:-1],  # its logger stopped within a character
        "epoch_ns": table([[1_750_000_000_000_000_123 + round(1e9 * t), *row[1:]] for t, row in zip(TIME, plain, strict=True)]),
        "epoch_spoilt": table([[f"{1.75e18 + 1e9 * t:.10E}", *row[1:]] for t, row in zip(TIME, plain, strict=True)]),
        "thousands": table([[f"{1e6 * t:,.1f}", *row[1:]] for t, row in zip(TIME, plain, strict=True)], delimiter=";"),
        "apostrophes": table([[f"{1e6 * t:,.1f}".replace(",", "'"), *row[1:]] for t, row in zip(TIME, plain, strict=True)],
                        delimiter=";", decimal=","),
        "no_head": table(plain, None),
        "units_row": table([UNITS, *plain]),
        "units_in_names": table(plain, [f"{name} [{unit}]" for name, unit in zip(NAMES, UNITS, strict=True)]),
        "text_column": table([[*row, "ok"] for row in plain], [*NAMES, "status"]),
        "trailing": table(plain, end=","),
        "blanks": table(plain, delimiter=" "),
        "coarse": table([[f"{float(row[0]):.2f}", *row[1:]] for row in plain]),
        "swapped": table([*plain[:20], plain[21], plain[20], *plain[22:]]),
        "restarts": table([[f"{(59.9 + t) % 60:.3f}", *row[1:]] for t, row in zip(TIME, plain, strict=True)]),
        "told_rate": table(
            [[i, 40 * i, *row[1:]] for i, row in enumerate(plain)], ["PacketCounter", "SampleTimeFine", *NAMES[1:]],
            delimiter="\t", above="// General information:\n// Update Rate: 250.0Hz\n",
        ),
    }  # fmt: skip


LAYOUTS = list(layouts(np.zeros((N, 12))))


def run_of(path):
    """Times from the first wrench sample [s] and values of a run's two topics."""
    run = runs.read(path)
    zero = run.wrench.stamp[0]
    return (
        (run.wrench.stamp - zero) * 1e-9, np.hstack([run.wrench.force, run.wrench.moment]),
        (run.imu.stamp - zero) * 1e-9, np.hstack([run.imu.angular_velocity, run.imu.linear_acceleration]),
    )  # fmt: skip


def proposed(tmp_path, *paths):
    """Import by the map that is proposed."""
    out, names = tmp_path / "run.mcap", list(map(str, paths))
    assert main(["import", *names, "-o", str(out)]) == 1
    assert not out.exists()
    assert main(["import", *names, "--map", str(tmp_path / "run.map.toml"), "-o", str(out)]) == 0
    return out


@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_proposed_map_leads_to_the_run(tmp_path, values, layout):
    path = tmp_path / "t.csv"
    path.write_bytes(layouts(values)[layout])
    t_wrench, wrench, t_imu, imu = run_of(proposed(tmp_path, path))
    np.testing.assert_allclose(t_wrench, TIME, atol=1e-9)
    np.testing.assert_allclose(t_imu, TIME, atol=1e-9)
    np.testing.assert_allclose(wrench, values[:, :6], rtol=1e-12)
    np.testing.assert_allclose(imu, values[:, 6:], rtol=1e-12)


def test_missing_cells_leave_out_their_sensor_alone(tmp_path, values, capsys):
    rows = [[f"{t:.6f}", *row] for t, row in zip(TIME, values, strict=True)]
    rows[30][3], rows[40][8] = "", "NaN"
    (tmp_path / "t.csv").write_bytes(table(rows))
    t_wrench, wrench, t_imu, _ = run_of(proposed(tmp_path, tmp_path / "t.csv"))
    np.testing.assert_allclose(t_wrench, np.delete(TIME, 30), atol=1e-9)
    np.testing.assert_allclose(t_imu, np.delete(TIME, 40), atol=1e-9)
    np.testing.assert_allclose(wrench, np.delete(values[:, :6], 30, axis=0))
    assert "1 row of t.csv without force or moment left out" in capsys.readouterr().out


SHUFFLED = [*NAMES[:1], *NAMES[7:], *NAMES[1:7]]


@pytest.mark.parametrize(
    ("first", "left_out"),
    [(b"0.000000,20.12", 1), (b"12,9.9,0.1\n0.000000,20.1,0.2", 1), (b"0.0;20.1;0.3;0.4", 1), (b"Acquisition starts", 1), (b"", 0)],
    ids=["end cut", "two", "other mark", "words", "blank"],
)  # fmt: skip
def test_names_above_broken_rows_count(tmp_path, values, first, left_out):
    """In another order than the usual one, so that a guess by the order would be wrong."""
    rows = [[f"{t:.6f}", *row[6:], *row[:6]] for t, row in zip(TIME, values, strict=True)]
    head, *lines = table(rows, SHUFFLED).splitlines()
    (tmp_path / "t.csv").write_bytes(b"\n".join([head, first, *lines[left_out:]]))
    _, wrench, _, imu = run_of(proposed(tmp_path, tmp_path / "t.csv"))
    np.testing.assert_allclose(wrench, values[left_out:, :6], rtol=1e-12)
    np.testing.assert_allclose(imu, values[left_out:, 6:], rtol=1e-12)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda lines: [lines[0].rsplit(b",", 1)[0], *lines[1:]], "line 1 of t.csv has 12 names for 13 columns"),
        (lambda lines: [lines[0], lines[1] + b",7", *lines[2:]], "more cells than others (line 2): correct the table"),
    ],
    ids=["a name less", "a cell more"],
)
def test_a_head_or_first_row_of_another_width_is_one_line(tmp_path, values, capsys, change, words):
    lines = layouts(values)["plain"].splitlines()
    (tmp_path / "t.csv").write_bytes(b"\n".join(change(lines)))
    assert main(["import", str(tmp_path / "t.csv"), "-o", str(tmp_path / "run.mcap")]) == 2
    assert words in capsys.readouterr().err


def test_a_number_beyond_any_sensor_is_one_line(tmp_path, values, capsys):
    values[5, 7] = 1e200
    (tmp_path / "t.csv").write_bytes(layouts(values)["plain"])
    assert main(["import", str(tmp_path / "t.csv"), "-o", str(tmp_path / "run.mcap")]) == 2
    assert "angular_velocity in t.csv is 1.0e+200 at sample 5: no sensor reads so much" in capsys.readouterr().err


def test_one_step_of_coarse_times_tells_no_rate(tmp_path, values, capsys):
    for restart in (0.0, 0.1):  # the clock then starts again while its steps are too coarse to tell a rate
        rows = [
            [f"{np.floor(5 * t + 0.4) * (t >= restart) + 9 * (t < restart):.0f}", *row]
            for t, row in zip(TIME, values, strict=True)
        ]
        (tmp_path / "t.csv").write_bytes(table(rows, above="Rate of channel x: 0\n"))
        main(["import", str(tmp_path / "t.csv"), "-o", str(tmp_path / "run.mcap")])
        assert 'rate = "? Hz"' in (tmp_path / "run.map.toml").read_text()
        (tmp_path / "run.map.toml").unlink()
    capsys.readouterr()


def test_samples_that_coarse_times_lack_are_not_overlooked(tmp_path, values, capsys):
    rows = [[f"{t:.2f}", *row] for t, row in zip(TIME, values, strict=True)]
    (tmp_path / "t.csv").write_bytes(table(rows))
    proposed(tmp_path, tmp_path / "t.csv")
    (tmp_path / "t.csv").write_bytes(table(rows[:20] + rows[30:]))
    again = ["--map", str(tmp_path / "run.map.toml"), "-o", str(tmp_path / "again.mcap")]
    assert main(["import", str(tmp_path / "t.csv"), *again]) == 2
    assert "from 250 Hz: correct rate" in capsys.readouterr().err


def test_counts_and_an_imu_of_another_logger_are_joined_by_time(tmp_path, values):
    counts = [[round(1e6 * x) for x in row[:6]] for row in values]
    above = "RDT Sample Rate: 250\nForce Units: N, Counts per Unit Force: 1e6\nTorque Units: Nm, Counts per Unit Torque: 1e6\n"
    stamps = [f"06/01/2025 02:03:{7 + t:09.6f} PM" for t in TIME]
    head = ["Status (hex)", "RDT Sequence", *NAMES[1:7], "Time"]
    rows = [["0x0", i, *row, stamp] for i, (row, stamp) in enumerate(zip(counts, stamps, strict=True))]
    (tmp_path / "ft.csv").write_bytes(table(rows, head, above=above))
    imu = np.hstack([np.degrees(values[:, 6:9]), values[:, 9:] / 9.80665])
    head = ["stamp", *(f"gyro_{a} [deg/s]" for a in "xyz"), *(f"acc_{a} (g)" for a in "xyz")]
    rows = [[date, *row] for date, row in zip(DATES, imu, strict=True)][5:]
    (tmp_path / "imu.csv").write_bytes(table(rows, head, delimiter=";", decimal=","))
    t_wrench, wrench, t_imu, motion = run_of(proposed(tmp_path, tmp_path / "ft.csv", tmp_path / "imu.csv"))
    np.testing.assert_allclose(t_wrench, TIME, atol=1e-9)
    np.testing.assert_allclose(t_imu, TIME[5:], atol=1e-9)
    np.testing.assert_allclose(wrench, values[:, :6], atol=1e-6)
    np.testing.assert_allclose(motion, values[5:, 6:], rtol=1e-9)


def test_tables_of_two_clocks_are_refused_with_both_ranges(tmp_path, values, capsys):
    for name, zero, columns in (("ft.csv", 1.75e9, slice(0, 6)), ("imu.csv", 0.0, slice(6, 12))):
        rows = [[f"{zero + t:.6f}", *row[columns]] for t, row in zip(TIME, values, strict=True)]
        (tmp_path / name).write_bytes(table(rows, ["time", *NAMES[1:][columns]]))
    command = ["import", str(tmp_path / "ft.csv"), str(tmp_path / "imu.csv"), "-o", str(tmp_path / "run.mcap")]
    assert main(command) == 1
    mapping = tmp_path / "run.map.toml"
    assert main([*command, "--map", str(mapping)]) == 2
    assert (
        "from 2025-06-15T15:06:40.000 to 2025-06-15T15:06:40.236, imu.csv goes from 0.000 s to"
        in capsys.readouterr().err
    )
    mapping.write_text(mapping.read_text().replace("[second]", '[second]\ntime_offset = "1750000000 s"'))
    assert main([*command, "--map", str(mapping)]) == 0
    np.testing.assert_allclose(run_of(tmp_path / "run.mcap")[2], TIME, atol=1e-6)


@pytest.mark.parametrize(
    ("columns", "key"),
    [
        (["q_w", "q_x", "q_y", "q_z"], "orientation"),
        (["/joint_states/a/position", "/joint_states/b/position"], "position"),
    ],
)
def test_a_quaternion_or_joints_tell_the_motion(tmp_path, values, columns, key):
    motion = np.round(np.random.default_rng(1).normal(size=(N, len(columns))), 6)
    rows = [[f"{t:.6f}", *row, *more] for t, row, more in zip(TIME, values[:, :6], motion, strict=True)]
    (tmp_path / "t.csv").write_bytes(table(rows, [*NAMES[:7], *columns]))
    got = runs.read_any(proposed(tmp_path, tmp_path / "t.csv")).motion
    expected = motion[:, [1, 2, 3, 0]] if key == "orientation" else motion
    np.testing.assert_allclose(getattr(got, key), expected, rtol=1e-12)
    assert got.names == ("a", "b")[: 2 * (key == "position")]


def test_columns_without_names_follow_the_words_above_them(tmp_path, values):
    """Gravity is removed from the acceleration, which is then no specific force."""
    unit = np.random.default_rng(1).normal(size=(N, 4))
    unit = np.round(unit / np.linalg.norm(unit, axis=1, keepdims=True), 6)
    rows = np.hstack([values[:, 9:], unit, values[:, 6:9], values[:, :6]]).tolist()
    above = "accelerometer, gravity removed   orientation as quaternion   gyroscope   force/torque sensor\n"
    (tmp_path / "t.txt").write_bytes(table(rows, None, delimiter=" ", above=above))
    assert main(["import", str(tmp_path / "t.txt"), "-o", str(tmp_path / "run.mcap")]) == 1
    mapping = tmp_path / "run.map.toml"
    mapping.write_text(mapping.read_text().replace("? Hz", f"{RATE} Hz"))
    command = ["import", str(tmp_path / "t.txt"), "--map", str(mapping), "-o", str(tmp_path / "run.mcap")]
    assert main(command) == 0
    t, wrench, _, motion = run_of(tmp_path / "run.mcap")
    np.testing.assert_allclose(t, TIME, atol=1e-9)
    np.testing.assert_allclose(wrench, values[:, :6])
    np.testing.assert_allclose(motion, np.hstack([values[:, 6:9], np.zeros((N, 3))]))
    np.testing.assert_allclose(runs.read(tmp_path / "run.mcap").imu.orientation, unit)


def test_joints_without_names_are_told_by_their_rates(tmp_path, values):
    phase = np.multiply.outer(TIME, [3.0, 5.0, 7.0, 11.0])
    joints = np.column_stack([TIME, np.sin(phase), np.cos(phase) * [3.0, 5.0, 7.0, 11.0], values[:, :9]])
    (tmp_path / "q.csv").write_bytes(table(np.round(joints, 6).tolist(), None))
    rows = [[f"{t:.6f}", *row[:6]] for t, row in zip(TIME, values, strict=True)]
    (tmp_path / "ft.csv").write_bytes(table(rows, NAMES[:7]))
    motion = runs.read_any(proposed(tmp_path, tmp_path / "ft.csv", tmp_path / "q.csv")).motion
    np.testing.assert_allclose(motion.position, np.round(np.sin(phase), 6))
    assert motion.names == ("joint_1", "joint_2", "joint_3", "joint_4")


@pytest.mark.parametrize(
    ("head", "unit", "words"),
    [
        ([*NAMES[:7], "x", "y", "z"], "N", "no columns of motion among those of t.csv"),
        (["time", "Fx [lbf]", "Fy [lbf]", "Fz [lbf]", *NAMES[4:10]], "N", "t.csv states force in lbf, recording.force_unit says N"),
    ],
)  # fmt: skip
def test_what_contradicts_or_lacks_is_one_line(tmp_path, values, capsys, head, unit, words):
    rows = [[f"{t:.6f}", *row[:9]] for t, row in zip(TIME, values, strict=True)]
    (tmp_path / "t.csv").write_bytes(table(rows, head))
    command = ["import", str(tmp_path / "t.csv"), "-o", str(tmp_path / "run.mcap")]
    if main(command) == 1:
        mapping = tmp_path / "run.map.toml"
        mapping.write_text(mapping.read_text().replace('force_unit = "lbf"', f'force_unit = "{unit}"'))
        assert main([*command, "--map", str(mapping)]) == 2
    error = capsys.readouterr().err
    assert words in error
    assert error.count("\n") == 1


@pytest.mark.parametrize("first", ["t.csv", "junk.csv"])
def test_a_table_that_tells_nothing_is_named(tmp_path, values, capsys, first):
    (tmp_path / "t.csv").write_bytes(layouts(values)["plain"])
    (tmp_path / "junk.csv").write_text("a,b\n1,2\n3,4\n5,6\n")
    names = [str(tmp_path / name) for name in (first, "junk.csv" if first == "t.csv" else "t.csv")]
    assert main(["import", *names, "-o", str(tmp_path / "run.mcap")]) == 2
    assert "no column of junk.csv is needed" in capsys.readouterr().err


def test_a_table_without_a_whole_row_of_numbers_is_one_line(tmp_path, capsys):
    (tmp_path / "t.csv").write_text("1,a\nb,2\n" * 30)
    assert main(["import", str(tmp_path / "t.csv"), "-o", str(tmp_path / "run.mcap")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "no columns of force and moment among those of t.csv: give the load cell's table" in line
    assert len(line) < 200


@pytest.mark.parametrize("name", ["run.csv", "run.npz", "run.xlsx", "run.mat"])
def test_a_table_in_place_of_a_recording_is_told_the_command(tmp_path, capsys, name):
    (tmp_path / name).write_bytes(b"PK\x03\x04")
    assert main(["inspect", str(tmp_path / name)]) == 2
    assert "`inertia import" in capsys.readouterr().err


def test_the_files_of_a_run_are_named_in_it_and_it_is_no_table(tmp_path, values, capsys):
    (tmp_path / "t.csv").write_bytes(layouts(values)["plain"])
    run = proposed(tmp_path, tmp_path / "t.csv")
    assert json.loads(runs.read(run).metadata["rig.run"]["imported"])["file"] == "t.csv"
    assert main(["import", str(run), "-o", str(tmp_path / "again.mcap")]) == 2
    assert f"no table {run} but a recording: give it to `inertia inspect`" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("name", "start", "way_on"),
    [
        ("x.tdms", b"TDSm\x0e\0\0\0", "npTDMS"), ("x.mf4", b"MDF     4.10", "asammdf"), ("x.dxd", b"DEWESOFT", "DEWESoft"),
        ("x.mat", b"MATLAB 5.0 MAT-file", "columns of a CSV"), ("x.parquet", b"PAR1", "pandas"), ("x.ulg", b"ULog\1", "ulog2csv"),
        ("x.xlsx", b"PK\3\4", "save its sheet as CSV"), ("t.csv.gz", b"\x1f\x8b\x08", "unpack it first"),
    ],
)  # fmt: skip
def test_a_file_of_another_program_is_the_same_line_from_every_command(tmp_path, capsys, name, start, way_on):
    (tmp_path / "e.toml").write_text('[recording]\nmethod = "joint"\n')
    (tmp_path / name).write_bytes(start + bytes(200))
    lines = set()
    for command, *more in (
        ("import", "-o", "r.mcap"),
        ("inspect",),
        ("identify", "--experiment", str(tmp_path / "e.toml")),
    ):
        assert main([command, str(tmp_path / name), *more]) == 2
        lines.add(capsys.readouterr().err)
    (line,) = lines
    assert line.startswith(f"error: neither recording nor table {tmp_path / name} but")
    assert way_on in line
