"""The commands: what they write, and what they say of a user's mistake: one line, status 2, nothing half-written."""

import dataclasses
import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from identify.display.rounding import with_uncertainty
from rig import runs
from rig.channels import ImuChannel, WrenchChannel
from tests.helpers.commands import SHORT, refused
from uq.cli import main as cli
from uq.cli.main import main
from uq.experiment.experiment import Experiment
from uq.runs.identification.identify_files import identify_files

pytestmark = pytest.mark.usefixtures("undrawn")

ROOT = Path(__file__).parents[3]
N, RATE = 4000, 400


@pytest.fixture
def experiment(tmp_path):
    path = tmp_path / "e.toml"
    path.write_text(SHORT)
    return path


@pytest.fixture(scope="module")
def simulated(tmp_path_factory):
    folder = tmp_path_factory.mktemp("simulated")
    (folder / "e.toml").write_text(SHORT)
    assert main(["simulate", str(folder / "e.toml"), "-o", str(folder / "run.mcap")]) == 0
    return folder / "run.mcap"


@pytest.fixture
def run(tmp_path, simulated, capsys):
    capsys.readouterr()
    return shutil.copy(simulated, tmp_path / "run.mcap")


def channels(**changes):
    """A wrench and an IMU of a motion about all axes; ``changes`` replace fields of both, or of one by its prefix."""
    stamp = 10**9 + np.arange(N) * (10**9 // RATE)
    t = (stamp - stamp[0]) * 1e-9
    omega = 0.4 * np.sin(2 * np.pi * np.multiply.outer(t, [1.0, 1.2, 1.4]))
    wrench = WrenchChannel("/wrench", "body", stamp, stamp, 1 + 0.01 * omega, 0.1 * omega)
    imu = ImuChannel("/imu", "body", stamp, stamp, omega, np.ones((N, 3)))
    for name, value in changes.items():
        if name.startswith("wrench_"):
            wrench = dataclasses.replace(wrench, **{name.removeprefix("wrench_"): value})
        else:
            imu = dataclasses.replace(imu, **{name.removeprefix("imu_"): value})
    return wrench, imu


def broken_run(path, what):
    wrench, imu = channels()
    if what == "backwards":
        back = imu.stamp.copy()
        back[100:] -= 10**8
        wrench, imu = channels(imu_stamp=back)
    elif what == "no overlap":
        late = imu.stamp + 60 * 10**9
        wrench, imu = channels(imu_stamp=late, imu_log_time=late)
    elif what in ("dead gyro", "still"):
        noise = np.random.default_rng(1).normal(0, 1e-3, (N, 3))
        omega = noise if what == "still" else 0 * noise
        wrench, imu = channels(imu_angular_velocity=omega)
    elif what == "one sample":
        first = {f.name: getattr(imu, f.name) for f in dataclasses.fields(imu)}
        imu = ImuChannel(**{k: v[:1] if isinstance(v, np.ndarray) else v for k, v in first.items()})
    elif what == "no imu":
        imu = None
    elif what == "empty":
        first = {f.name: getattr(wrench, f.name) for f in dataclasses.fields(wrench)}
        wrench = WrenchChannel(**{k: v[:0] if isinstance(v, np.ndarray) else v for k, v in first.items()})
    runs.write(path, wrench=wrench, imu=imu, metadata={})
    if what == "cut":
        path.write_bytes(path.read_bytes()[:-2000])
    elif what == "not mcap":
        path.write_bytes(b"time,fx,fy,fz\n" * 100)


@pytest.mark.parametrize(
    ("what", "words"),
    [
        ("no overlap", "no overlap in run.mcap: the stamps of /wrench run from 1.000 s to"),
        ("still", "does not identify I11, I12, I13, I22, I23, I33: rotate about more axes"),
        (
            "dead gyro",  # reads exactly zero; or a run at rest that is simulated, which has no noise
            "is zero, or no number, in most samples: check the motion sensor and its driver, or record a body that",
        ),
        ("one sample", "fewer than two samples of the angular velocity in run.mcap"),
        ("no imu", "sensor_msgs/msg/Imu"),
        ("empty", "/wrench"),
        ("cut", "inertia recover"),
        ("not mcap", "not an MCAP"),
    ],
)
def test_a_run_that_cannot_be_used(tmp_path, experiment, capsys, what, words):
    path = tmp_path / "run.mcap"
    broken_run(path, what)
    before = path.read_bytes()
    out = tmp_path / "out"
    line = refused(capsys, "identify", path, "--experiment", experiment, "--out", out)
    assert words in line
    assert path.read_bytes() == before
    assert not out.exists()


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ("[body]", "[body]\nheight = 3", "unknown key body.height"),
        ('"19.7 kg"', '"19.7 m"', "body.mass is '19.7 m': write a unit of the same dimension as kg"),
        ('["0 mm", "0 mm", "53 mm"]', '["0 mm", "53 mm"]', "body.r_cg_from_q"),
        ('"0.69 N"', '"-0.69 N"', "source[F_bias].sigma[0] is '-0.69 N': write zero or more"),
        ("[body]", "[body", "not TOML"),
        ('r_cg_from_q = ["0 mm", "0 mm", "53 mm"]', "", "missing key body.r_cg_from_q"),
    ],
)
def test_an_experiment_that_cannot_be_used(tmp_path, run, experiment, capsys, old, new, words):
    assert old in SHORT
    experiment.write_text(SHORT.replace(old, new, 1))
    for command in (
        ("montecarlo", experiment, "--trials", 2),
        ("simulate", experiment, "-o", tmp_path / "new.mcap"),
        ("identify", run, "--experiment", experiment),
    ):
        line = refused(capsys, *command)
        assert words in line
        assert "e.toml" in line
    assert not (tmp_path / "new.mcap").exists()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("identify", "{dir}/no.mcap", "--experiment", "{e}"), "no.mcap"),
        (("identify", "{run}", "--experiment", "{dir}/no.toml"), "no.toml"),
        (("identify", "{run}", "{run}", "--experiment", "{e}"), "a run is given twice"),
        (("identify", "{run}", "--experiment", "{e}", "--estimator", "best"), "unknown estimator 'best'"),
        (("identify", "{run}"), "--experiment"),
        (("identify", "--experiment", "{e}"), "RUN.mcap"),
        (("identify", "{dir}/..", "--experiment", "{e}"), "no recording in the folder"),
        (("montecarlo", "{e}", "--trials", "0"), "0 trials: ask for one or more"),
        (("montecarlo", "{e}", "--trials", "-5"), "-5 trials: ask for one or more"),
        (("montecarlo", "{e}", "--trials", "1.5"), "'1.5' is not a whole number"),
        (("montecarlo", "{e}", "--seed", "x"), "'x' is not a whole number"),
        (("montecarlo", "{e}", "--seed", "9" * 30), "out of range"),
        (("montecarlo", "{e}", "--trajectory", "T9"), "unknown trajectory 'T9': choose one of T1, T2, T3, T4"),
        (("montecarlo", "{e}", "--estimator", "T9"), "unknown estimator 'T9'"),
        (("montecarlo", "{e}", "--dtype", "float16"), "float16"),
        (("montecarlo", "{e}", "--trials", "2", "--out", "{run}/out"), "out"),
        (("montecarlo", "barreto2015",), "barreto2015"),
        (("paper", "--trials", "0"), "0 trials: ask for one or more"),
        (("paper", "--trials", "2", "--out", "/proc/nowhere/out"), "/proc/nowhere"),
        (("simulate", "{e}", "-o", "{run}"), "run.mcap"),
        (("simulate", "{e}", "-o", "{dir}/none/new.mcap"), "none"),
        (("simulate", "{e}", "-o", "{dir}/new.mcap", "--trial", "-1"), "trial -1: give zero or more"),
        (("simulate", "{e}"), "-o"),
        (("weigh",), "unknown command 'weigh'"),
    ],
)  # fmt: skip
def test_arguments_that_cannot_be_used(tmp_path, experiment, run, capsys, arguments, words):
    filled = [a.format(dir=tmp_path, e=experiment, run=run) for a in arguments]
    before = sorted(tmp_path.iterdir())
    assert words in refused(capsys, *filled)
    assert sorted(tmp_path.iterdir()) == before


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_a_read_only_folder_is_refused(tmp_path, experiment, capsys):
    folder = tmp_path / "locked"
    folder.mkdir(mode=0o500)
    assert "locked" in refused(capsys, "montecarlo", experiment, "--trials", 2, "--out", folder)


@pytest.mark.slow
def test_simulate_then_identify(tmp_path, experiment, run, capsys):
    out = tmp_path / "out"
    assert main(["identify", str(run), "--experiment", str(experiment), "--out", str(out)]) == 0
    said = capsys.readouterr().out
    content = json.loads((out / "result.json").read_text())
    assert {"result.json", "report.html"} <= {path.name for path in out.iterdir()}
    assert content["inertia"]["I11"] == pytest.approx(0.3813, rel=0.05)
    assert f"{1e3 * content['inertia']['I11']:.0f}" in said
    used = {"file": str(run), "sha256": content["runs"][0]["sha256"], "made_up": "simulated"}
    assert content["provenance"]["inputs"] == [used]
    assert "no driver removed the body's weight" in " ".join(content["assumptions"])
    assert "on the body" not in " ".join(content["assumptions"])  # the run's metadata says so
    assert content["provenance"]["experiment"]["body"]["mass"] == "19.7 kg"


def test_what_a_run_says_of_its_wrench_is_not_overruled(tmp_path, experiment, run, capsys):
    experiment.write_text(SHORT.replace("[recording]", '[recording]\nwrench = "on_sensor"'))
    line = refused(capsys, "identify", run, "--experiment", experiment)
    assert "says that its wrench is on_body" in line
    assert "recording.wrench in the experiment says on_sensor" in line


def test_clocks_are_not_mixed(tmp_path, experiment):
    """Without stamps on one sensor, the log's times serve both: an IMU logged 80 ms late is not 80 ms late."""
    wrench, imu = channels()
    wrench = dataclasses.replace(wrench, stamp=wrench.stamp + 10**9)
    imu = dataclasses.replace(imu, stamp=0 * imu.stamp)
    runs.write(tmp_path / "run.mcap", wrench=wrench, imu=imu, metadata={})
    found = identify_files([tmp_path / "run.mcap"], Experiment.load(experiment))
    assert "no stamps in the headers of /imu" in " ".join(found.warnings)


def test_a_failed_command_leaves_no_folder(tmp_path, experiment, capsys):
    refused(capsys, "montecarlo", experiment, "--trials", 0, "--out", tmp_path / "deep" / "out")
    assert not (tmp_path / "deep").exists()


def test_help_names_every_command(capsys):
    assert main(["--help"]) == 0
    said = capsys.readouterr().out
    assert all(name in said for name in cli.COMMANDS)
    assert main([]) == 2


def test_packages_start_without_jax():
    """`inertia --help` and the rig never wait for JAX; the engine changes no global setting by being imported."""
    code = "import sys, uq, uq.cli.main, rig, rig.runs; assert 'jax' not in sys.modules, 'jax'"
    subprocess.run([sys.executable, "-c", code], check=True)
    code = "import identify, uq.monte_carlo.campaign.campaign, jax; assert not jax.config.jax_enable_x64"
    subprocess.run([sys.executable, "-c", code], check=True)


UNUSED = {
    "record": "jax numpy scipy serial",
    "import_": "optimistix equinox scipy.linalg scipy.special pint matplotlib jinja2 serial",
    "centre": "optimistix scipy.spatial scipy.stats scipy.signal pint matplotlib jinja2 serial",
    "identify": "optimistix scipy.stats pint matplotlib jinja2 serial uq.bodies.reference uq.bodies.export",
    "montecarlo": "optimistix scipy.stats pint matplotlib jinja2",
    "paper": "optimistix scipy.stats pint matplotlib jinja2",
    "design": "optimistix scipy.stats pint matplotlib jinja2",
}


def test_a_command_starts_without_what_few_of_its_calls_use():
    """One after the other in one process: what an earlier one loads is missing from the later ones' lists, too."""
    code = "import importlib, json, sys\nfor command, unused in json.loads(sys.argv[1]).items():\n"
    code += " importlib.import_module(f'uq.cli.{command}'); print(command, *set(unused.split()) & set(sys.modules))"
    loaded = subprocess.run(
        [sys.executable, "-c", code, json.dumps(UNUSED)], check=True, capture_output=True, text=True
    )
    assert loaded.stdout.split() == [*UNUSED]


@pytest.mark.parametrize(
    ("room", "slow"),
    [
        *((room, "ndimage|signal|stats") for room in ("identify", "uq/runs/recorded", "uq/runs/identification")),
        ("identify/judge", "interpolate|optimize|spatial"),
        ("uq/runs/identification", "interpolate|optimize|spatial"),
    ],
)
def test_nothing_that_identifies_uses_the_slow_parts_of_scipy(room, slow):
    """Each is loaded at the first use, two of them in half the time of `import jax`, a third one in a tenth."""
    sources = {path: path.read_text("utf-8") for path in (ROOT / room).rglob("*.py")}
    assert len(sources) >= 5
    assert [path for path, text in sources.items() if re.search(rf"(?<!jax\.)scipy\.({slow})\b", text)] == []


def test_python_looks_for_no_circles_when_a_command_has_ended():
    code = "import atexit, gc, uq.cli.main; atexit.register(lambda: print(len(gc.get_objects()), file=sys.stderr)); "
    code = f"import sys; {code} sys.exit(uq.cli.main.main())"
    ran = subprocess.run([sys.executable, "-c", code, "schema"], check=True, capture_output=True, text=True)
    assert int(ran.stderr) < 1000  # of those made since; ten thousands are there


def test_a_usual_experiment_is_read_without_the_library_of_units():
    """It takes longer than everything else that reads the file."""
    code = "import sys; from uq.experiment.experiment import Experiment; Experiment.load('barreto2016'); "
    code += "sys.exit('pint' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0


def test_xla_tells_no_user_that_it_compiles_slowly(monkeypatch, capsys):
    """Its alarm after two minutes is an error to XLA's log, which level 3 leaves out; who wants the log says so."""
    for stated, used in ((None, "3"), ("0", "0")):
        monkeypatch.delenv("TF_CPP_MIN_LOG_LEVEL", raising=False)
        if stated:
            monkeypatch.setenv("TF_CPP_MIN_LOG_LEVEL", stated)
        assert main(["schema", "map"]) == 0
        assert os.environ["TF_CPP_MIN_LOG_LEVEL"] == used
    capsys.readouterr()


def test_the_concise_notation_is_an_option_of_every_command(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("uq.cli.recover.run", lambda arguments: print(with_uncertainty(50000838.2, 31.7)) or 0)
    for options, printed in (([], "50000838 ± 32"), (["--concise"], "50000838(32)")):
        assert main(["recover", *options, "a.mcap", "-o", "b.mcap"]) == 0
        assert capsys.readouterr().out.strip() == printed
