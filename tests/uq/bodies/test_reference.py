"""Files of reference bodies that cannot be read: one line that names the key."""

import pytest

from identify.rigid_body.inertial_parameters import InertialParameters
from uq import ExperimentError, load_reference
from uq.bodies.reference import reference


def within(value, half, **more):
    return {"value": value, "tolerance": half, **more}


CAD = {"about": "CG", "products": "tensor", "inertia": {"I11": "1 kg*m^2", "I22": "1 kg*m^2", "I33": "1 kg*m^2"}}
BALL = {"name": "ball", "shape": "sphere", "diameter": "10 mm", "density": "1000 kg/m^3"}


def balls(**change):
    return {"part": [{**{k: v for k, v in BALL.items() if change.get(k, "") is not None}, **{k: v for k, v in change.items() if v is not None}}]}  # fmt: skip


@pytest.mark.parametrize(
    ("document", "words"),
    [
        ({}, r"either \[\[part\]\] .* or \[cad\]"),
        ({**balls(), "cad": CAD}, r"either \[\[part\]\]"),
        ({"part": []}, r"no \[\[part\]\]"),
        ({"part": {}}, r"part is a table: write \[\[part\]\]"),
        (balls(colour="red"), r"unknown key part\[ball\].colour"),
        (balls(shape="cone"), r"part\[ball\].shape is 'cone': choose one of cylinder, cuboid, sphere"),
        (balls(diameter=10), "is 10: write a value with its unit"),
        (balls(diameter="10 kg"), "same dimension as m"),
        (balls(diameter="-10 mm"), "above zero"),
        (balls(diameter=within("10 mm", "11 mm")), "limits must be above zero"),
        (balls(diameter=within("10 mm", "-1 mm")), r"part\[ball\].diameter.tolerance is '-1 mm': write a value above zero"),
        (balls(diameter={"value": "10 mm"}), "has 0 of tolerance, standard_uncertainty, expanded_uncertainty: give one"),
        (balls(diameter=within("10 mm", "1 mm", standard_uncertainty="1 mm")), "has 2 of"),
        (balls(diameter=within("10 mm", "1 mm", distribution="normal")), "choose one of rectangular, triangular, u_shaped"),
        (balls(diameter=within("10 mm", ["1 mm", "-1 mm"])), "lower deviation, then the upper"),
        (balls(diameter=within("10 mm", ["1 mm"])), "lower deviation, then the upper"),
        (balls(diameter={"value": "10 mm", "expanded_uncertainty": "1 mm", "coverage_factor": 0}), "above zero"),
        (balls(diameter={"value": "10 mm", "standard_uncertainty": "1 mm", "k": 2}), "unknown key .*diameter.k"),
        (balls(inner_diameter="10 mm"), "not below"),
        (balls(density=None), "missing key mass"),
        (balls(mass="1 kg"), "has mass and density: give one"),
        (balls(density=None, material="steel"), r"unknown part\[ball\].material 'steel': one of none"),
        ({**balls(), "mass": "1 kg"}, "mass is not needed"),
        (balls(hole=True), "is no body: its mass is .*: check holes and masses"),
        (balls(hole="yes"), "true or false"),
        (balls(position=["1 mm"]), "three values"),
        (balls(position=["1 mm", "2 mm", "x"]), r"part\[ball\].position\[2\] is 'x'"),
        (balls(rotation="x, y"), "three signed axes"),
        (balls(rotation=[[1, 0, 0], [0, 1, 0], [0, 0, 2]]), "is no rotation"),
        (balls(rotation=3), "write 3 rows of 3"),
        (balls(shape="cuboid", diameter=None, size=["0 mm", "1 mm", "1 mm"]), r"part\[ball\].size\[0\] is '0 mm': write a value above zero"),
        ({"part": [BALL, BALL]}, r"two parts part\[ball\]"),
        ({**balls(), "material": {"steel": {}}}, "missing key material.steel.density"),
        ({**balls(), "material": {"steel": "7 kg"}}, "material.steel is '7 kg': write a table"),
        ({**balls(), "frame": {"misalignment": ["1 mm", "0 deg", "0 deg"]}}, "same dimension as rad"),
        ({**balls(), "frame": {"rotation_to_body": "x, x, y"}}, "frame.rotation_to_body"),
        ({**balls(), "frame": {"place": 1}}, "unknown key frame.place"),
        ({**balls(), "title": 1}, "unknown key title"),
        ({**balls(), "name": 1}, "name is 1: write a string"),
        ({"cad": {**CAD, "about": "CoM"}}, "cad.about is 'CoM': choose one of CG, origin"),
        ({"cad": {**CAD, "products": "plus"}}, "cad.products is 'plus': choose one of tensor, integral"),
        ({"cad": {k: v for k, v in CAD.items() if k != "about"}}, "missing key cad.about"),
        ({"cad": {**CAD, "about": "origin"}}, "missing key cad.mass"),
        ({"cad": {**CAD, "about": "origin", "mass": "1 kg"}}, "missing key cad.cg|cad.cg"),
        ({"cad": {**CAD, "inertia": {"I11": "1 kg*m^2"}}}, "missing key cad.inertia.I22"),
        ({"cad": {**CAD, "inertia": {**CAD["inertia"], "Ixx": "1 kg*m^2"}}}, "unknown key cad.inertia.Ixx"),
        ({"cad": 5}, "cad is 5: write a table"),
    ],
)  # fmt: skip
def test_bad_input_is_one_line_that_names_the_key(document, words):
    with pytest.raises(ExperimentError, match=words) as caught:
        reference(document)
    assert "\n" not in str(caught.value)


def test_bad_files(tmp_path):
    path = tmp_path / "body.toml"
    with pytest.raises(FileNotFoundError):
        load_reference(path)
    path.write_bytes(b"\xff\xfe")
    with pytest.raises(ExperimentError, match=r"not TOML .*body.toml: not a text file"):
        load_reference(path)
    path.write_text("part = [")
    with pytest.raises(ExperimentError, match=r"not TOML .*body.toml"):
        load_reference(path)
    path.write_text("colour = 1")
    with pytest.raises(ExperimentError, match=r"\(in .*body.toml\)"):
        load_reference(path)
    path.write_text('[[part]]\nname="ball"\nshape="sphere"\ndiameter="10 mm"\ndensity="1000 kg/m^3"')
    found = load_reference(path)
    assert isinstance(found.parameters, InertialParameters)
    assert found.name == "body"
    assert len(found.sha256) == 64
