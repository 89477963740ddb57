"""``inertia montecarlo``: adaptive runs, several bodies, what is resumed; a user's mistakes in one line."""

import json
import tomllib
from importlib import resources

import pytest

from uq.cli import montecarlo as command
from uq.cli.main import main
from uq.experiment.experiment import Experiment, ExperimentError

pytestmark = pytest.mark.usefixtures("results_follow_their_schema", "blank_pictures")

PRESET = resources.files("uq").joinpath("presets", "barreto2016.toml").read_text("utf-8")
SHORT = PRESET.replace("180 s", "3 s").replace("27 s", "0.45 s")
HEAD, *SOURCES = SHORT.split("[[source]]")
SHORT = "[[source]]".join([HEAD, *(text for text in SOURCES if 'name = "M_precision"' in text)])
BODY = SHORT[SHORT.index("[body]") : SHORT.index("[platform]")]
TWO = SHORT.replace(BODY, BODY.replace("[body]", "[body.full]") + BODY.replace("[body]", "[body.half]").replace("19.7", "9.85"))  # fmt: skip


@pytest.fixture
def experiment(tmp_path):
    path = tmp_path / "e.toml"
    path.write_text(SHORT)
    return path


def arguments(experiment, *more):
    return ["montecarlo", str(experiment), "--trajectory", "T3", "--estimator", "central", *map(str, more)]


@pytest.mark.slow
def test_an_adaptive_run_states_what_it_reached(experiment, tmp_path, capsys):
    out = tmp_path / "out"
    assert main(arguments(experiment, "--adaptive", "--tolerance", "100 g*m^2", "--out", out)) == 0
    said = capsys.readouterr().out
    assert "Monte Carlo, adaptive, " in said
    assert "tolerance" in said
    content = json.loads((out / "result.json").read_text())
    adaptive = content["adaptive"]
    assert (adaptive["stable"], adaptive["digits"]) == (True, None)
    assert content["trials"] == 2000 * adaptive["blocks"]
    found = adaptive["trajectories"]["T3"]["central"]
    assert all(found["reached"][name] <= found["tolerance"][name] == pytest.approx(100) for name in found["tolerance"])
    coverage = content["trajectories"]["T3"]["central"]["coverage"]
    assert coverage["symmetric"]["low"]["I11"] < coverage["symmetric"]["high"]["I11"]
    assert coverage["shortest"]["low_standard_error"]["I33"] > 0
    assert coverage["ellipsoid"]["coverage"] == pytest.approx(0.95, abs=0.02)
    assert "95 % coverage intervals of the error" in (out / "report.html").read_text()
    assert not (out / "checkpoint").exists()


@pytest.mark.parametrize("name", ["paper", "montecarlo"])
def test_a_checkpoint_folder_with_another_file_is_refused_before_any_work(name, tmp_path, capsys, monkeypatch):
    """Also that of the second of two bodies."""
    (tmp_path / "two.toml").write_text(TWO)
    place = tmp_path / "out" / ("half" if name == "montecarlo" else "") / "checkpoint"
    place.mkdir(parents=True)
    (place / "model.pt").write_text("precious")
    monkeypatch.setattr(f"uq.cli.{name}.{'law' if name == 'montecarlo' else name}", None)
    command = {"paper": ["paper"], "montecarlo": [*arguments(tmp_path / "two.toml"), "--law"]}[name]
    assert main([*command, "--trials", "4", "--out", str(tmp_path / "out")]) == 2
    cure = "choose another folder, or move that elsewhere"
    assert capsys.readouterr().err == f"error: 'model.pt' in {place} is no file of a campaign: {cure}\n"
    assert [path.name for path in (tmp_path / "out").rglob("*") if path.is_file()] == ["model.pt"]


@pytest.mark.slow
def test_the_law_joins_the_report(experiment, tmp_path, capsys, monkeypatch):
    """Said once, in its report beside the campaign's results; a report without it has no script."""
    monkeypatch.setenv("COLUMNS", "300")  # in a narrow terminal a wide table is several
    out = tmp_path / "out"
    assert main(arguments(experiment, "--trials", 20, "--law", "--out", out)) == 0
    printed = capsys.readouterr().out
    assert printed.count("Law of propagation beside the Monte Carlo") == 1
    assert printed.rstrip().endswith(f"are in {out}")  # the last line, below what the law says
    page = (out / "report.html").read_text()
    assert page.count('class="adjustable"') == page.count('<script type="module">') == 1
    assert "Each group and source alone, by the law" in page
    for text in ("Do the laws' 95 % intervals hold?", "The laws' intervals, case by case"):
        assert text.replace("'", "&#39;") in page
    content = json.loads((out / "result.json").read_text())
    assert (content["trials"], list(content["trajectories"])) == (20, ["T3"])
    total = content["law"]["trajectories"]["T3"]["central"]["groups"]["total"]
    assert total["three_sigma"]["I22"] > 0
    verdicts = content["law_validation"]["verdicts"]
    assert {verdict["case"] for verdict in verdicts} == set(
        content["law"]["trajectories"]["T3"]["central"]["groups"]
    ) | {source["name"] for source in content["provenance"]["experiment"]["source"]}
    assert main(arguments(experiment, "--trials", 20, "--out", out)) == 0
    assert "<script" not in (out / "report.html").read_text()


def test_an_interrupted_run_is_resumed_by_the_same_command(experiment, tmp_path, capsys, monkeypatch):
    class Interrupted(command.TerminalBar):
        def __call__(self, name, done, asked):
            if done == 400:
                raise KeyboardInterrupt

    out, run = tmp_path / "out", arguments(experiment, "--samples", "--trials", 500)
    with monkeypatch.context() as patch:
        patch.setattr(command, "TerminalBar", Interrupted)
        assert main([*run, "--out", str(out)]) == 130
    assert capsys.readouterr().err == "error: interrupted; the same command continues from there\n"
    assert main([*run, "--seed", "1", "--out", str(out)]) == 2
    assert "is of another campaign (other seed): give the same arguments" in capsys.readouterr().err
    assert main([*run, "--out", str(out)]) == 0
    assert capsys.readouterr().err == "resuming T3 at trial 400 of 500\n"
    assert not (out / "checkpoint").exists()
    assert main([*run, "--out", str(tmp_path / "whole")]) == 0
    one, two = (json.loads((folder / "result.json").read_text()) for folder in (out, tmp_path / "whole"))
    assert one["trajectories"] == two["trajectories"]


@pytest.mark.parametrize(
    ("option", "points", "trials", "words"),
    [
        pytest.param("--quasi-random", "quasi-random", 128, "", marks=pytest.mark.slow),
        ("--collapsed", "random", 20, "--collapsed is the default now: leave it out\n"),
    ],
)
def test_how_trials_are_drawn_is_an_option(experiment, tmp_path, capsys, option, points, trials, words):
    """And what was an option and is the default is taken without harm."""
    assert main(arguments(experiment, option, "--trials", trials, "--out", tmp_path / "out")) == 0
    provenance = json.loads((tmp_path / "out" / "result.json").read_text())["provenance"]
    assert (provenance["engine"], provenance["points"]) == ("sums", points)
    assert capsys.readouterr().err == words


def test_several_bodies_in_one_campaign(tmp_path, capsys):
    path = tmp_path / "two.toml"
    path.write_text(TWO)
    out = tmp_path / "out"
    assert main(arguments(path, "--trials", 20, "--out", out)) == 0
    said = capsys.readouterr().out
    assert said.index("body full") < said.index("body half")
    assert sorted(folder.name for folder in out.iterdir()) == ["full", "half"]
    masses = [
        json.loads((out / name / "result.json").read_text())["provenance"]["experiment"]["body"]["mass"]
        for name in ("full", "half")
    ]
    assert masses == ["19.7 kg", "9.85 kg"]
    with pytest.raises(ExperimentError, match=r"several bodies in \[body\] \(full, half\): this takes a file with one"):
        Experiment.load(path)
    assert list(Experiment.load_bodies("barreto2016")) == [""]
    assert main(["simulate", str(path), "-o", str(tmp_path / "run.mcap")]) == 2


def test_a_body_whose_name_is_no_folder(tmp_path):
    path = tmp_path / "two.toml"
    path.write_text(TWO.replace("[body.half]", '[body."../half"]'))
    assert tomllib.loads(path.read_text())
    with pytest.raises(ExperimentError, match="write a name of at most 60 letters"):
        Experiment.load_bodies(path)


@pytest.mark.parametrize(
    ("more", "words"),
    [
        (("--digits", "2"), "--digits and --tolerance are for an adaptive run: add --adaptive"),
        (("--adaptive", "--digits", "0"), "adaptive: Argument `digits` must be 1 or more"),
        (("--adaptive", "--trials", "100"), "100 trials: an adaptive campaign needs 4000 or more"),
        (("--adaptive", "--tolerance", "0.05"), "--tolerance is '0.05': write a number, a space and a unit"),
        (("--adaptive", "--tolerance", "0.05 kg"), "write a unit of the same dimension as kg*m^2"),
        (("--adaptive", "--tolerance=-1 g*m^2"), "--tolerance is '-1 g*m^2': give a value above zero"),
        (("--adaptive", "--tolerance", "1 g*m^2", "--digits", "1"), "choose one"),
        (("--trajectory", "T9"), "unknown trajectory 'T9'"),
        (("--quasi-random", "--trials", "100"), "quasi-random trials are on sums, not adaptive, and 128 or more"),
    ],
)
def test_mistakes_leave_nothing_behind(experiment, tmp_path, capsys, more, words):
    out = tmp_path / "deep" / "out"
    assert main(arguments(experiment, *more, "--out", out)) == 2
    said = capsys.readouterr()
    assert words in said.err
    assert said.err.count("\n") == 1
    assert not (tmp_path / "deep").exists()
