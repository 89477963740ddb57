"""A working folder where a stranger has put modules and programs: no process that a command starts runs them."""

import ast
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from rig.child_process import start_program
from rig.mcap.message_definitions import IMU
from tests.helpers.rig_lab import ramp_file

ROOT = Path(__file__).parents[2]
NAMES = ("json", "numpy", "socket", "jax", "mcap", "identify", "uq", "rig")
"""Of the standard library, of other packages, and of another checkout."""
HOSTILE = 'import os, pathlib\npathlib.Path(os.environ["WITNESS"]).open("a").write(__file__ + "\\n")\n'
RIG = """
[[device]]
name = "imu"
kind = "xsens"
port = "emulator:ramp.mcap"
"""


@pytest.fixture
def folder(tmp_path):
    """A working folder with a module of every name, which leaves a witness when it runs."""
    work = tmp_path / "work"
    work.mkdir()
    for name in NAMES:
        if name in ("identify", "uq", "rig"):
            (work / name).mkdir()
        (work / (f"{name}/__init__.py" if (work / name).is_dir() else f"{name}.py")).write_text(HOSTILE)
    return work


def run(command, folder, **environment):
    """What a command prints, and which of the folder's modules ran."""
    witness = folder.parent / "witness"
    environment = {**os.environ, "WITNESS": str(witness), **environment}
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, timeout=120)
    return done, witness.read_text() if witness.exists() else ""


@pytest.mark.skipif(not hasattr(os, "openpty"), reason="no pseudo-terminals for emulated sensors")
@pytest.mark.parametrize("more", [(), ("--identify", "e.toml")], ids=["emulator", "identify"])
def test_a_recording_runs_no_module_of_the_working_folder(folder, more):
    (folder / "ramp.mcap").write_bytes(ramp_file(2.0))
    (folder / "rig.toml").write_text(RIG)
    (folder / "e.toml").write_text((ROOT / "uq/examples/t1-10s.toml").read_text())
    inertia = [sys.executable, "-P", "-m", "uq", "record", "rig.toml", "-o", "run.mcap", "--seconds", "0.2", *more]
    done, ran = run(inertia, folder, PYTHONPATH=str(ROOT))
    assert ran == ""
    if more:  # the rig has no load cell, which the second process says once it has loaded everything
        assert (done.returncode, done.stderr.startswith("error: ")) == (2, True)
        assert "did not start" not in done.stderr
    else:
        assert done.returncode == 0, done.stderr
        assert IMU.encode() in (folder / "run.mcap").read_bytes()


def test_a_trial_of_jax_flags_runs_no_module_of_the_working_folder(folder):
    """XLA ends a process that has a flag which it does not know; another process tries them."""
    inertia = [sys.executable, "-P", "-m", "uq", "plan", "nothing.toml"]
    done, ran = run(inertia, folder, PYTHONPATH=str(ROOT), XLA_FLAGS="--xla_cpu_enable_fast_math=false")
    assert (ran, done.returncode, done.stderr.count("\n")) == ("", 2, 1)
    assert "nothing.toml" in done.stderr


@pytest.mark.skipif(os.name == "nt", reason="a shell script")
@pytest.mark.parametrize("path", [".", "", "bin"])
def test_a_program_of_the_working_folder_is_not_run(tmp_path, monkeypatch, path):
    """Where ``PATH`` names a folder from the working folder on, or that itself."""
    monkeypatch.chdir(tmp_path)
    program = tmp_path / path / "git"
    program.parent.mkdir(exist_ok=True)
    program.write_text("#!/bin/sh\nexit 7\n")
    program.chmod(0o755)
    monkeypatch.setenv("PATH", path)
    with pytest.raises(FileNotFoundError, match="no program git"):
        start_program("git")
    monkeypatch.setenv("PATH", os.pathsep.join([path, str(program.parent)]))
    assert start_program("git").wait() == 7


STARTERS = {
    "os": re.compile("fork|forkpty|exec[lv].*|spawn.*|posix_spawnp?|system|popen|startfile"),
    "subprocess": re.compile("(?!PIPE$|DEVNULL$|STDOUT$|TimeoutExpired$|CalledProcessError$).*"),
    **dict.fromkeys(("multiprocessing", "pty", "webbrowser", "_posixsubprocess", "_winapi"), re.compile(".*")),
    "concurrent.futures": re.compile("ProcessPool.*"),
    "concurrent.futures.process": re.compile(".*"),
    "asyncio": re.compile("create_subprocess.*|subprocess"),
}
"""What starts a process, by module."""
STARTED = {
    ("rig/child_process.py", "subprocess.Popen"),  # the working folder is no place for its code
}


def starters(source):
    """What a module has of STARTERS; a name under which one of those modules is imported is what it stands for."""
    names = {}
    for node in ast.walk(tree := ast.parse(source)):
        if isinstance(node, ast.Import):
            names |= {alias.asname or alias.name: alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and node.module:
            names |= {alias.asname or alias.name: f"{node.module}.{alias.name}" for alias in node.names}
    used = set(names.values())
    for node in ast.walk(tree):
        if isinstance(node, ast.Attribute):
            owner = ast.unparse(node.value)
            used.add(f"{names.get(owner, owner)}.{node.attr}")
    for text in sorted(used):
        module, _, name = text.rpartition(".")
        if (known := STARTERS.get(module)) and known.fullmatch(name):
            yield text
        elif text != "subprocess" and text in STARTERS and STARTERS[text].fullmatch("anything"):
            yield text  # of subprocess, constants are of use beside a process that is started elsewhere


@pytest.mark.parametrize(
    ("source", "seen"),
    [
        ("import subprocess\nsubprocess.run([])\nsubprocess.PIPE", ["subprocess.run"]),
        ("import subprocess as s\ns.Popen([])", ["subprocess.Popen"]),
        ("from subprocess import PIPE, check_output", ["subprocess.check_output"]),
        ("from os import execv as go", ["os.execv"]),
        ("import os\nos.path.join('a')\nos.system('a')", ["os.system"]),
        ("import multiprocessing", ["multiprocessing"]),
        ("from multiprocessing import Pool", ["multiprocessing.Pool"]),
        ("import concurrent.futures\nconcurrent.futures.ProcessPoolExecutor()", ["concurrent.futures.ProcessPoolExecutor"]),
        ("from concurrent.futures import ThreadPoolExecutor", []),
        ("import asyncio\nasyncio.create_subprocess_exec", ["asyncio.create_subprocess_exec"]),
    ],
)  # fmt: skip
def test_what_starts_a_process_is_seen(source, seen):
    assert list(starters(source)) == seen


def test_every_process_is_started_in_one_place():
    """A new one goes through rig/child_process.py."""
    places = {
        (path.relative_to(ROOT).as_posix(), text)
        for package in ("identify", "rig", "uq")
        for path in (ROOT / package).rglob("*.py")
        for text in starters(path.read_text("utf-8"))
    }
    assert places == STARTED


def test_a_source_tree_that_is_the_working_folder_runs_its_own_code(tmp_path):
    """As ``python -m uq`` in a checkout: its packages are nowhere else, and another checkout comes first elsewhere."""
    tree, other = tmp_path / "tree", tmp_path / "other"
    for place in (tree, other):
        (place / "rig").mkdir(parents=True)
        (place / "rig" / "__init__.py").write_text("")
        (place / "rig" / "which.py").write_text(f"import sys\nprint({str(place)!r}, *sys.argv[1:])\n")
    (tree / "rig" / "child_process.py").write_text((ROOT / "rig" / "child_process.py").read_text())
    (tree / "rig" / "start.py").write_text(
        "from rig.child_process import start_module\nassert start_module('rig.which', 'a', '--b=1').wait() == 0\n"
    )
    done, _ = run([sys.executable, "-m", "rig.start"], tree, PYTHONPATH=str(other))
    assert done.stdout.split() == [str(tree), "a", "--b=1"], done.stderr
