"""Static poses from files: alignment, the pose that creeps, results read back, a scale beside a table."""

import dataclasses
import json

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from identify.estimation.static_poses.centre import centre
from identify.estimation.static_poses.pose_fit import Attitudes
from tests.helpers.bags import STORE, header, wrench, write_rosbag2
from tests.helpers.commands import refused
from tests.helpers.pose_lab import R_CG, TRUTH, directions, series, wrench_of
from uq.cli.main import main
from uq.experiment.experiment import Experiment
from uq.runs.identification.centre_prior import load_centre
from uq.runs.identification.static_centre import centre_file


def test_the_attitudes_alignment_comes_on_top(generator):
    """A common turn leaves no residual of its own where the noise is large; declared, it widens centre and offsets."""
    f = directions(generator, 12, 0.35)
    force, moment = wrench_of(f)
    force, moment = force + 0.2 * generator.normal(size=f.shape), moment + 0.005 * generator.normal(size=f.shape)
    axes = np.cross(np.broadcast_to(0.02 * np.eye(3), (12, 3, 3)), f[:, None], axis=2).transpose(0, 2, 1)
    plain, declared = centre(force, moment, f), centre(force, moment, f, attitudes=Attitudes(common=axes, lasting=3))
    assert (declared.values == plain.values).all()
    assert (declared.standard_uncertainty[1:4] > plain.standard_uncertainty[1:4]).all()
    extra = declared.covariance - plain.covariance
    np.testing.assert_allclose(extra, declared.lasting @ declared.lasting.T, rtol=1e-6, atol=1e-12)
    moved = [centre(force, moment, f + h * axes[:, :, 0]).values for h in (1e-4, -1e-4)]
    np.testing.assert_allclose((moved[0] - moved[1]) / 2e-4, -declared.lasting[:, 0], rtol=0.2, atol=2e-3)


def recorded(path, generator, *, creep=(), poses=8, quaternions=True):
    """A run of the platform's pose (100 Hz) and the wrench (200 Hz): poses of three seconds, a second between."""
    aims = Rotation.from_euler("xyz", generator.uniform(-0.5, 0.5, (poses, 3)))
    attitudes, creeping_by = [], []
    for k in range(poses):
        step = (aims[k].inv() * aims[(k + 1) % poses]).as_rotvec()
        part = np.linspace(0, 1, 200, endpoint=False)
        smooth = part - np.sin(2 * np.pi * part) / (2 * np.pi)
        attitudes += [
            np.tile(aims[k].as_quat(), (600, 1)),
            (aims[k] * Rotation.from_rotvec(np.outer(smooth, step))).as_quat(),
        ]
        creeping_by += [0.8 * (1 - np.exp(-np.arange(600) / 200)) * (k in creep), np.zeros(200)]
    quaternion, creeps = np.vstack(attitudes), np.concatenate(creeping_by)
    f = 9.81 * Rotation.from_quat(quaternion).as_matrix()[:, 2]
    force, moment = wrench_of(f)
    force = force + 0.1 * generator.normal(size=f.shape) + creeps[:, None] * [0, 0, 1.0]
    moment = moment + 0.002 * generator.normal(size=f.shape)
    types, items = STORE.types, []
    for k in range(len(f)):
        time = 10**9 + k * 5_000_000
        name = "geometry_msgs/msg/WrenchStamped"
        items.append(
            (time, "/wrench", name, types[name](header(STORE, time, "body"), wrench(STORE, force[k], moment[k])))
        )
        if k % 2 == 0 and quaternions:
            name = "geometry_msgs/msg/PoseStamped"
            point = types["geometry_msgs/msg/Point"](0.0, 0.0, 0.0)
            pose = types["geometry_msgs/msg/Pose"](point, types["geometry_msgs/msg/Quaternion"](*quaternion[k]))
            items.append((time, "/pose", name, types[name](header(STORE, time, "world"), pose)))
    write_rosbag2(path, items)
    return path


@pytest.fixture(scope="module")
def declared():
    return Experiment.from_dict({
        "platform": {"gravity": "9.81 m/s^2"},
        "poses": {"sigma_attitude": "0.01 deg", "sigma_alignment": "0.02 deg"},
    })  # fmt: skip


def test_the_platforms_pose_tells_the_attitude_and_the_pose_that_creeps_is_left_out(tmp_path, generator, declared):
    result = centre_file(recorded(tmp_path / "run", generator, creep=(3,)), declared)
    assert result.poses == 7
    assert (np.abs(result.values - TRUTH) < 4 * result.standard_uncertainty + 1e-9).all()
    np.testing.assert_allclose(result.r_cg, R_CG, atol=5e-4)
    assert "pose 4 (12.4 to 14" in result.warnings[0]
    assert "left out: within it the force changes by" in result.warnings[0]
    assert "the z axis of the frame to which the attitudes refer points up" in result.assumptions


def test_a_centre_is_read_back_as_it_was(tmp_path, generator):
    found = series(generator, tilt=0.35, alignment=1e-3)
    result = dataclasses.replace(found, provenance={"inputs": [{"file": "p.csv"}]})
    (tmp_path / "centre.json").write_text(json.dumps(result.to_dict()))
    back = load_centre(tmp_path / "centre.json")
    for name in ("values", "covariance", "residuals", "interval95", "lasting"):
        np.testing.assert_array_equal(getattr(back, name), getattr(result, name))
    assert back.provenance == result.provenance


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('[poses]\nsigma_attitude = "-1 deg"', "poses.sigma_attitude is '-1 deg': write zero or more"),
        ('[poses]\nsigma_alignment = "1 mm"', "poses.sigma_alignment"),
        ("[poses]\nsigma_accelerometer = 0.1", "poses.sigma_accelerometer is 0.1: write a value with its unit"),
        ('[poses]\n[scale]\nmass = "1 kg"', "missing key scale.standard_uncertainty"),
        ('[poses]\n[scale]\nmass = "0 kg"\nstandard_uncertainty = "1 g"', "scale.mass is '0 kg'"),
        ('[poses]\n[scale]\nmass = "1 m"\nstandard_uncertainty = "1 g"', "scale.mass"),
        ('[poses]\n[scale]\nmass = "1 kg"\nstandard_uncertainty = "1 g"\nk = 2', "unknown key scale.k"),
        ('[poses]\n[body]\nmass = "2 kg"\n[scale]\nmass = "1 kg"\nstandard_uncertainty = "1 g"', "keep the right one"),
        ('[poses]\n[datum]\nposition = ["1 mm"]', "datum.position"),
        ('[poses]\n[datum]\nrotation_to_body = "x, z, y"', "datum.rotation_to_body is left-handed"),
        (
            '[poses]\n[datum]\nsigma_rotation = ["-1 deg", "0 deg", "0 deg"]',
            "datum.sigma_rotation[0] is '-1 deg': write zero or more",
        ),
        ('[poses]\n[fixture]\nmass = "1 kg"', "missing key fixture.r_cg_from_q"),
        (
            '[poses]\n[fixture]\nmass = "1 kg"\nr_cg_from_q = ["0 m", "0 m", "0 m"]\nsigma_mass = "-1 g"',
            "fixture.sigma_mass is '-1 g': write zero or more",
        ),
        (
            '[poses]\n[fixture]\nmass = "1 kg"\nr_cg_from_q = ["0 m", "0 m", "0 m"]\n'
            'inertia = { I11 = "1 kg*m^2", I22 = "1 kg*m^2", I33 = "9 kg*m^2" }',
            "fixture.inertia is no body's tensor",
        ),
    ],
)
def test_declarations_that_cannot_be_used(tmp_path, capsys, text, words):
    (tmp_path / "e.toml").write_text(text)
    (tmp_path / "p.csv").write_text("a\n1\n")
    assert words in refused(capsys, "centre", tmp_path / "p.csv", "--experiment", tmp_path / "e.toml")


def test_a_scale_beside_a_table_of_poses(tmp_path, generator, capsys):
    f = directions(generator, 10, None)
    force, moment = wrench_of(f)
    force = force + 0.05 * generator.normal(size=f.shape)
    moment = moment + 0.001 * generator.normal(size=f.shape)
    rows = np.hstack([force, moment, -f])
    head = "fx,fy,fz,mx,my,mz,gx,gy,gz"
    np.savetxt(tmp_path / "p.csv", rows, delimiter=",", header=head, comments="")
    (tmp_path / "e.toml").write_text(
        '[platform]\ngravity = "9.81 m/s^2"\n[scale]\nmass = "3.7 kg"\nstandard_uncertainty = "1 g"\n[poses]\n'
        'force = ["fx", "fy", "fz"]\nmoment = ["mx", "my", "mz"]\ngravity = ["gx", "gy", "gz"]\n'
    )
    out = tmp_path / "out"
    command = ["centre", tmp_path / "p.csv", "--experiment", tmp_path / "e.toml", "--out", out]
    assert main([str(word) for word in command]) == 0
    output = capsys.readouterr().out
    assert "load cell's mass over the scale's" in output
    assert "the gain agrees" in output
    content = json.loads((out / "centre.json").read_text())
    assert content["gain"]["within"] is True
    assert content["mass"]["standard_uncertainty"] < 1e-3
