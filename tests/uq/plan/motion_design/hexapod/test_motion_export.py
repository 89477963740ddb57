"""Exported motions: what the files say in each format's own conventions, by other means than the writers'."""

import dataclasses
import json
import struct

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from uq.experiment.experiment import Experiment, ExperimentError
from uq.plan.motion_design import motion_formats
from uq.plan.motion_design.commanded import PlatformCommand
from uq.plan.motion_design.hexapod.motion_export import export_motion
from uq.plan.motion_design.motion_formats import moog_packets, pi_waves, platform_csv

ROLL, PITCH, YAW = 0.11, -0.07, 0.2


def about(axis, angle):
    """The rotation about one axis, written out."""
    c, s = np.cos(angle), np.sin(angle)
    return np.array({
        "x": [[1, 0, 0], [0, c, -s], [0, s, c]], "y": [[c, 0, s], [0, 1, 0], [-s, 0, c]],
        "z": [[c, -s, 0], [s, c, 0], [0, 0, 1]],
    }[axis])  # fmt: skip


@pytest.fixture(scope="module")
def posed():
    """One pose at home and one that is turned and moved, 250 times each."""
    turned = about("z", YAW) @ about("y", PITCH) @ about("x", ROLL)
    position = np.repeat([[0.0, 0.0, 0.0], [0.01, -0.02, 0.03]], 250, axis=0)
    rotation = np.repeat([np.eye(3), turned], 250, axis=0)
    length = np.repeat([np.full(6, 0.6), 0.6 + 0.01 * np.arange(6)], 250, axis=0)
    return PlatformCommand(np.arange(500) / 100, position, rotation, length, lambda *_: length)


@pytest.fixture(scope="module")
def experiment(preset):
    """T1 and T4 of six seconds on a platform."""
    document = dict(preset.document)
    document["platform"] = {**document["platform"], "geometry": "assumed-source-size"}
    short = {"duration": "6 s", "ramp": "0.9 s"}
    document["trajectory"] = {name: {**document["trajectory"][name], **short} for name in ("T1", "T4")}
    return Experiment.from_dict(document)


@pytest.fixture(scope="module")
def exported(experiment):
    return export_motion(experiment, experiment.trajectories["T1"])


def table(content):
    return np.array([line.split(",") for line in content.decode().split()[1:]], float)


def test_the_table_says_the_angles_that_made_the_rotation(posed):
    row = dict(zip(platform_csv.COLUMNS, table(platform_csv.write(posed))[-1], strict=True))
    np.testing.assert_allclose([row["roll_rad"], row["pitch_rad"], row["yaw_rad"]], [ROLL, PITCH, YAW], atol=1e-10)
    half = np.array([ROLL, PITCH, YAW]) / 2
    (cr, cp, cy), (sr, sp, sy) = np.cos(half), np.sin(half)
    w, x = cr * cp * cy + sr * sp * sy, sr * cp * cy - cr * sp * sy
    y, z = cr * sp * cy + sr * cp * sy, cr * cp * sy - sr * sp * cy
    np.testing.assert_allclose([row["q_w"], row["q_x"], row["q_y"], row["q_z"]], [w, x, y, z], atol=1e-10)
    assert (row["t_s"], row["leg6_m"]) == (4.99, 0.65)


def test_waves_are_millimetres_and_degrees_table_by_table(posed):
    lines = pi_waves.write(posed).decode().splitlines()
    assert len(lines) == 6 * 5
    assert lines[0].startswith("WAV 1 X PNT 1 100 ")
    assert all(line.split()[1:6] == ["4", "&", "PNT", "1", "100"] for line in lines[16:20])
    last = [float(line.split()[-1]) for line in lines[4::5]]
    np.testing.assert_allclose(last, [10, -20, 30, *np.degrees([ROLL, PITCH, YAW])], atol=1e-8)


def test_packets_are_big_endian_with_heave_down(posed):
    content = moog_packets.write(posed)
    assert len(content) == 500 * 32
    command, roll, pitch, heave, surge, yaw, lateral, spare = struct.unpack(">I7f", content[-32:])
    assert (command, spare) == (130, 0.0)
    np.testing.assert_allclose([surge, lateral, heave], [0.01, 0.02, -0.03], rtol=1e-6)
    down = np.diag([1, -1, -1])
    in_its_axes = about("z", yaw) @ about("y", pitch) @ about("x", roll)
    np.testing.assert_allclose(down @ in_its_axes @ down, posed.rotation[-1], atol=1e-7)


@pytest.mark.parametrize("form", [platform_csv, pi_waves, moog_packets])
def test_what_is_read_is_what_was_written(posed, form):
    """The packets' instants follow from their number and rate."""
    t, position, rotation, *_ = form.read(form.write(posed))
    np.testing.assert_allclose(t, np.arange(500) / form.RATE, atol=1e-12)
    np.testing.assert_allclose(position, posed.position, atol=1e-8)
    np.testing.assert_allclose(rotation, posed.rotation, atol=1e-7)


def test_a_trajectory_starts_and_ends_at_home(exported, experiment):
    rows = table(exported.contents["motion.csv"])
    np.testing.assert_array_equal(rows[0, 1:7], 0)
    np.testing.assert_allclose(rows[-1, 1:4] - rows[-2, 1:4], 0, atol=2e-10)
    platform = experiment.platform
    turn = Rotation.from_quat(rows[:, [8, 9, 10, 7]])
    ends = (
        np.asarray(platform.home)
        + rows[:, None, 1:4]
        + np.stack([turn.apply(p) for p in np.array(platform.joints)], axis=1)
    )
    lengths = np.linalg.norm(ends - np.asarray(platform.base), axis=2)
    np.testing.assert_allclose(rows[:, 11:], lengths, atol=1e-9)
    assert np.ptp(lengths, axis=0).min() > 1e-3


def test_t1_in_the_table_keeps_its_cg_still(exported, experiment):
    rows = table(exported.contents["motion.csv"])
    cg = rows[:, 1:4] + Rotation.from_quat(rows[:, [8, 9, 10, 7]]).apply(experiment.r_cg_from_omb)
    assert np.abs(cg - cg[0]).max() < 1e-9


def test_the_sidecar_names_every_file_and_its_hash(exported):
    import hashlib

    about = json.loads(exported.contents["motion.json"])
    assert set(about["files"]) == set(exported.contents) - {"motion.json"}
    for name, content in about["files"].items():
        assert content["sha256"] == hashlib.sha256(exported.contents[name]).hexdigest()
        assert content["largest_difference"] < 2e-6
    assert about["files"]["motion.csv"]["columns"] == list(platform_csv.COLUMNS)
    assert "Rz(yaw) Ry(pitch) Rx(roll)" in about["rotation"]


@pytest.mark.slow
def test_half_the_speed_takes_the_same_poses_in_twice_the_time(experiment, exported):
    slow = export_motion(experiment, experiment.trajectories["T1"], speed=0.5, name="rehearsal")
    full, half = table(exported.contents["motion.csv"]), table(slow.contents["rehearsal.csv"])
    assert slow.seconds == pytest.approx(2 * exported.seconds, abs=0.06)
    np.testing.assert_allclose(half[: 2 * len(full) - 1 : 2, 1:], full[:, 1:], atol=1e-8)


def test_a_smaller_amplitude_turns_by_less(experiment):
    whole, smaller = (
        table(export_motion(experiment, experiment.trajectories["T4"], amplitude=a).contents["motion.csv"])
        for a in (1.0, 0.25)
    )
    np.testing.assert_allclose(smaller[:, 4:7], 0.25 * whole[:, 4:7], atol=1e-4)
    assert np.abs(whole[:, 4:7]).max() > 0.04


@pytest.mark.parametrize("form", [platform_csv, pi_waves, moog_packets])
def test_a_file_that_says_something_else_is_not_kept(experiment, monkeypatch, form):
    def wrong(motion):
        return form.write(dataclasses.replace(motion, position=motion.position + 1e-5))

    monkeypatch.setattr(motion_formats, "formats", lambda _: [form.FORMAT._replace(write=wrong)])
    with pytest.raises(RuntimeError, match="from the motion"):
        export_motion(experiment, experiment.trajectories["T1"])


@pytest.mark.parametrize(
    ("given", "message"),
    [({"speed": 0.0}, "a rehearsal at 0 of the speed"), ({"amplitude": 1.5}, "a rehearsal at 1.5 of the amplitude"),
     ({"speed": float("nan")}, "of the speed")],
)  # fmt: skip
def test_bad_parts(experiment, given, message):
    with pytest.raises(ExperimentError, match=message):
        export_motion(experiment, experiment.trajectories["T1"], **given)


def test_a_platform_without_legs(preset):
    with pytest.raises(ExperimentError, match=r"platform\.geometry"):
        export_motion(preset, preset.trajectories["T1"])


def test_both_or_none_are_written(exported, tmp_path):
    exported.write(tmp_path / "out")
    assert {path.name for path in (tmp_path / "out").iterdir()} == set(exported.contents)
