"""A maker's URDF, whose meshes are in a package of ROS: found, or one line before the search."""

import struct
from pathlib import Path

import numpy as np
import pytest

import uq.plan.motion_design.arm.arm_design as arm_design
from uq.cli.main import main
from uq.experiment.experiment import Experiment
from uq.plan.motion_design.arm.arm import Arm
from uq.plan.motion_design.arm.clearance import Clearance
from uq.plan.motion_design.arm.mujoco_run import left_out, loaded_model

pytest.importorskip("mujoco")
pytest.importorskip("pinocchio")

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


def dae():
    """The same as COLLADA, which MuJoCo does not read."""
    positions, order = " ".join(map(str, CORNERS.ravel())), " ".join(str(k) for face in FACES for k in face)
    return f"""<?xml version="1.0"?><COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<library_geometries><geometry id="g"><mesh><source id="p"><float_array id="a" count="12">{positions}</float_array>
<technique_common><accessor source="#a" count="4" stride="3"><param name="X" type="float"/><param name="Y" type="float"/>
<param name="Z" type="float"/></accessor></technique_common></source><vertices id="v"><input semantic="POSITION" source="#p"/>
</vertices><triangles count="4"><input semantic="VERTEX" source="#v" offset="0"/><p>{order}</p></triangles></mesh></geometry>
</library_geometries><library_visual_scenes><visual_scene id="s"><node><instance_geometry url="#g"/></node></visual_scene>
</library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>""".encode()


CONTENT = {"stl": stl, "obj": obj, "dae": dae}


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
    assert "maker_description/meshes/link.stl" in str(Clearance.of(arm).geometry.geometryObjects[0].meshPath)
    assert loaded_model(arm, experiment.body, 9.81).nmesh == 1
    assert left_out(arm) == ()


@pytest.mark.parametrize("kind", ["stl", "obj", "dae"])
@pytest.mark.parametrize("written", ["link.{}", "file://{folder}/link.{}"])
def test_other_names_and_formats(kind, written, tmp_path):
    name = written.format(kind, folder=tmp_path)
    put(tmp_path / f"link.{kind}", kind)
    experiment = Experiment.load(write(tmp_path, f'<mesh filename="{name}" scale="2 2 2"/>'))
    arm = Arm.of(experiment)
    shape = Clearance.of(arm).shapes[0]
    np.testing.assert_allclose(shape.half, 0.1, rtol=1e-6)
    assert loaded_model(arm, experiment.body, 9.81).nmesh == (kind != "dae")
    assert left_out(arm) == (("link.dae",) if kind == "dae" else ())


@pytest.mark.parametrize(
    ("mesh", "content", "message"),
    [(MESH, None, "name the folder that holds maker_description in ROS_PACKAGE_PATH"),
     ('<mesh filename="link.stl"/>', None, "no file of the collision mesh 'link.stl' in arm.urdf: put it there"),
     ('<mesh filename=""/>', None, "no file of the collision mesh '' in arm.urdf"),
     ('<mesh filename="package://"/>', None, "no file of the collision mesh 'package://'"),
     ('<mesh filename="link.stl"/>', b"solid\x00" * 20, "collision shapes of arm.urdf cannot be read")],
)  # fmt: skip
def test_what_cannot_be_read_is_said_before_the_search(mesh, content, message, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr(arm_design, "random_series", lambda *_: pytest.fail("searched"))
    if content is not None:
        (tmp_path / "link.stl").write_bytes(content)
    assert main(["design", str(write(tmp_path, mesh)), "--out", str(tmp_path / "out")]) == 2
    (line,) = capsys.readouterr().err.splitlines()[-1:]
    assert line.startswith("error: ")
    assert message in line
    assert len(line) < 300
    assert not (tmp_path / "out").exists()


def test_mujoco_is_asked_before_the_search(tmp_path, capsys, monkeypatch):
    """A flat mesh has no volume, which MuJoCo refuses and Coal does not."""
    monkeypatch.setattr(arm_design, "random_series", lambda *_: pytest.fail("searched"))
    monkeypatch.setattr(arm_design, "ArmLimits", lambda *_: None)  # which takes seconds to compile
    flat = np.array([[0, 0, 0], [0.05, 0, 0], [0, 0.05, 0]])
    (tmp_path / "link.obj").write_text("".join(f"v {x} {y} {z}\n" for x, y, z in flat) + "f 1 2 3\n")
    assert main(["design", str(write(tmp_path, '<mesh filename="link.obj"/>'))]) == 2
    assert "error: MuJoCo cannot read arm.urdf (" in capsys.readouterr().err
