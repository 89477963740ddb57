"""The examples of docs/how-to/extending.md: a package that has the files and their entry points, used as the page shows."""

import importlib
import os
import pkgutil
import re
import shutil
import subprocess
import sys
import tomllib
from dataclasses import replace
from importlib.metadata import entry_points
from pathlib import Path

import numpy as np
import pytest

from identify.judge import judged_result, run_findings
from rig.record.port import converse
from tests.helpers import operating_curves
from tests.helpers.laboratory import measure
from tests.helpers.laboratory_runs import identified
from uq.cli.main import main
from uq.experiment.experiment import Experiment
from uq.monte_carlo.campaign.simulation import simulate
from uq.sources.source import KINDS

ROOT = Path(__file__).parents[1]
PAGE = ROOT / "docs" / "how-to" / "extending.md"
USE = re.compile(r"```(python|toml)\n(.*?)```", re.S)
GROUPS = {
    "sources": "uq.sources.kinds",
    "devices": "rig.devices",
    "exports": "uq.bodies.export_formats",
    "motions": "uq.plan.motion_design.motion_formats",
    "methods": "identify.estimation.methods",
}
"""Rooms of what the entry points of each group name."""
NOT_NAMED = {"base", "checksums", "conversation", "parser"}
"""Modules of these rooms that several others share."""


def section(title):
    """The experiment files of a section by the name of their source, and its scripts in order."""
    blocks = USE.findall(PAGE.read_text("utf-8").split(f"## {title}\n")[1].split("\n## ")[0])
    sources = {re.search(r'name = "(\w+)"', block)[1].upper(): block for kind, block in blocks if kind == "toml"}
    return sources, [block for kind, block in blocks if kind == "python"]


def describe(folder, distribution, named):
    """Write the metadata of an installed distribution with entry points."""
    described = folder / f"{distribution}-1.0.dist-info"
    described.mkdir()
    (described / "METADATA").write_text(f"Name: {distribution}\nVersion: 1.0\n")
    lines = [
        f"[{group}]\n" + "".join(f"{name} = {value}\n" for name, value in names.items())
        for group, names in named.items()
    ]
    (described / "entry_points.txt").write_text("".join(lines))


@pytest.fixture
def extended(tmp_path, monkeypatch):
    """The page's package as if it were installed, for the length of a test."""
    kinds, (_, project) = dict(KINDS), USE.search(PAGE.read_text("utf-8")).groups()
    describe(tmp_path, "my_rig", tomllib.loads(project)["project"]["entry-points"])
    shutil.copytree(PAGE.parents[1] / "extensions", tmp_path / "my_rig")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.chdir(ROOT / "uq" / "examples")
    for group, room in GROUPS.items():
        monkeypatch.setattr(importlib.import_module(room), "ENTRIES", entry_points(group=f"inertia_uq.{group}"))
    entry_points(group="inertia_uq.sources")["thermal_zero"].load()
    yield
    for module in [name for name in sys.modules if name.partition(".")[0] == "my_rig"]:
        del sys.modules[module]
    KINDS.clear()
    KINDS.update(kinds)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("acme", "error: 'acme' in inertia_uq.devices, of strange, does not load (ModuleNotFoundError: "),
        ("bota", "error: strange and inertia-uq both name 'bota' in inertia_uq.devices: uninstall or rename one"),
    ],
)
def test_an_extension_that_cannot_be_used_is_named_in_one_line(name, words, tmp_path, monkeypatch, capsys):
    describe(tmp_path, "strange", {"inertia_uq.devices": {name: "there_is_no_such_module:Acme"}})
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setattr("rig.devices.ENTRIES", entry_points(group="inertia_uq.devices"))
    rig = tmp_path / "rig.toml"
    rig.write_text(f'[[device]]\nname = "a"\nkind = "{name}"\nport = "/dev/null"\n')
    assert main(["record", str(rig), "-o", str(tmp_path / "run.mcap")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(words)
    assert len(line) < 200


def test_two_methods_of_one_name_stop_no_recording(tmp_path, monkeypatch, capsys):
    describe(tmp_path, "strange", {"inertia_uq.methods": {"gls": "there_is_no_such_module:Gls"}})
    monkeypatch.syspath_prepend(tmp_path)
    for command, words in (
        ("record", "error: no output given"),
        ("inspect", "error: strange and inertia-uq both name 'gls'"),
    ):
        assert main([command, str(tmp_path / "none.toml")]) == 2
        assert capsys.readouterr().err.startswith(words)


@pytest.mark.parametrize(("group", "room"), GROUPS.items())
def test_every_file_of_ours_is_an_entry_point(group, room):
    modules = {module.name for module in pkgutil.iter_modules(importlib.import_module(room).__path__)} - NOT_NAMED
    entries = entry_points(group=f"inertia_uq.{group}")
    assert {entry.module for entry in entries} == {f"{room}.{module}" for module in modules}
    assert {entry.name.replace("-", "_") for entry in entries} == modules
    assert len(entries) == len(modules)


def run(scripts, names):
    names = {"__name__": "extending", **names}
    for script in scripts:
        exec(compile(script, str(PAGE), "exec"), names)
    return names


def test_a_new_kind_of_error_source_is_read_and_drawn(extended):
    """It changes the moment alone, by a constant that each trial draws anew."""
    sources, _ = section("A new kind of error source")
    text = (ROOT / "uq" / "examples" / "t1-10s.toml").read_text("utf-8") + sources["M_TEMPERATURE"]
    experiment = Experiment.from_dict(tomllib.loads(text))
    (new,) = (source for source in experiment.sources if source.name == "M_temperature")
    first, other = (simulate(replace(experiment, sources=(new,), mixing=()), trial=trial).run for trial in (0, 1))
    np.testing.assert_array_equal(first.force, other.force)
    shift = (first.moment - other.moment).mean(axis=0)
    np.testing.assert_allclose(first.moment - other.moment, np.broadcast_to(shift, first.moment.shape), atol=1e-12)
    assert (np.abs(shift) > 1e-4).all()
    assert (np.abs(shift) < 5 * np.sqrt(2) * 8e-3).all()  # 0.001 N·m/K at 8 K


@pytest.mark.slow  # kinds of the program by both engines: monte_carlo/campaign/test_campaign.py
def test_a_new_kind_of_error_source(extended):
    sources, scripts = section("A new kind of error source")
    names = run(scripts, sources)
    # 200 trials tell a 3σ within 5 %: 1e-4 false alarms in six components at 4.2 of these
    np.testing.assert_allclose(names["monte_carlo"], names["by_law"], rtol=0.21)
    assert (names["by_law"] > 0).all()


WARMED = """
from dataclasses import replace

import jax
import numpy as np

from identify.estimation.joint.priors import ConstantError
from tests.helpers.laboratory import measure
from tests.helpers.laboratory_files import document
from tests.helpers.laboratory_runs import identified, run_of
from identify import EstimatorSpec, ordinary_least_squares
from uq import law, montecarlo, simulate
from uq.experiment.experiment import Experiment
from uq.files.mistakes import ExperimentError
from uq.runs.identification.estimated_errors import estimated_errors
from uq.runs.identification.systematic_errors import with_declared_sources
from uq.runs.identification.undeclared import with_undeclared

jax.config.update("jax_enable_x64", True)
clean = measure(3, seconds=15.0)
since = (clean.t_imu - clean.t_imu[0])[:, None] / (clean.t_imu[-1] - clean.t_imu[0])
warm = replace(clean, omega=clean.omega * (1 + 0.02 * since))
named = identified(warm)
print(*named.warnings, *(cause.docs for cause in named.consistency), sep="\\n")
table = {"undeclared": {"gyro_warming": "0.1 %"}}
plain = with_undeclared(identified(clean), [run_of(clean)], Experiment.from_dict(document(clean) | table))
(effect,) = (row for row in plain.undeclared.rows if row.error == "gyro_warming")
off = identified(replace(clean, omega=clean.omega * (1 + 1e-3 * since))).inertia - identified(clean).inertia
print(effect.text, effect.figure, bool(abs(effect.parameters[9] / off[5] + 1) < 0.1))
errors = {"gyro_warming": ConstantError("gyro_warming", np.zeros(3), 0.02**2 * np.eye(3))}
joint = identified(warm, "joint", errors=errors)
source = {"name": "warming", "target": "omega", "kind": "warming", "sigma": "2 %", "group": "imu"}
content = document(clean)
content["source"] = [*content["source"], source]
declared = Experiment.from_dict(content)
(prior,) = [error for name, error in estimated_errors(declared, 15.0).items() if name == "warming"]
known = with_undeclared(with_declared_sources(identified(clean), [run_of(clean)], declared, trials=500), [run_of(clean)], declared)
ratio = known.contributions["warming"][5] / (20 * abs(effect.parameters[9]))
told = "gyro_warming" in [row.error for row in known.undeclared.rows]
brief = Experiment.load("uq/examples/t1-10s.toml")
drawn = Experiment.from_dict(dict(brief.document) | {"source": [source]})
trials = montecarlo(drawn, trials=200, estimators="central")["T1", "central"].total.three_sigma
simulated = simulate(replace(brief, sources=(), mixing=())).run
since = (simulated.t / simulated.t[-1])[:, None]
estimate = jax.jit(lambda omega: ordinary_least_squares(
    simulated.force, simulated.moment, omega, rate=simulated.rate, r_cg=brief.body.r_cg_from_q,
    estimator=EstimatorSpec("central", "central"), offsets="none",
))
by_axis = [estimate(simulated.omega * (1 + 0.02 * since * axis)) - estimate(simulated.omega) for axis in np.eye(3)]
ratios = trials / (3 * np.linalg.norm(by_axis, axis=0))
scored = simulate(drawn).run.omega - simulated.omega
print(*np.round([ratios.min(), ratios.max(), scored[0].any(), abs(scored[-1]).max() > 0], 2))
try:
    law(drawn)
except ExperimentError as error:
    refused = str(error)
print(prior.unknown, prior.covariance[0, 0] == 0.02**2, round(ratio, 1), told, refused)
far = np.abs(joint.inertia - clean.truth) / joint.standard_uncertainty
print(joint.consistency, bool((far < 3).all()), "gyro_warming" in joint.contributions)
"""


def test_a_new_error_of_the_rig(tmp_path):
    """One file and one line in a copy of the program: it is named, counted while undeclared, drawn, estimated and printed."""
    for package in ("identify", "rig", "tests", "uq"):
        shutil.copytree(ROOT / package, tmp_path / package)  # compiled, too
    shutil.copy(PAGE.parents[1] / "extensions" / "gyro_warming.py", tmp_path / "identify" / "errors" / "imu")
    registry = tmp_path / "identify" / "errors" / "registry.py"
    text = registry.read_text("utf-8").replace("ERRORS:", f"{IMPORTED}\n\nERRORS:", 1)
    registry.write_text(text.replace(" GYRO_SCALE, ", " GYRO_SCALE, GYRO_WARMING, ", 1), "utf-8")
    environment = os.environ | {"PYTHONPATH": str(tmp_path)}
    ran = subprocess.run([sys.executable, "-c", WARMED], env=environment, capture_output=True, text=True, cwd=tmp_path)
    assert ran.returncode == 0, ran.stderr
    warning, docs, undeclared, drawn, declared, estimated = ran.stdout.splitlines()
    found = re.search(r"changed by \(([\d.]+) ± \S+, ([\d.]+) ± \S+, ([\d.]+) ± \S+\) % over the run", warning).groups()
    np.testing.assert_allclose([float(value) for value in found], 2, atol=0.15)
    assert docs == "docs/explanation/troubles.md#gyro-warming"
    assert undeclared == "warming of the gyro 0.1 % True"
    assert estimated == "() True True"
    least, largest, *scored = map(float, drawn.split())  # 200 trials tell a 3σ within 5 %, as above
    assert 0.79 < least < largest < 1.21
    assert scored == [0, 1]
    assert declared == (
        "gyro_warming True 1.0 False the law does not take: 'warming' changes every sample; leave out (--without "
        "warming), or use the Monte Carlo"
    )


IMPORTED = "from identify.errors.imu.gyro_warming import GYRO_WARMING"


class Wire:
    """A port whose other end is the emulator."""

    def __init__(self, sensor):
        self.sensor, self.answer = sensor, b""

    def write(self, data):
        self.answer += self.sensor.receive(data)

    def read(self):
        answer, self.answer = self.answer, b""
        return answer


def test_a_new_device(extended):
    _, scripts = section("A new device")
    names = run(scripts, {})
    assert converse(names["device"].start(), Wire(names["sensor"])).model == "ACME 6"
    assert names["sensor"].streaming
    assert [s.number for s in names["samples"]] == [0, 1, 3, 4]
    assert all(s.values == (1.0, 2.0, 3.0, 0.5, 0.25, 0.125) for s in names["samples"])
    assert (names["parser"].counts.missing, names["parser"].counts.skipped) == (1, len(b"noise"))


def test_a_new_export_format(extended, tmp_path):
    _, scripts = section("A new export format")
    exported = run(scripts, {})["exported"]
    exported.write(tmp_path)
    text = (tmp_path / "body.m").read_text("utf-8")
    assert text.startswith("% Written by inertia-uq.")
    rows = re.search(r"inertia = \[(.*)\];", text)[1].split(";")
    np.testing.assert_array_equal([np.fromstring(row, sep=" ") for row in rows], np.diag([0.3813, 0.0185, 0.3791]))
    assert set(exported.to_dict()) == {"matlab", "urdf"}


def test_a_new_estimator(extended):
    _, scripts = section("A new estimator")
    names = run(scripts, {"Experiment": Experiment})
    off = {how: np.abs(names[f"by_{how}"].inertia - names["quiet"].inertia) for how in ("mean", "median")}
    moments = [0, 3, 5]
    assert (off["median"][moments] < 0.3 * off["mean"][moments]).all()
    assert (off["median"] < 4 * np.sqrt(np.diag(names["by_median"].covariance))).all()
    assert names["by_median"].method == "median_of_runs"


def test_a_new_finding(monkeypatch, tmp_path):
    """One file in the room of findings, and one line where runs are judged; page and row of the docs follow."""
    shutil.copy(PAGE.parents[1] / "extensions" / "resolution.py", tmp_path)
    monkeypatch.setattr(run_findings, "__path__", [*run_findings.__path__, str(tmp_path)])
    resolution = importlib.import_module("identify.judge.run_findings.resolution")
    try:
        monkeypatch.setattr(judged_result, "SIGNAL_CHECKS", (*judged_result.SIGNAL_CHECKS, resolution.coarse))
        measured = measure(1, seconds=10.0)
        coarse = identified(replace(measured, omega=np.round(measured.omega, 0)))
        verdict = next(verdict for verdict in coarse.consistency if verdict.cause == "resolution")
        assert verdict.docs == "docs/explanation/troubles.md#resolution"
        assert re.search(r": the omega on b\d has only \d+ steps over its range \(resolution\); choose a", verdict.text)
        assert verdict.text in coarse.warnings
        assert "resolution" not in {verdict.cause for verdict in identified(measured).consistency}
        page = operating_curves.pages()[operating_curves.PAGES / "resolution.md"]
        assert (
            "the force on b3 has only 12 steps over its range (resolution); choose a smaller range of the sensor"
            in page
        )
        row = (
            "[`resolution`](findings/resolution.md) | the resolution of a sensor is coarse: a channel has few different"
        )
        assert f'<a id="resolution"></a>{row}' in operating_curves.page_with_findings()
    finally:
        del sys.modules["identify.judge.run_findings.resolution"]
