"""A file of jobs: each body's result is that of a single identification, and no job costs another."""

import csv
import json
import os
import re
import shutil
import time
from importlib import resources

import numpy as np
import pytest

from identify.results.identification_result import Identification
from identify.rigid_body.inertia import COMPONENTS
from rig.child_process import start_python
from uq import Experiment, ExperimentError, identify_files, identify_jobs
from uq.cli.main import main
from uq.jobs.job_work import work
from uq.jobs.jobs_file import load_jobs
from uq.processes import process_pool

E = "t1-10s.toml"
GAIN = {"19.7 kg": "21.67 kg", "381.3 g": "419.43 g", "18.5 g": "20.35 g", "379.1 g": "417.01 g"}
"""The body of a load cell that reads 10 % too much."""
JOBS = f"""\
experiment = "{E}"

[[job]]
name = "disc"
runs = ["a.mcap"]
export = ["urdf"]

[[job]]
name = "both"
runs = ["[ab].mcap"]

[[job]]
name = "gain"
runs = ["gain.mcap"]

[[job]]
name = "cut"
runs = ["cut.mcap"]

[[job]]
name = "wrong"
runs = ["b.mcap"]
experiment = "wrong.toml"

[[job]]
name = "gone"
runs = ["gone*.mcap"]
"""


@pytest.fixture(scope="module")
def night(tmp_path_factory):
    """A folder with the jobs' files, and how the jobs went."""
    folder = tmp_path_factory.mktemp("night")
    text = resources.files("uq").joinpath("examples", E).read_text("utf-8")
    (folder / E).write_text(text, "utf-8")
    (folder / "wrong.toml").write_text(text.replace("mass", "masss"), "utf-8")
    for before, after in GAIN.items():
        text = text.replace(before, after)
    (folder / "gain.toml").write_text(text, "utf-8")
    for name, experiment, seed in (("a", E, "1"), ("b", E, "2"), ("gain", "gain.toml", "3")):
        assert main(["simulate", str(folder / experiment), "-o", str(folder / f"{name}.mcap"), "--seed", seed]) == 0
    (folder / "cut.mcap").write_bytes((folder / "a.mcap").read_bytes()[:100_000])
    (folder / "jobs.toml").write_text(JOBS, "utf-8")
    steps = []
    results = identify_jobs(
        folder / "jobs.toml", folder / "out", processes=2, progress=lambda *step: steps.append(step)
    )
    results = {result.name: result for result in results}
    assert steps == [("jobs", k, 6) for k in range(7)]
    return folder, results


def test_a_job_is_what_a_single_identification_is(night):
    folder, results = night
    assert {name: result.status for name, result in results.items()} == {
        "disc": "done", "both": "done", "gain": "done", "cut": "failed", "wrong": "failed", "gone": "failed"
    }  # fmt: skip
    alone = identify_files([folder / "a.mcap", folder / "b.mcap"], Experiment.load(folder / E))
    content = results["both"].content()
    assert [content["inertia"][k] for k in COMPONENTS] == alone.inertia.tolist()
    np.testing.assert_array_equal([content["interval95"][k] for k in COMPONENTS], alone.interval95)
    assert results["disc"].verdict == "not contradicted"
    assert {"result.json", "report.html", "residuals.svg", "body.urdf"} <= set(os.listdir(results["disc"].folder))


def test_a_run_with_a_gain_of_ten_percent_is_not_uncontradicted(night):
    assert night[1]["gain"].verdict in ("warnings", "contradicted")


def test_a_job_that_fails_is_a_line(night):
    folder, results = night
    lines = {name: result.line for name, result in results.items() if result.verdict == "failed"}
    assert re.search(r"cut\.mcap.*inertia recover", lines["cut"])
    assert re.search(r"unknown key body\.masss: .*mass.*wrong\.toml", lines["wrong"])
    assert "gone*.mcap" in lines["gone"]
    assert not any("\n" in line for line in lines.values())
    assert all(results[name].content() == {} and not (folder / "out" / name).exists() for name in lines)


def test_the_summary_has_a_row_for_each_job(night):
    folder, results = night
    with open(folder / "out" / "summary.csv", newline="") as file:
        rows = {row["job"]: row for row in csv.DictReader(file)}
    assert list(rows) == ["disc", "both", "gain", "cut", "wrong", "gone"]
    for name, row in rows.items():
        assert row["verdict"] == results[name].verdict
        assert row["remark"] == results[name].line
    content = results["both"].content()
    low, high = content["interval95"]["I33"]
    assert float(rows["both"]["I33_kg_m2"]) == content["inertia"]["I33"]
    assert float(rows["both"]["half_width95_I33_kg_m2"]) == pytest.approx((high - low) / 2, rel=1e-12)
    assert (rows["both"]["runs"], rows["both"]["mass_kg"]) == ("2", "19.7")
    page = (folder / "out" / "summary.html").read_text("utf-8")
    assert set(re.findall(r'<a href="(\w+)/report.html">', page)) == {"disc", "both", "gain"}
    assert "unknown key body.masss" in page


def test_what_is_done_is_not_done_again(night, tmp_path, capsys, monkeypatch):
    """The same command keeps it; other inputs replace it, and a line says so; a stranger's folder is left alone."""
    shutil.copytree(night[0], tmp_path / "copy")
    monkeypatch.chdir(tmp_path / "copy")
    before = os.stat("out/disc/result.json").st_ino
    shutil.rmtree("out/both")
    os.makedirs("out/.disc.0123abcd")
    os.makedirs("out/both")
    (tmp_path / "copy/out/both/notes.txt").write_text("mine")
    text = JOBS.partition('[[job]]\nname = "cut"')[0].replace('"gain.mcap"]', '"gain.mcap"]\nmethod = "gls"')
    (tmp_path / "copy/jobs.toml").write_text(text, "utf-8")
    assert main(["identify", "--jobs", "jobs.toml", "--out", "out"]) == 1
    said = capsys.readouterr()
    assert said.err == "gain: replaced, since what it was made from has changed: method\n"
    assert re.search(r"^both +failed ", said.out, re.M)
    assert re.search(r"^both: there is no result; .*both.* holds something else than a job's result", said.out, re.M)
    with open("out/summary.csv", newline="") as file:
        status = {row["job"]: row["status"] for row in csv.DictReader(file)}
    assert status == {"disc": "kept", "both": "failed", "gain": "done"}
    assert os.stat("out/disc/result.json").st_ino == before
    assert json.loads((tmp_path / "copy/out/gain/result.json").read_text())["method"] == "gls"
    assert os.listdir("out/both") == ["notes.txt"]
    assert sorted(name for name in os.listdir("out") if name.startswith(".")) == []


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('foo = 1\nexperiment = "e"\n[[job]]\nname = "a"\nruns = ["x"]', "unknown key foo"),
        ('[[job]]\nname = "a"\nruns = ["x"]\nexperimnt = "e"', "unknown key job[a].experimnt: did you mean experiment?"),
        ('[[job]]\nname = "a"\nruns = ["x"]', "missing key job[a].experiment: add it"),
        ('experiment = "e"\n[[job]]\nname = "a/b"\nruns = ["x"]', "job[a/b].name is 'a/b': write a name of at most 60"),
        ('experiment = "e"\n[[job]]\nname = "a"\nruns = []', "job[a].runs is []"),
        ('experiment = "e"\nmethod = "ols"\n[[job]]\nname = "a"\nruns = ["x"]', "method is 'ols': choose one of gls"),
        ('experiment = "e"\n[[job]]\nname = "a"\nruns = ["x"]\nexport = ["urd"]', "unknown export format 'urd': choose"),
        ('experiment = "e"' + '\n[[job]]\nname = "{}"\nruns = ["x"]' * 2, "two jobs named 'A': give each its own name"),
        ("job = []", "job is []: write a table [[job]]"),
        ("job", "not TOML"),
    ],
)  # fmt: skip
def test_a_mistake_in_the_file_is_a_line_before_any_work(text, message, tmp_path, capsys):
    path = tmp_path / "jobs.toml"
    path.write_text(text.replace("{}", "a", 1).replace("{}", "A"))
    assert main(["identify", "--jobs", str(path), "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err
    assert message in said
    assert said.startswith("error: ")
    assert said.count("\n") == 1
    assert not (tmp_path / "out").exists()
    with pytest.raises(ExperimentError):
        identify_jobs(path, tmp_path / "out")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ([], "--jobs has no folder: add --out DIR"),
        (["a.mcap", "--out", "x"], "RUN.mcap beside --jobs: write it in jobs.toml, or remove it"),
        (["--from", "1", "--out", "x"], "--from and --to beside --jobs: identify that body without --jobs"),
        (["--processes", "0", "--out", "x"], "--processes is 0: give 1 or more"),
    ],
)
def test_options_of_one_body_are_refused(options, message, capsys):
    assert main(["identify", "--jobs", "jobs.toml", *options]) == 2
    assert message in capsys.readouterr().err


def test_runs_and_experiment_are_needed_without_jobs(capsys):
    for options, message in (
        ([], "runs are missing"),
        (["a.mcap"], "--experiment is missing"),
        (["a.mcap", "--experiment", E, "--processes", "0"], "--processes is 0: give 1 or more"),
    ):
        assert main(["identify", *options]) == 2
        assert message in capsys.readouterr().err


def test_a_job_goes_before_what_is_said_of_all(tmp_path):
    (tmp_path / "jobs.toml").write_text(
        'experiment = "barreto2016"\nmethod = "gls"\ntare = ["empty/*.mcap"]\ncentre = "centre.json"\n'
        '[[job]]\nname = "a"\nruns = ["a.mcap"]\n'
        '[[job]]\nname = "b"\nruns = ["b.mcap"]\nmethod = "joint"\ntare = []\nexperiment = "e.toml"\n'
    )
    first, second = load_jobs(tmp_path / "jobs.toml")
    assert (first.experiment, first.method, first.tare) == ("barreto2016", "gls", (str(tmp_path / "empty/*.mcap"),))
    assert (second.experiment, second.method, second.tare) == (str(tmp_path / "e.toml"), "joint", ())
    assert first.centre == second.centre == str(tmp_path / "centre.json")


STAND_IN = """\
import os, pickle, sys, time
from uq.processes.messages import receive, send
while (message := receive(sys.stdin.buffer)) is not None:
    name = pickle.loads(message)[1].name
    if name == "dies":
        os.kill(os.getpid(), 9)
    if name == "fails":
        sys.exit("no more")
    if name == "sleeps":
        open(sys.argv[1], "w").write(str(os.getpid()))
        time.sleep(600)
    answer = {"status": "failed", "verdict": "failed", "line": f"{name} by {os.getpid()}", "note": ""}
    send(sys.stdout.buffer, pickle.dumps((answer, None)))
"""
"""A process that answers in place of one that identifies."""


@pytest.fixture
def stand_in(tmp_path, monkeypatch):
    """Put it there; return the function that gives jobs of these names to it."""
    started = lambda module, **pipes: start_python(STAND_IN, str(tmp_path / "pid"), **pipes)  # noqa: E731
    monkeypatch.setattr(process_pool, "start_module", started)

    def results(*names, processes=1):
        text = "".join(f'[[job]]\nname = "{name}"\nruns = ["x"]\n' for name in names)
        (tmp_path / "jobs.toml").write_text(f'experiment = "e"\n{text}')
        return identify_jobs(tmp_path / "jobs.toml", tmp_path / "out", processes=processes)

    return results


# Windows ends a process without a signal, whose number is what the line says
@pytest.mark.skipif(os.name == "nt", reason="no signals")
def test_a_process_that_dies_costs_its_job_alone(stand_in):
    lines = {result.name: result.line for result in stand_in("a", "dies", "b", "fails", "c")}
    assert lines["dies"].startswith("its process was ended by signal 9 (out of memory?")
    assert lines["fails"] == "its process ended with status 1 (no more)"
    by = [lines[name].partition(" by ")[2] for name in "abc"]
    assert len(set(by)) == 3  # another one after each that died


def test_whoever_stops_ends_all_processes(stand_in, tmp_path):
    results = stand_in("a", "sleeps", "b", processes=1)
    assert next(results).name == "a"
    deadline = time.monotonic() + 60
    while not (tmp_path / "pid").exists() and time.monotonic() < deadline:
        time.sleep(0.01)
    while not (pid := (tmp_path / "pid").read_text()):
        time.sleep(0.01)
    results.close()
    with pytest.raises(ProcessLookupError):
        os.kill(int(pid), 0)
    assert not (tmp_path / "out" / "summary.csv").exists()


def test_what_the_runs_contradict_is_kept_but_not_exported(night, tmp_path, monkeypatch):
    """The result stands, with its verdict; the line says why there is no export, also when the job is kept."""
    monkeypatch.setattr(Identification, "contradicted", property(lambda result: "axes are swapped"))
    job = next(job for job in load_jobs(night[0] / "jobs.toml") if job.name == "disc")
    went = work(job, tmp_path)
    assert (went["status"], went["verdict"]) == ("done", "contradicted")
    assert went["line"].startswith("not exported: axes are swapped")
    assert not (tmp_path / "disc" / "body.urdf").exists()
    assert json.loads((tmp_path / "disc" / "result.json").read_text())["status"] == "contradicted"
    assert work(job, tmp_path) == went | {"status": "kept"}
