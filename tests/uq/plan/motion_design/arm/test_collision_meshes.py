"""A maker's URDF, whose meshes are in a package of ROS: found, or one line before the search."""

import re
import struct
from pathlib import Path

import jax.numpy as jnp
import numpy as np
import pytest

import uq.plan.motion_design.arm.arm_design as arm_design
from uq.cli.main import main
from uq.experiment.experiment import Experiment
from uq.plan.motion_design.arm.arm import Arm
from uq.plan.motion_design.arm.clearance import Clearance
from uq.plan.motion_design.arm.mujoco_model import loaded_model

pytest.importorskip("mujoco")

EXPERIMENTS = Path(__file__).parents[5] / "uq" / "examples"
SHAPE = '<cylinder radius="0.06" length="0.4"/>'
CORNERS = 0.05 * np.array([[1, 1, 1], [1, -1, -1], [-1, 1, -1], [-1, -1, 1]])
FACES = [(0, 1, 2), (0, 3, 1), (0, 2, 3), (1, 3, 2)]
MESH = '<mesh filename="package://maker_description/meshes/link.stl"/>'
SEEN = '<visual><geometry><mesh filename="package://nowhere/seen.dae"/></geometry></visual>'


def stl():
    """A tetrahedron."""
    return bytes(80) + struct.pack("<I", 4) + b"".join(
        struct.pack("<12fH", 0, 0, 0, *CORNERS[list(face)].ravel(), 0) for face in FACES
    )  # fmt: skip


def obj():
    corners = "".join(f"v {x} {y} {z}\n" for x, y, z in CORNERS)
    return (corners + "".join(f"f {a + 1} {b + 1} {c + 1}\n" for a, b, c in FACES)).encode()


CONTENT = {"stl": stl, "obj": obj}


def write(folder, mesh=MESH):
    """The arm of the docs, one shape of it a mesh, as an experiment in a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    text = (EXPERIMENTS / "arm.urdf").read_text()
    at = text.index("<collision>")
    start, end = text.index("<geometry>", at), text.index("</geometry>", at)
    text = f"{text[:at]}{SEEN}{text[at:start]}<geometry>{mesh}{text[end:]}"
    (folder / "arm.urdf").write_text(text)
    (folder / "arm.toml").write_text((EXPERIMENTS / "arm.toml").read_text())
    return folder / "arm.toml"


def put(path, kind="stl"):
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(CONTENT[kind]())


@pytest.fixture(autouse=True)
def no_ros(monkeypatch):
    for name in ("ROS_PACKAGE_PATH", "AMENT_PREFIX_PATH"):
        monkeypatch.delenv(name, raising=False)


PLACES = {
    "the folder that holds the package": ("ROS_PACKAGE_PATH", "ws", "ws/maker_description"),
    "the package itself, and another before": ("ROS_PACKAGE_PATH", "none:ws/maker_description", "ws/maker_description"),
    "an installed workspace": ("AMENT_PREFIX_PATH", "ws", "ws/share/maker_description"),
    "beside the URDF": (None, "", "maker_description/urdf/maker_description"),
    "above the URDF": (None, "", "maker_description"),
}


@pytest.mark.parametrize("place", PLACES)
def test_a_mesh_of_a_package_is_found_as_ros_finds_it(place, tmp_path, monkeypatch):
    variable, value, package = PLACES[place]
    if variable:
        monkeypatch.setenv(variable, ":".join(str(tmp_path / part) for part in value.split(":")))
    put(tmp_path / package / "meshes" / "link.stl")
    experiment = Experiment.load(write(tmp_path / "maker_description" / "urdf"))
    arm = Arm.of(experiment)
    np.testing.assert_allclose(Clearance.of(arm).shapes[0].half, 0.05, rtol=1e-6)
    assert loaded_model(arm, experiment.body, 9.81).nmesh == 1


@pytest.mark.parametrize("kind", CONTENT)
@pytest.mark.parametrize("written", ["link.{}", "file://{folder}/link.{}"])
def test_other_names_and_formats(kind, written, tmp_path):
    name = written.format(kind, folder=tmp_path)
    put(tmp_path / f"link.{kind}", kind)
    experiment = Experiment.load(write(tmp_path, f'<mesh filename="{name}" scale="2 2 2"/>'))
    clearance = Clearance.of(Arm.of(experiment))
    shape = clearance.shapes[0]
    np.testing.assert_allclose(shape.half, 0.1, rtol=1e-6)
    np.testing.assert_allclose(shape.rotation, np.eye(3), atol=1e-7)
    np.testing.assert_allclose(shape.position, [0, 0, 0.04], atol=1e-7)  # of the base's collision
    assert loaded_model(clearance.arm, experiment.body, 9.81).nmesh == 1


@pytest.mark.parametrize("wrong", ['xyz="0 nan 0.04"', 'rpy="0 inf 0"'])
def test_a_shape_that_is_nowhere_is_refused_in_one_line(wrong, tmp_path, capfd, monkeypatch):
    monkeypatch.setattr(arm_design, "random_series", lambda *_: pytest.fail("searched"))
    write(tmp_path, SHAPE)
    text = (tmp_path / "arm.urdf").read_text()
    assert 'xyz="0 0 0.04"' in text
    (tmp_path / "arm.urdf").write_text(text.replace('xyz="0 0 0.04"', wrong, 1))
    assert main(["design", str(tmp_path / "arm.toml")]) == 2
    (line,) = capfd.readouterr().err.splitlines()[-1:]
    number = wrong.partition("=")[2].strip('"')
    assert (
        line == f"error: {wrong[:3]}='{number}' of a collision shape of link 'base' in arm.urdf: write finite numbers"
    )


def test_an_arm_without_shapes_is_said(tmp_path):
    path = write(tmp_path)
    text = (tmp_path / "arm.urdf").read_text()
    (tmp_path / "arm.urdf").write_text(re.sub("<collision>.*?</collision>", "", text, flags=re.DOTALL))
    clearance = Clearance.of(Arm.of(Experiment.load(path)))
    assert [*clearance.exceptions()] == ["No link that moves has a collision shape: nothing is kept apart."]
    assert clearance.gaps(jnp.asarray(clearance.arm.home)).shape == (0,)


FLAT = bytes(80) + struct.pack("<I12fH", 1, 0, 0, 1, 0, 0, 0, 0.05, 0, 0, 0, 0.05, 0, 0)
"""A triangle, which has no volume."""


@pytest.mark.parametrize(
    ("mesh", "content", "message"),
    [(MESH, None, "name the folder that holds maker_description in ROS_PACKAGE_PATH"),
     ('<mesh filename="link.stl"/>', None, "no file of the collision mesh 'link.stl' in arm.urdf: put it there"),
     ('<mesh filename=""/>', None, "no file of the collision mesh '' in arm.urdf"),
     ('<mesh filename="package://"/>', None, "no file of the collision mesh 'package://'"),
     ('<mesh filename="link.stl"/>', b"solid\x00" * 20, "MuJoCo cannot read arm.urdf ("),
     ('<mesh filename="link.stl"/>', FLAT, "MuJoCo cannot read arm.urdf ("),
     ('<mesh filename="link.dae"/>', b"<COLLADA/>", "'link.dae' of arm.urdf is none of .stl, .obj, .msh: convert it")],
)  # fmt: skip
def test_what_cannot_be_read_is_said_before_the_search(mesh, content, message, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(arm_design, "random_series", lambda *_: pytest.fail("searched"))
    if content is not None:
        (tmp_path / f"link.{mesh[-6:-3]}").write_bytes(content)
    assert main(["design", str(write(tmp_path, mesh)), "--out", str(tmp_path / "out")]) == 2
    (line,) = capsys.readouterr().err.splitlines()[-1:]
    assert line.startswith("error: ")
    assert message in line
    assert len(line) < 300
    assert not (tmp_path / "out").exists()
