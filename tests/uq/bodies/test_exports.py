"""Exports: simulators load them and report the same tensor, every other format is read back; what cannot be is refused."""

import dataclasses
import json
import re
from types import SimpleNamespace
from xml.etree import ElementTree

import mujoco
import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore
from ruamel.yaml import YAML
from scipy.spatial.transform import Rotation

from identify import RunError
from identify.rigid_body.inertial_parameters import Datum, InertialParameters
from uq import ExperimentError, export
from uq.bodies.export_formats import names
from uq.bodies.export_formats.kuka import turns_zyx
from uq.bodies.exported_body import ExportedBody

RTOL = 1e-9
"""Numbers are written with all their digits; MuJoCo diagonalises the tensor."""


def matrix(six):
    i11, i12, i13, i22, i23, i33 = six
    return np.array([[i11, i12, i13], [i12, i22, i23], [i13, i23, i33]])


def turned(moments, rotation):
    return (rotation @ np.diag(moments) @ rotation.T)[np.triu_indices(3)]


def body(inertia, mass=19.7, r_cg=(0.004, -0.011, 0.053)):
    covariance = np.diag(np.array([1e-3, 1e-4, 1e-4, 1e-4, *[1e-3] * 6]) ** 2)
    return InertialParameters(mass, np.array(r_cg), np.asarray(inertia, float), covariance)


TILTED = Rotation.from_euler("ZYX", [40, -25, 70], degrees=True).as_matrix()
UPRIGHT = Rotation.from_euler("ZYX", [35, 90, 0], degrees=True).as_matrix()
BODIES = {
    "general": body(turned([0.12, 0.31, 0.38], TILTED)),
    "diagonal": body([0.3813, 0, 0, 0.0185, 0, 0.3791], r_cg=(0, 0, 0.053)),
    "gimbal lock": body(turned([0.2, 0.3, 0.26], UPRIGHT)),
    "ball": body(turned([0.02, 0.02, 0.02], TILTED)),
    "rod": body(turned([0.3, 0.3, 0.006], TILTED)),
    "small": body(turned([1.2e-9, 3.1e-9, 3.8e-9], TILTED), mass=3e-4, r_cg=(1e-5, -2e-4, 3e-6)),
    "flat": body([0.1, 0, 0, 0.2, 0, 0.1 + 0.2]),
}


@pytest.fixture(params=BODIES)
def one(request):
    return BODIES[request.param]


def text(parameters, name):
    (content,) = export(parameters, name).contents.values()
    return content


def check(parameters, mass, r_cg, tensor, rtol=RTOL):
    scale = np.abs(parameters.inertia).max()
    assert mass == pytest.approx(parameters.mass, rel=rtol)
    np.testing.assert_allclose(r_cg, parameters.r_cg, rtol=0, atol=rtol * np.abs(parameters.r_cg).max())
    np.testing.assert_allclose(tensor, matrix(parameters.inertia), rtol=0, atol=rtol * scale)


def of_mujoco(content):
    model = mujoco.MjModel.from_xml_string(content)
    number = model.body("body").id
    turn = Rotation.from_quat(model.body_iquat[number], scalar_first=True).as_matrix()
    return model.body_mass[number], model.body_ipos[number], turn @ np.diag(model.body_inertia[number]) @ turn.T


@pytest.mark.parametrize("name", ["urdf", "mjcf"])
def test_mujoco_reports_the_same(one, name):
    check(one, *of_mujoco(text(one, name)))


def test_sdf_is_read_back(one):
    """SDFormat: ``inertial/pose`` is the inertial frame in the link's, its turn roll, pitch, yaw about fixed axes."""
    inertial = ElementTree.fromstring(text(one, "sdf")).find("model/link/inertial")
    pose = np.array(inertial.findtext("pose").split(), float)
    turn = Rotation.from_euler("xyz", pose[3:]).as_matrix()
    entry = {item.tag: float(item.text) for item in inertial.find("inertia")}
    tensor = matrix([entry[k] for k in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")])
    check(one, float(inertial.findtext("mass")), pose[:3], turn @ tensor @ turn.T)


def from_yaml(content):
    """By YAML 1.1, as ROS reads it."""
    parser = YAML(typ="safe", pure=True)
    parser.version = (1, 1)
    return parser.load(content)


def test_ros_is_read_back(one):
    """YAML 1.1 takes 3e-06 for a word: every value must be a number. The fields are those that rosbags knows."""
    message = from_yaml(text(one, "ros"))
    types = get_typestore(Stores.ROS2_JAZZY).types
    types["geometry_msgs/msg/Inertia"](**message | {"com": types["geometry_msgs/msg/Vector3"](**message["com"])})
    tensor = matrix([message[k] for k in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")])
    check(one, message["m"], [message["com"][axis] for axis in "xyz"], tensor)


def test_json_is_read_back(one):
    content = json.loads(text(one, "json"))
    tensor = matrix([content["inertia"][k] for k in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")])
    check(one, content["mass"]["value"], content["cg"]["value"], tensor)
    axes = np.array(content["principal"]["axes"])
    check(one, one.mass, one.r_cg, axes.T @ np.diag(content["principal"]["moments"]) @ axes)
    np.testing.assert_array_equal(content["covariance"]["values"], one.covariance)


NUMBER = r"-?\d[\d.eE+-]*"


def test_kuka_is_read_back(one):
    """A about Z, B about the new Y, C about the new X; mm and degrees; principal moments in kg·m²."""
    line = next(line for line in text(one, "kuka").splitlines() if line.startswith("LOAD_DATA[1]="))
    pattern = r"\{M (N), CM \{X (N), Y (N), Z (N), A (N), B (N), C (N)\}, J \{X (N), Y (N), Z (N)\}\}"
    values = np.array(re.fullmatch(re.escape("LOAD_DATA[1]=") + pattern.replace("N", NUMBER), line).groups(), float)
    turn = Rotation.from_euler("ZYX", values[4:7], degrees=True).as_matrix()
    check(one, values[0], values[1:4] / 1e3, turn @ np.diag(values[7:]) @ turn.T)


def test_abb_is_read_back(one):
    line = next(line for line in text(one, "abb").splitlines() if "PERS loaddata" in line)
    declared = re.fullmatch(r"  PERS loaddata (\w{1,32}):=(.*);", line)
    mass, cog, aom, *moments = json.loads(declared[2])
    turn = Rotation.from_quat(aom, scalar_first=True).as_matrix()
    assert np.linalg.norm(aom) == pytest.approx(1, abs=1e-12)
    check(one, mass, np.array(cog) / 1e3, turn @ np.diag(moments) @ turn.T)


def test_ur_is_read_back(one):
    """The call is Python, too: [Ixx, Iyy, Izz, Ixy, Ixz, Iyz] about the CG."""
    called = []
    exec(text(one, "ur"), {"set_target_payload": lambda *values: called.append(values)})
    ((mass, cog, (xx, yy, zz, xy, xz, yz)),) = called
    check(one, mass, cog, matrix([xx, xy, xz, yy, yz, zz]))


def test_franka_is_read_back(one):
    request = from_yaml(text(one, "franka"))
    tensor = np.array(request["load_inertia"], float).reshape(3, 3, order="F")
    check(one, request["mass"], np.array(request["center_of_mass"], float), tensor)


def test_principal_axes_turn_least_and_are_right_handed(one):
    _, axes = ExportedBody(one.mass, one.r_cg, one.inertia).principal()
    np.testing.assert_allclose(axes.T @ axes, np.eye(3), atol=1e-12)
    assert np.linalg.det(axes) == pytest.approx(1)
    if not one.inertia[[1, 2, 4]].any():
        np.testing.assert_array_equal(axes, np.eye(3))


def test_principal_axes_are_the_nearest_of_all_24(generator):
    group = Rotation.create_group("O").as_matrix()
    for turn in Rotation.random(200, rng=generator).as_matrix():
        _, axes = ExportedBody(1.0, np.zeros(3), turned([0.2, 0.3, 0.4], turn)).principal()
        assert np.linalg.det(axes) == pytest.approx(1)
        assert np.trace(axes) == pytest.approx(np.trace(turn @ group, axis1=1, axis2=2).max())


@pytest.mark.filterwarnings("ignore:Gimbal lock")
@pytest.mark.parametrize("b", [-90.0, -89.9999999, -30.0, 0.0, 89.9999999, 90.0])
def test_turns_make_the_rotation_again(b):
    for a, c in ((0.0, 0.0), (30.0, -70.0), (-170.0, 179.0)):
        rotation = Rotation.from_euler("ZYX", [a, b, c], degrees=True).as_matrix()
        again = Rotation.from_euler("ZYX", turns_zyx(rotation)).as_matrix()
        np.testing.assert_allclose(again, rotation, atol=1e-9)


# What stands in the comments, and where.


def result(parameters, **more):
    runs = (SimpleNamespace(file="a--b\nc.mcap", sha256="0123abcd" * 8), SimpleNamespace(file="µ.mcap", sha256=None))
    return SimpleNamespace(parameters=parameters, runs=runs, provenance={}, **more)


@pytest.mark.parametrize("name", [name for name in names() if name != "json"])
def test_uncertainty_and_provenance_stand_in_a_comment(name):
    content = text(result(BODIES["general"]), name)
    assert "0123abcd" * 8 in content
    assert "I11 0.001" in content
    assert "mass 0.001" in content
    assert content.isascii()
    if content.startswith("<"):
        ElementTree.fromstring(content)
    else:
        marks = {"kuka": ";", "abb": "!"}
        (line,) = [line for line in content.splitlines() if "0123abcd" in line]
        assert line.strip().startswith(marks.get(name, "#"))


def test_an_uncertainty_that_is_not_stated_is_not_called_zero():
    exact = dataclasses.replace(BODIES["general"], covariance=np.diag([0.0, *[1e-6] * 9]))
    assert "mass not stated, cg_x 0.001" in text(exact, "urdf")
    assert json.loads(text(exact, "json"))["standard_uncertainty"]["mass"] is None


def test_in_the_declared_datums_frame():
    datum = Datum(TILTED, np.array([0.01, 0.02, -0.03]))
    one = BODIES["general"]
    moved = one.in_datum(datum)
    check(moved, *of_mujoco(text(result(one, datum=datum), "mjcf")))
    assert "Frame: declared datum" in text(result(one, datum=datum), "mjcf")


def test_an_admissible_fit_is_exported_with_a_warning():
    made = export(
        result(
            BODIES["general"],
            admissible=SimpleNamespace(reason="no body has the plain estimate, I33 is 2 g·m² high", distance=2.9),
        ),
        "kuka,json",
    )
    assert "I33 is 2 g·m² high" in made.warnings[0]
    assert (
        "warning: the data are weak and the exported tensor is the nearest possible one: no body has the plain"
        in made.contents["body.kuka.dat"]
    )
    assert "warning" in repr(made)


def test_a_tensor_far_from_every_body_is_exported_by_force_only(tmp_path):
    """Nearest to diag(a, b, a + b + d) is a flat plate: d / √3 away, in units of equal standard uncertainties."""
    far = body([0.1, 0, 0, 0.2, 0, 0.3 + np.sqrt(3) * 5e-3])
    with pytest.raises(
        RunError, match=r"nearest body lies 5\.0 standard uncertainties .*; --force exports it"
    ) as caught:
        export(far, "urdf", tmp_path / "out")
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "out").exists()
    made = export(far, names(), tmp_path / "out", force=True)
    assert "no body has this tensor" in made.warnings[0]
    assert "5.0 standard uncertainties" in made.warnings[0]
    assert "warning: no body has this tensor" in made.contents["body.urdf"]
    assert json.loads(made.contents["body.json"])["warnings"] == list(made.warnings)
    assert float(re.search(r'izz="([^"]+)"', made.contents["body.urdf"])[1]) == far.inertia[5]


def test_what_the_runs_contradict_is_exported_by_force_only(tmp_path):
    words = "the runs contradict what is declared of mass (8.5 u off)"
    doubtful = result(BODIES["general"], contradicted=words)
    with pytest.raises(RunError, match=r"declared of mass \(8\.5 u off\), so it is not .*; --force exports it"):
        export(doubtful, "urdf", tmp_path / "out")
    assert not (tmp_path / "out").exists()
    made = export(doubtful, names(), force=True)
    assert made.warnings == (words,)
    assert f"warning: {words}" in made.contents["body.urdf"]
    statuses = [export(one, "json", force=True).contents["body.json"] for one in (doubtful, result(BODIES["general"]))]
    assert [json.loads(text)["status"] for text in statuses] == ["contradicted", "not contradicted"]


def test_a_fit_far_from_what_the_data_say_is_exported_by_force_only(tmp_path):
    fitted = result(BODIES["general"], admissible=SimpleNamespace(reason="no body has it", distance=3.4))
    with pytest.raises(RunError, match=r"nearest body lies 3\.4 standard uncertainties .*; --force exports it"):
        export(fitted, "urdf", tmp_path / "out")
    assert not (tmp_path / "out").exists()
    assert "3.4 standard uncertainties" in export(fitted, "urdf", force=True).warnings[0]


@pytest.mark.parametrize("parameters", [body([0.1, 0, 0, 0.2, 0, 0.2], mass=np.nan), body([np.nan, 0, 0, 0.2, 0, 0.2])])
def test_force_does_not_export_what_is_not_known(parameters):
    with pytest.raises(RunError):
        export(parameters, "urdf", force=True)


def test_all_files_or_none(tmp_path, monkeypatch):
    made = export(BODIES["general"], names(), tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(made.contents)
    assert made.to_dict()["urdf"] == "body.urdf"
    monkeypatch.setattr(
        "uq.files.output_folder._write", lambda path, data: (_ for _ in ()).throw(OSError(28, "disk full"))
    )
    with pytest.raises(OSError, match="disk full"):
        export(BODIES["diagonal"], names(), tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == sorted(made.contents)
    assert (tmp_path / "body.urdf").read_text() == made.contents["body.urdf"]


@pytest.mark.parametrize(
    ("parameters", "formats", "words"),
    [
        (
            body([0.1, 0, 0, 0.2, 0, 0.31]),
            "urdf",
            r"no body has this tensor .*0.3100 kg·m²;.*\), so it is not exported",
        ),
        (body([-0.1, 0, 0, 0.2, 0, 0.2]), "json", "no body has this tensor"),
        (body([0.2, 0.19, 0.19, 0.2, -0.19, 0.2]), "ur", "no body has this tensor"),
        (body([0.1, 0, 0, 0.2, 0, 0.2], mass=np.nan), "urdf", "mass is not known.* state body.mass, or give --centre"),
        (body([0.1, 0, 0, 0.2, 0, 0.2], mass=0.0), "urdf", "mass is not known"),
        (body([np.nan, 0, 0, 0.2, 0, 0.2]), "urdf", "not finite"),
        (body([0.1, 0, 0, 0.2, 0, 0.2], r_cg=(0, np.nan, 0)), "urdf", "not finite"),
        (BODIES["general"], "urdf,stl", "unknown export format 'stl': choose of abb, franka"),
        (BODIES["general"], "", "unknown export format ''"),
        (BODIES["general"], [], "unknown export format ''"),
    ],
)
def test_what_cannot_be_exported_is_refused_in_one_line(parameters, formats, words, tmp_path):
    with pytest.raises((RunError, ExperimentError), match=words) as caught:
        export(parameters, formats, tmp_path / "out")
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "out").exists()


def test_formats_are_named_once():
    assert tuple(export(BODIES["general"], "ur, ur,kuka").formats) == ("ur", "kuka")
    assert dataclasses.is_dataclass(export(BODIES["general"], "ur"))
