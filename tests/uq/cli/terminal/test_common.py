"""What a command writes depends on what it is asked alone."""

import io
import os
import subprocess
import sys
import tempfile

import matplotlib
import pytest

from tests.helpers.small_campaign import campaign
from uq.cli.terminal.common import finish, output_folder
from uq.report.report_files import files


def test_figures_of_a_command_follow_no_settings_of_the_working_folder(tmp_path):
    """A matplotlibrc there sets what is set here; in Python, the figures follow it."""
    result = campaign("T1")
    finish(result, tmp_path / "plain")
    with matplotlib.rc_context({"savefig.dpi": 1, "axes.facecolor": "red", "figure.constrained_layout.use": True}):
        finish(result, tmp_path / "folder")
        figures = files(result)
    plain, folder = (
        {path.name: path.read_bytes() for path in (tmp_path / name).iterdir()} for name in ("plain", "folder")
    )
    assert folder == plain
    assert figures["breakdown-T1-central.svg"] != plain["breakdown-T1-central.svg"]


def test_files_are_written_before_anything_is_printed(tmp_path, monkeypatch):
    """Whoever reads may have enough, as with `| head`."""

    class Closed(io.StringIO):
        def write(self, text):
            raise BrokenPipeError

    monkeypatch.setattr(sys, "stdout", Closed())
    with pytest.raises(BrokenPipeError):
        finish(campaign("T1"), tmp_path)
    assert {"result.json", "report.html"} <= {path.name for path in tmp_path.iterdir()}


def test_a_full_disk_is_noticed_before_the_work(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "TemporaryFile", lambda dir: open("/dev/full", "wb", buffering=0))  # noqa: SIM115
    with pytest.raises(OSError, match="No space left"), output_folder(str(tmp_path / "out")):
        raise AssertionError("the work begins")
    assert not (tmp_path / "out").exists()


def test_a_backend_of_matplotlib_that_there_is_not_is_one_line(tmp_path):
    """Refused before any work, where figures are asked for."""
    command = [sys.executable, "-m", "uq.cli.main", "paper", "--trials", "2", "--out", str(tmp_path / "out")]
    done = subprocess.run(command, capture_output=True, text=True, env=os.environ | {"MPLBACKEND": "nonsense"})
    line = "error: matplotlib does not know the backend 'nonsense': unset MPLBACKEND, or set it to agg\n"
    assert (done.returncode, done.stdout, done.stderr) == (2, "", line)
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize(("name", "value"), [("JAX_PLATFORMS", "nonsense"), ("XLA_FLAGS", "--nonsense=1")])
def test_a_setting_of_jax_that_cannot_be_is_one_line(name, value):
    command = [sys.executable, "-m", "uq.cli.main", "plan", "barreto2016"]
    done = subprocess.run(command, capture_output=True, text=True, env=os.environ | {name: value})
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert name in done.stderr
    assert value in done.stderr
