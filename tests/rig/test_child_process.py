"""A recording in a folder where a stranger has put modules: no process that it starts runs them."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

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


def test_a_source_tree_that_is_the_working_folder_runs_its_own_code(tmp_path):
    """As ``python -m uq`` in a checkout: its packages are nowhere else, and another checkout comes first elsewhere."""
    tree, other = tmp_path / "tree", tmp_path / "other"
    for place in (tree, other):
        (place / "rig").mkdir(parents=True)
        (place / "rig" / "__init__.py").write_text("")
        (place / "rig" / "which.py").write_text(f"import sys\nprint({str(place)!r}, *sys.argv[1:])\n")
    (tree / "rig" / "child_process.py").write_text((ROOT / "rig" / "child_process.py").read_text())
    (tree / "rig" / "start.py").write_text(
        "import subprocess\nfrom rig.child_process import child_command\n"
        "subprocess.run(child_command('rig.which', 'a', '--b=1'), check=True)\n"
    )
    done, _ = run([sys.executable, "-m", "rig.start"], tree, PYTHONPATH=str(other))
    assert done.stdout.split() == [str(tree), "a", "--b=1"], done.stderr
