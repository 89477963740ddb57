"""URDF files: the chain is MuJoCo's; what would keep a library busy for long, or end the process, is one line before."""

from pathlib import Path

import mujoco
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from uq.cli.main import main
from uq.experiment.recording_table import RecordingTable
from uq.files.mistakes import ExperimentError
from uq.runs.recorded.joint_kinematics import Chain
from uq.runs.recorded.urdf_model import DEEPEST, LARGEST, MOST_LINKS, MOST_NESTED, urdf_model, urdf_text

EXPERIMENTS = Path(__file__).parents[4] / "uq" / "examples"
LIMITS = '<axis xyz="0 0 1"/><limit lower="-1" upper="1" effort="1" velocity="1"/>'


def joint(k, parent, child):
    ends = f'<parent link="link_{parent}"/><child link="link_{child}"/>'
    return f'<joint name="joint_{k}" type="revolute">{ends}<origin xyz="0 0 0.1"/>{LIMITS}</joint>'


def robot(pairs, count, more=""):
    links = "".join(f'<link name="link_{k}"/>' for k in range(count))
    return f'<robot name="r">{more}{links}{"".join(joint(k, *pair) for k, pair in enumerate(pairs))}</robot>'


def chain(count):
    return robot([(k, k + 1) for k in range(count - 1)], count)


def star(count):
    return robot([(0, k) for k in range(1, count)], count)


ENTITIES = "".join(f'<!ENTITY e{k} "{f"&e{k - 1};" * 10}">' for k in range(1, 10))
BOMB = f'<?xml version="1.0"?><!DOCTYPE robot [<!ENTITY e0 "x">{ENTITIES}]>{robot([], 1, "&e9;")}'
FILE = '<!DOCTYPE robot [<!ENTITY file SYSTEM "file:///etc/passwd">]><robot name="&file;"/>'
BAD = {
    "chain of 500": (chain(500), f"over {DEEPEST} links in a chain in arm.urdf at platform.urdf"),
    "chain of 5,000": (chain(5000), f"5000 links in arm.urdf at platform.urdf: leave {MOST_LINKS} at most"),
    "star of 5,000": (star(5000), "5000 links"),
    "circle": (robot([(0, 1), (1, 2), (2, 0)], 3), "or in a circle"),
    "joints that no link declares": (robot([(k, k + 1) for k in range(5000)], 1), f"over {DEEPEST} links"),
    "ladder": (robot([(k // 2, k // 2 + 1) for k in range(60)], 31), "two joints of .* move link 'link_1'"),
    "entities": (BOMB, "a document type .* in arm.urdf at platform.urdf: remove it"),
    "an entity of a file": (FILE, "a document type"),
    "elements in elements": ("<robot>" + "<a>" * 10**5, f"over {MOST_NESTED} elements inside one another"),
    "elements in a link": (robot([], 1, "<gazebo>" + "<a>" * 200 + "</a>" * 200 + "</gazebo>"), f"over {MOST_NESTED} elem"),
    "not ended": ("<robot>", "no URDF .*arm.urdf at platform.urdf"),
    "nothing": ("", "no URDF .*arm.urdf at platform.urdf"),
    "too large": (" " * (LARGEST + 1), f"has over {LARGEST >> 20} MiB"),
}  # fmt: skip


@pytest.mark.parametrize("name", BAD)
def test_a_urdf_that_is_too_much_is_one_line(name, tmp_path, capsys):
    text, message = BAD[name]
    (tmp_path / "arm.urdf").write_text(text)
    with pytest.raises(ExperimentError, match=message):
        urdf_text(str(tmp_path / "arm.urdf"), "platform.urdf")
    (tmp_path / "arm.toml").write_text((EXPERIMENTS / "arm.toml").read_text())
    assert main(["design", str(tmp_path / "arm.toml")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("error: ")


def test_what_is_no_file_is_not_opened(tmp_path):
    with pytest.raises(ExperimentError, match=r"no file .*gone\.urdf"):
        urdf_text(str(tmp_path / "gone.urdf"), "recording.urdf")
    with pytest.raises(ValueError, match=r"not a file .* but a folder"):
        urdf_text(str(tmp_path), "recording.urdf")


@pytest.mark.parametrize(("text", "joints"), [(chain(DEEPEST), DEEPEST - 1), (star(MOST_LINKS), MOST_LINKS - 1)])
def test_as_much_as_a_limit_is_read(text, joints, tmp_path):
    (tmp_path / "r.urdf").write_text(f'\ufeff\n<?xml version="1.0"?>{text}')
    model = urdf_model(str(tmp_path / "r.urdf"), "recording.urdf")
    assert len(model.joints) == joints


def vector(values):
    return " ".join(map(repr, values.tolist()))


def random_robot(generator, kinds):
    """A chain whose joints are of these kinds, in any pose; a link beside each is fixed to it, with another's mass."""

    def link(name):
        moments = generator.uniform(0.1, 1.0, size=3)
        tensor = dict(zip(("ixx", "iyy", "izz"), map(repr, (moments.sum() - moments).tolist()), strict=True))
        numbers = " ".join(
            f'{key}="{value}"' for key, value in (tensor | {"ixy": 0.02, "ixz": -0.03, "iyz": 0.01}).items()
        )
        return f'<link name="{name}"><inertial>{origin()}<mass value="{generator.uniform(1, 3)}"/><inertia {numbers}/></inertial></link>'

    def origin():
        return f'<origin xyz="{vector(generator.normal(size=3))}" rpy="{vector(2 * generator.normal(size=3))}"/>'

    parts = ['<link name="base"/>']
    for k, kind in enumerate(kinds):
        axis = "" if k == 1 else f'<axis xyz="{vector(generator.normal(size=3))}"/>'  # without: along x
        ends = f'<parent link="{f"link_{k - 1}" if k else "base"}"/><child link="link_{k}"/>'
        limit = '<limit lower="-2" upper="3" effort="4" velocity="5"/>' if kind not in ("continuous", "fixed") else ""
        parts += [link(f"link_{k}"), f'<joint name="joint_{k}" type="{kind}">{ends}{origin()}{axis}{limit}</joint>']
        parts += [link(f"side_{k}"), f'<joint name="beside_{k}" type="fixed"><parent link="link_{k}"/>'
                  f'<child link="side_{k}"/>{origin()}</joint>']  # fmt: skip
    return f'<robot name="r">{"".join(parts)}</robot>'


KINDS = ("revolute", "prismatic", "continuous", "fixed", "revolute", "fixed")


def test_the_chain_is_mujocos(tmp_path, generator):
    """Its poses, masses and what its sensors read at a frame, which is called by its link and by its joint."""
    text = random_robot(generator, KINDS)
    (tmp_path / "r.urdf").write_text(text)
    fused, spec = mujoco.MjSpec.from_string(text).compile(), mujoco.MjSpec.from_string(text)
    spec.compiler.fusestatic = False
    spec.option.gravity = [0.3, -0.2, -9.7]
    spec.body("side_5").add_site(name="Q")
    for kind in (mujoco.mjtSensor.mjSENS_GYRO, mujoco.mjtSensor.mjSENS_ACCELEROMETER):
        spec.add_sensor(type=kind, objtype=mujoco.mjtObj.mjOBJ_SITE, objname="Q")
    plain = spec.compile()
    data = mujoco.MjData(plain)
    model = urdf_model(str(tmp_path / "r.urdf"), "recording.urdf")
    names = ("joint_4", "other", "joint_2", "joint_1", "joint_0")
    order = [names.index(plain.joint(k).name) for k in range(plain.njnt)]
    states = generator.normal(size=(3, 20, len(names)))
    declared = RecordingTable(urdf=str(tmp_path / "r.urdf"), urdf_frame="beside_5")
    chain = Chain.load(declared, names, "joints")
    motion, attitude = chain.motion(*states, spec.option.gravity), chain.attitude(states[0])
    for k in range(20):
        data.qpos[:], data.qvel[:], data.qacc[:] = states[:, k, order]
        mujoco.mj_inverse(plain, data)
        np.testing.assert_allclose(attitude[k], data.body("side_5").xmat.reshape(3, 3), atol=1e-12)
        np.testing.assert_allclose(
            np.concatenate([motion.omega[k], motion.specific_force[k]]), data.sensordata, atol=1e-10
        )
    for link in ("link_0", "link_1", "link_2", "link_4"):
        body, ours = fused.body(link), model.carried_by(link)
        turn = Rotation.from_quat(body.iquat, scalar_first=True).as_matrix()
        np.testing.assert_allclose([ours.mass, *ours.r_cg], [body.mass[0], *body.ipos], atol=1e-12)
        np.testing.assert_allclose(ours.inertia, turn @ np.diag(body.inertia) @ turn.T, atol=1e-10)


def test_limits_as_they_are_written(tmp_path):
    (tmp_path / "r.urdf").write_text(random_robot(np.random.default_rng(0), KINDS))
    joints = {joint.name: joint for joint in urdf_model(str(tmp_path / "r.urdf"), "platform.urdf").joints.values()}
    assert joints["joint_1"][-3:] == ((-2.0, 3.0), 5.0, 4.0)
    assert joints["joint_2"].range == (-np.inf, np.inf)
    assert [name for name, joint in joints.items() if joint.slides] == ["joint_1"]


WRONG = {
    "another element": ("<body/>", "its element is <body>, not <robot>"),
    "no link": ('<robot name="r"/>', "they leave none"),
    "two bases": (robot([(0, 1)], 3), "joints must leave one base, but they leave link_0, link_2"),
    "a link that is not there": (robot([(0, 7)], 2), "joint 'joint_0' is of link 'link_7', which is not there"),
    "a link twice": (robot([(0, 1)], 2, '<link name="link_1"/>'), "two are named link 'link_1'"),
    "a joint twice": (robot([(0, 1), (1, 2)], 3).replace("joint_1", "joint_0"), "two are named joint 'joint_0'"),
    "no name": (robot([(0, 1)], 2).replace('joint name="joint_0"', "joint"), "a joint has no name"),
    "an unknown kind": (robot([(0, 1)], 2).replace("revolute", "screw"), "type='screw' of joint 'joint_0'"),
    "no number": (robot([(0, 1)], 2).replace("0 0 0.1", "0 nan 0"), "xyz='0 nan 0' of joint 'joint_0'"),
    "two numbers": (robot([(0, 1)], 2).replace('upper="1"', 'upper="1 2"'), "upper='1 2' of joint 'joint_0'"),
    "mass": (robot([(0, 1)], 2, '<link name="a"><inertial><mass value="heavy"/></inertial></link>'), "value='heavy' of link 'a'"),
}  # fmt: skip


@pytest.mark.parametrize("name", WRONG)
def test_what_is_wrong_in_a_urdf_is_named_in_one_line(name, tmp_path):
    text, message = WRONG[name]
    (tmp_path / "r.urdf").write_text(text)
    with pytest.raises(ExperimentError, match=r"no URDF .*r\.urdf at platform\.urdf \(.*: correct it") as caught:
        urdf_model(str(tmp_path / "r.urdf"), "platform.urdf")
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)
