"""The arm of uq/examples: its chain against MuJoCo, its distances against cone programmes, and refusals in one line."""

import copy
import re
from pathlib import Path
from types import ModuleType
from xml.etree import ElementTree

import clarabel
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import sparse

from identify.motion.serial_arm.joint_series import JointStates
from identify.motion.serial_arm.serial_chain import poses
from rig.exceptions import RigError
from uq.experiment.experiment import Experiment
from uq.files.mistakes import ExperimentError
from uq.plan.motion_design.arm.arm import Arm
from uq.plan.motion_design.arm.arm_limits import PIECE, ArmLimits
from uq.plan.motion_design.arm.clearance import Clearance
from uq.plan.motion_design.arm.collision_meshes import with_mesh_files
from uq.plan.motion_design.arm.mujoco_model import loaded_model
from uq.plan.motion_design.arm.predicted_payload import declared_noise
from uq.plan.motion_design.search import in_pieces

mujoco = pytest.importorskip("mujoco")

EXPERIMENTS = Path(__file__).parents[5] / "uq" / "examples"


@pytest.fixture(scope="module")
def experiment():
    return Experiment.load(EXPERIMENTS / "arm.toml")


@pytest.fixture(scope="module")
def arm(experiment):
    return Arm.of(experiment)


@pytest.mark.slow
def test_wrench_and_efforts_are_mujocos(experiment, arm, generator):
    """MuJoCo reads the URDF itself; its sensors at Q and its inverse dynamics know nothing of ours."""
    rated = {"bandwidth": "3 Hz", "cell_force": ["100 N"] * 3, "cell_moment": ["100 N*m"] * 3}
    limits = limits_of(Experiment.from_dict(changed(experiment.document, platform={"limits": rated}), EXPERIMENTS))
    model = loaded_model(arm, experiment.body, experiment.gravity)
    model.opt.disableflags = mujoco.mjtDisableBit.mjDSBL_CONTACT
    data = mujoco.MjData(model)
    states = generator.normal(size=(3, 20, 6))
    shares, _ = in_pieces(limits.compiled, JointStates(*states), PIECE)
    for k in range(20):
        data.qpos[:], data.qvel[:], data.qacc[:] = states[:, k]
        mujoco.mj_inverse(model, data)
        np.testing.assert_allclose(arm.effort * shares["effort"][k], np.abs(data.qfrc_inverse), atol=1e-8)
        np.testing.assert_allclose(100 * shares["cell_force"][k], np.abs(data.sensordata[:3]), atol=1e-8)
        np.testing.assert_allclose(100 * shares["cell_moment"][k], np.abs(data.sensordata[3:]), atol=1e-8)


def within(shape, turn, place):
    """Rows ``G x + h`` of a cone programme whose cones say that a point x is in a shape: a cylinder, or a box."""
    axes = (turn @ shape.rotation).T
    offset = -axes @ (place + turn @ shape.position)
    if shape.is_round:
        rows = np.stack([np.zeros(3), axes[0], axes[1], np.zeros(3), axes[2]])
        limits = np.array([shape.half[0], offset[0], offset[1], shape.half[2], offset[2]])
        return rows, limits, [clarabel.SecondOrderConeT(3), clarabel.SecondOrderConeT(2)]
    rows = np.stack([row for axis in axes for row in (np.zeros(3), axis)])
    return rows, np.stack([shape.half, offset], axis=1).ravel(), [clarabel.SecondOrderConeT(2)] * 3


def nearest_points(first, second):
    """The distance of two shapes in their poses, zero where they overlap, as a second-order cone programme."""
    (f_rows, f_limits, f_cones), (s_rows, s_limits, s_cones) = within(*first), within(*second)
    rows = np.block([
        [np.zeros((1, 6)), np.ones((1, 1))], [np.eye(3), -np.eye(3), np.zeros((3, 1))],
        [f_rows, np.zeros((len(f_rows), 4))], [np.zeros((len(s_rows), 3)), s_rows, np.zeros((len(s_rows), 1))],
    ])  # fmt: skip
    settings = clarabel.DefaultSettings()
    settings.verbose = False
    cones = [clarabel.SecondOrderConeT(4), *f_cones, *s_cones]
    limits = np.concatenate([np.zeros(4), f_limits, s_limits])
    problem = sparse.csc_matrix((7, 7)), np.eye(7)[6], sparse.csc_matrix(-rows), limits, cones, settings
    return clarabel.DefaultSolver(*problem).solve().obj_val


@pytest.mark.parametrize("shape", ['<box size="0.1 0.11 0.45"/>', pytest.param("", marks=pytest.mark.slow)])
def test_the_distances_are_those_of_cone_programmes(experiment, tmp_path, shape, generator):
    """MuJoCo's stop within some micrometres."""
    text = (EXPERIMENTS / "arm.urdf").read_text()
    (tmp_path / "arm.urdf").write_text(
        text.replace('<cylinder radius="0.055" length="0.45"/>', shape) if shape else text
    )
    clearance = Clearance.of(Arm.of(Experiment.from_dict(experiment.document, tmp_path)))
    assert {item.is_round for item in clearance.shapes} == {True, not shape}
    for q in generator.uniform(-2.5, 2.5, size=(4, 6)):
        frames = jax.jit(poses)(clearance.arm.chain, q)
        turns, places = (
            np.concatenate([np.eye(3)[None], frames.rotation]),
            np.concatenate([np.zeros((1, 3)), frames.position]),
        )
        placed = [(item, turns[item.link], places[item.link]) for item in clearance.shapes]
        for (a, b), distance in zip(clearance.checked, clearance.distances(q), strict=True):
            if b == len(placed):
                item, turn, place = placed[a]
                expected = place[2] + turn[2] @ item.position - float(item.lowest(jnp.asarray(turn[2] @ item.rotation)))
                assert distance == pytest.approx(expected, abs=5e-6)
            else:
                assert max(distance, 0.0) == pytest.approx(nearest_points(placed[a], placed[b]), abs=5e-6)


def test_the_gaps_are_close_bounds_of_the_distances(arm, generator):
    clearance = Clearance.of(arm)
    positions = generator.uniform(-2.5, 2.5, size=(60, 6))
    bounds = np.asarray(jax.jit(jax.vmap(clearance.gaps))(jnp.asarray(positions)))
    distances = np.array([[*clearance.distances(q)] for q in positions])
    assert distances.shape == bounds.shape
    apart, near = distances > 0, (distances > 0) & (distances < 0.15)
    assert (bounds - distances)[apart].max() < 5e-6
    assert np.mean((distances - bounds)[near]) < 0.004  # a fifth of the clearance


def changed(document, **tables):
    """The document with tables merged into it; ``joint`` replaces."""
    document = copy.deepcopy(dict(document))
    for name, table in tables.items():
        document[name] = {**document[name], **table} if isinstance(table, dict) else table
    return document


def limits_of(experiment):
    arm = Arm.of(experiment)
    return ArmLimits(experiment, arm, Clearance.of(arm))


EVERY = {"acceleration": "500 deg/s^2"}
WRONG = [
    ({"tool": "gripper"}, "unknown frame 'gripper' at platform.tool"),
    ({"urdf": "no.urdf"}, "no file .*no.urdf at platform.urdf"),
    ({"home": ["0 deg"]}, "platform.home has 1 positions: the joints are pan, lift"),
    ({"home": ["0 deg"] * 5 + ["0 mm"]}, r"platform.home\[5\] is in m: write it in rad, since the joint turns"),
    ({"home": ["0 deg", "0 deg", "170 deg", "0 deg", "0 deg", "0 deg"]}, "joint elbow at 2.967 is not within -2.8 … 2.8"),
    ({"home": ["0 deg", "120 deg", "0 deg", "0 deg", "0 deg", "0 deg"]}, "closer to the floor than platform.clearance"),
    ({"joint": []}, "no largest acceleration of joint pan: state acceleration"),
    ({"joint": [EVERY, {"name": "knee"}]}, "platform.joint: unknown joint 'knee'"),
    ({"joint": [{**EVERY, "speed": "1 m/s"}]}, "platform.joint.pan.speed is in m/s: write it in rad/s"),
    ({"joint": [{**EVERY, "effort": "3 N*m"}]}, "effort of elbow at 0.000 s: .* % of its limit, at rest at home"),
    ({"limits": {}}, "missing key platform.limits.bandwidth"),
]  # fmt: skip


@pytest.mark.parametrize(("keys", "message"), WRONG)
def test_a_wrong_arm_is_one_line(experiment, keys, message):
    wrong = Experiment.from_dict(changed(experiment.document, platform=keys), EXPERIMENTS)
    with pytest.raises(ExperimentError, match=message) as caught:
        limits_of(wrong)
    assert "\n" not in str(caught.value)


TABLE = [
    ({"kind": "legs"}, "platform.urdf describes an arm: write kind = \"arm\""),
    ({"r_cg_from_omb": ["0 m", "0 m", "0 m"]}, "platform.r_cg_from_omb is for a platform on six legs"),
    ({"limits": {"speed": "1 m/s"}}, "platform.limits has speed of legs"),
    ({"joint": [{"name": "a"}, {"name": "a"}]}, "platform.joint names 'a' twice"),
    ({"joint": [{"speed": "0 rad/s"}]}, r"platform.joint\[0\].speed is '0 rad/s': write a value above zero"),
    ({"joint": [{"position": ["1 rad", "0 rad"]}]}, "write the lower limit first"),
]  # fmt: skip


@pytest.mark.parametrize(("keys", "message"), TABLE)
def test_wrong_keys_are_refused_when_the_file_is_read(experiment, keys, message):
    with pytest.raises(ExperimentError, match=message):
        Experiment.from_dict(changed(experiment.document, platform=keys), EXPERIMENTS)


def test_an_arm_without_its_urdf(experiment):
    document = changed(experiment.document)
    del document["platform"]["urdf"]
    with pytest.raises(ExperimentError, match=r"missing key platform\.urdf: an arm needs it"):
        Experiment.from_dict(document, EXPERIMENTS)


@pytest.mark.parametrize(
    ("kind", "at", "place"), [("prismatic", "20 mm", [0, 0.1, 0.27]), ("revolute", "90 deg", [-0.1, 0, 0.25])]
)
def test_a_gripper_is_fixed_by_the_experiment(experiment, tmp_path, kind, at, place):
    """MuJoCo has the finger where a table fixes it, and no such joint; what it mimics does not matter."""
    text = (EXPERIMENTS / "arm.urdf").read_text()
    finger = (
        f'<link name="finger"/><joint name="grip" type="{kind}"><parent link="tool"/><child link="finger"/>{{}}'
        '<origin xyz="0 0 0.25"/><axis xyz="{}"/><limit lower="0" upper="1" velocity="1" effort="1"/></joint>'
        '<link name="tip"/><joint name="end" type="fixed"><parent link="finger"/><child link="tip"/>'
        '<origin xyz="0 0.1 0"/></joint></robot>'
    )
    (tmp_path / "arm.urdf").write_text(text.replace("</robot>", finger.format("", "0 0 2")))
    with pytest.raises(ExperimentError, match=r"joint 'grip' of arm.urdf does not move the tool: fix it in place"):
        Arm.of(Experiment.from_dict(experiment.document, tmp_path))
    joints = experiment.document["platform"]["joint"]
    document = changed(experiment.document, platform={"joint": [*joints, {"name": "grip", "fixed": at}]})
    for mimic in ("", '<mimic joint="pan"/>'):
        (tmp_path / "arm.urdf").write_text(text.replace("</robot>", finger.format(mimic, "0 0 2")))
        arm = Arm.of(Experiment.from_dict(document, tmp_path))
        assert arm.names == Arm.of(experiment).names
        spec = mujoco.MjSpec.from_string(ElementTree.tostring(with_mesh_files(arm.declared), "unicode"))
        spec.compiler.fusestatic = False
        model = spec.compile()
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        tool, tip = (data.body(name) for name in ("tool", "tip"))
        np.testing.assert_allclose(tool.xmat.reshape(3, 3).T @ (tip.xpos - tool.xpos), place, atol=1e-12)
        assert loaded_model(arm, experiment.body, experiment.gravity).nv == len(arm.names)
    wrong = [{"fixed": "1 mm" if kind == "revolute" else "1 deg"}, {"name": "thumb"}, {"name": None}]
    messages = ["fixed of 'grip' is in", "arm.urdf has no joint 'thumb'", "fixes a joint without a name"]
    for keys, message in zip(wrong, messages, strict=True):
        table = {key: value for key, value in ({"name": "grip", "fixed": at} | keys).items() if value}
        with pytest.raises(ExperimentError, match=message):
            Arm.of(Experiment.from_dict(changed(document, platform={"joint": [*joints, table]}), tmp_path))
    (tmp_path / "arm.urdf").write_text(text.replace("</robot>", finger.format("", "0 0 0")))
    with pytest.raises(ExperimentError, match="no direction or position in joint 'grip'"):
        Arm.of(Experiment.from_dict(document, tmp_path))


def test_links_that_touch_by_construction_are_left_out(experiment, tmp_path):
    """A ball about the wrist touches links with one link between at home; further ones only a SRDF leaves out."""
    text = (EXPERIMENTS / "arm.urdf").read_text()
    link = '<link name="wrist_1_link">'
    assert link in text
    ball = link + '<collision><geometry><sphere radius="{}"/></geometry></collision>'
    document = changed(experiment.document)
    del document["platform"]["floor"]
    near = Experiment.from_dict(document, tmp_path)
    (tmp_path / "arm.urdf").write_text(text.replace(link, ball.format(0.14)))
    clearance = Clearance.of(Arm.of(near))
    assert ("wrist_1_link", "tool") in clearance.may_touch
    assert not [*clearance.touches(clearance.arm.home[None])]
    assert any("May touch" in text and "wrist_1_link and tool" in text for text in clearance.exceptions())
    (tmp_path / "arm.urdf").write_text(text.replace(link, ball.format(0.9)))
    with pytest.raises(ExperimentError, match=r"than platform\.clearance: choose another home"):
        Clearance.of(Arm.of(near))
    names = re.findall('<link name="(.*?)"', text)
    pairs = "".join(f'<disable_collisions link1="wrist_1_link" link2="{name}" reason="Never"/>' for name in names)
    (tmp_path / "arm.srdf").write_text(f'<robot name="arm">{pairs}</robot>')
    clearance = Clearance.of(Arm.of(near))
    model = loaded_model(clearance.arm, near.body, near.gravity, clearance.may_touch)
    data = mujoco.MjData(model)
    data.qpos[:] = clearance.arm.home
    mujoco.mj_forward(model, data)
    assert data.ncon == 0


def test_links_that_are_near_at_home_keep_half_of_that(experiment):
    document = changed(experiment.document, platform={"clearance": "45 mm"})
    clearance = Clearance.of(Arm.of(Experiment.from_dict(document, EXPERIMENTS)))
    home = dict(zip(clearance.checked, clearance.distances(clearance.arm.home), strict=True))
    assert clearance.margins == pytest.approx({pair: d / 2 for pair, d in home.items() if d < 0.045})
    assert clearance.margins
    assert not clearance.margins.keys() & {*clearance.pairs}
    assert not [*clearance.touches(clearance.arm.home[None])]


def test_a_sensor_without_noise_cannot_be_designed_for(experiment):
    silent = Experiment.from_dict(changed(experiment.document, source=experiment.document["source"][:1]), EXPERIMENTS)
    with pytest.raises(ExperimentError, match="no white noise of every force and moment"):
        declared_noise(silent, 500.0)


def test_the_noise_and_what_it_leaves_out(experiment):
    more = {"name": "scale", "target": "F", "kind": "scale", "sigma": ["0.1 %", "0.1 %", "0.1 %"], "group": "cell"}
    document = changed(experiment.document, source=[*experiment.document["source"], more])
    noise = declared_noise(Experiment.from_dict(document, EXPERIMENTS), 500.0)
    np.testing.assert_allclose(noise.covariance, np.diag([0.01] * 3 + [25e-6] * 3))
    assert noise.left_out == ("scale",)


def test_without_the_extra_its_name_is_told(experiment, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "mujoco", None)
    with pytest.raises(RigError, match=r"arms need MuJoCo: `pip install inertia-uq\[arm\]`"):
        Clearance.of(Arm.of(experiment))


def test_what_is_left_of_mujoco_is_told(experiment, monkeypatch):
    """Its folder alone imports as a package without names."""
    monkeypatch.setitem(__import__("sys").modules, "mujoco", ModuleType("mujoco"))
    with pytest.raises(RigError, match=r"files of MuJoCo are missing.*--force-reinstall --no-deps mujoco-core"):
        Clearance.of(Arm.of(experiment))
