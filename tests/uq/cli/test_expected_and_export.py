"""``inertia identify --expected --export``: what it writes; a mistake in an option is one line, and nothing is written."""

import json

import mujoco
import numpy as np
import pytest

import uq.jobs.body_request as request_module
from tests.helpers.changed_result import changed
from uq.bodies.export_formats import export_format, names
from uq.cli.main import main

pytestmark = pytest.mark.usefixtures("results_follow_their_schema", "blank_pictures")

BODY = """
name = "steel bar"
mass = { value = "19.7 kg", tolerance = "10 g" }
[frame]
origin = ["0 mm", "0 mm", "53 mm"]
[[part]]
name = "bar"
shape = "cylinder"
axis = "y"
diameter = { value = "86.7 mm", tolerance = "0.1 mm" }
length = { value = "476 mm", tolerance = "0.5 mm" }
"""
REPORT = """
[cad]
about = "CG"
products = "integral"
mass = "19.7 kg"
cg = ["0 mm", "0 mm", "0 mm"]
inertia = { I11 = "18.5 g*m^2", I22 = "381.3 g*m^2", I33 = "379.1 g*m^2" }
[frame]
origin = ["0 mm", "0 mm", "53 mm"]
"""


@pytest.fixture(scope="module")
def lab(tmp_path_factory, preset):
    """Two runs of the preset's body, 20 s each."""
    from importlib import resources

    folder = tmp_path_factory.mktemp("lab")
    text = resources.files("uq").joinpath("presets", "barreto2016.toml").read_text("utf-8")
    (folder / "e.toml").write_text(text.replace("180 s", "19.75 s").replace("27 s", "2.9 s"))
    (folder / "body.toml").write_text(BODY)
    (folder / "cad.toml").write_text(REPORT)
    (folder / "bad.toml").write_text(BODY.replace("cylinder", "cone"))
    (folder / "massless.toml").write_text((folder / "e.toml").read_text().replace('mass = "19.7 kg"', "", 1))
    for seed in (0, 1):
        run = ["simulate", str(folder / "e.toml"), "-o", str(folder / f"{seed}.mcap"), "--seed", str(seed)]
        assert main(run) == 0
    return folder


@pytest.fixture(scope="module", autouse=True)
def identified_once(few_draws):
    """The same runs of the same experiment are identified once."""
    real, found = request_module.identify_files, {}

    def identified(paths, experiment, *arguments, **options):
        key = repr((paths, experiment.document, arguments, options))
        if key not in found:
            found[key] = real(paths, experiment, *arguments, **options)
        return found[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(request_module, "identify_files", identified)
        yield identified


def command(lab, *options, experiment="e.toml"):
    runs = [str(lab / f"{seed}.mcap") for seed in (0, 1)]
    return ["identify", *runs, "--experiment", str(lab / experiment), *map(str, options)]


def test_comparison_and_exports_join_the_report(lab, tmp_path, capsys):
    out = tmp_path / "out"
    options = ("--expected", lab / "body.toml", "--export", ",".join(names()), "--out", out)
    assert main(command(lab, *options)) == 0
    printed = capsys.readouterr().out
    content = json.loads((out / "result.json").read_text())
    assert content["export"] == {name: export_format(name).file for name in names()}
    assert all((out / file).stat().st_size for file in content["export"].values())
    expected, found = content["expected"], content["inertia"]
    assert expected["deviation"]["I11"] == pytest.approx(found["I11"] - expected["value"]["I11"])
    assert expected["mean_of_runs"]["I11"] == pytest.approx(np.mean([run["inertia"]["I11"] for run in content["runs"]]))
    assert expected["sha256"]
    assert set(expected["contributions"]) == {"mass", "part[bar].diameter", "part[bar].length"}
    page = (out / "report.html").read_text()
    for word in ("Expected: steel bar", "E_n", "body.urdf", "part[bar].length", "chi-squared"):
        assert word in page
        assert word in printed or word == "part[bar].length"
    model = mujoco.MjModel.from_xml_path(str(out / "body.xml"))
    assert sorted(model.body_inertia[1]) == pytest.approx(sorted(content["principal"]["moments"]), rel=1e-9)
    assert model.body_mass[1] == 19.7
    for run in content["runs"]:
        assert run["sha256"] in (out / "body.xml").read_text()


def test_swapped_axes_are_named(lab, capsys):
    assert main(command(lab, "--expected", lab / "cad.toml")) == 0
    printed = capsys.readouterr().out
    assert "the deviation from cad vanishes if its axes have other names or signs: try rotation_to_body = " in printed


@pytest.mark.parametrize(
    ("options", "words"),
    [
        (("--export", "stl"), "unknown export format 'stl': choose of abb, franka"),
        (("--export", ""), "unknown export format ''"),
        (("--expected", "{lab}/no.toml"), "no.toml"),
        (("--expected", "{lab}/bad.toml"), "part[bar].shape is 'cone': choose one of"),
        (("--expected", "{lab}/0.mcap"), "not a text file"),
        (("--expected", "{lab}/e.toml"), "unknown key body: the keys here are cad, frame, mass"),
    ],
)
def test_a_mistake_is_one_line_before_anything_is_computed(lab, tmp_path, capsys, monkeypatch, options, words):
    monkeypatch.setattr("uq.jobs.body_request.identify_files", lambda *_, **__: pytest.fail("computed"))
    out = tmp_path / "out"
    assert main(command(lab, *(str(one).replace("{lab}", str(lab)) for one in options), "--out", out)) == 2
    said = capsys.readouterr()
    assert said.err.startswith("error: ")
    assert words in said.err
    assert said.err.count("\n") == 1
    assert said.out == ""
    assert not out.exists()


def test_export_without_a_folder(lab, capsys):
    assert main(command(lab, "--export", "urdf")) == 2
    assert capsys.readouterr().err == "error: --export has no folder: add --out DIR\n"


def test_without_a_mass_or_of_a_tensor_that_no_body_has_nothing_is_written(
    lab, tmp_path, capsys, monkeypatch, identified_once
):
    out = tmp_path / "out"
    assert main(command(lab, "--export", "urdf", "--out", out, experiment="massless.toml")) == 2
    assert "the mass is not known" in capsys.readouterr().err

    def impossible(*arguments, **options):
        result = identified_once(*arguments, **options)
        return changed(result, inertia=result.inertia * [1, 1, 1, 1, 1, 3])

    monkeypatch.setattr("uq.jobs.body_request.identify_files", impossible)
    assert main(command(lab, "--export", "kuka", "--out", out)) == 2
    said = capsys.readouterr()
    assert "no body has this tensor" in said.err
    assert "--force exports it" in said.err
    assert said.err.count("\n") == 1
    assert said.out == ""
    assert not out.exists()
    assert main(command(lab, "--export", "kuka", "--force", "--out", out)) == 0
    assert "warning: no body has this tensor" in capsys.readouterr().out
    assert "no body has this tensor" in (out / "body.kuka.dat").read_text()


def test_force_without_an_export(lab, capsys):
    assert main(command(lab, "--force")) == 2
    assert capsys.readouterr().err == "error: --force is for --export, which is not given: add --export FORMATS\n"
