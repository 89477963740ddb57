"""Commands under faults of what is around them: memory, disk, home, streams, terminal, locale. One line or a result."""

import errno
import io
import logging
import os
import pwd
import subprocess
import sys

import pytest

from rig import runs
from rig.atomic_files import replacing
from tests.helpers.rig_lab import ramp_run
from uq.cli import inspect as inspect_command
from uq.cli.main import LEAST_MEMORY, main
from uq.cli.terminal.common import start_jax
from uq.files.compilation_cache import cache_folder
from uq.files.output_folder import place
from uq.monte_carlo.trials.checkpoint import Checkpoint

COMMAND = [sys.executable, "-m", "uq.cli.main"]


def in_shell(command, redirected="", *, first="", **options):
    """Exit status and standard error of a command whose streams a shell redirects, or whose limits it sets."""
    script = f'{first} exec "$@" {redirected}'
    done = subprocess.run(["sh", "-c", script, "sh", *COMMAND, *map(str, command)], capture_output=True, **options)
    return done.returncode, done.stderr.decode()


def test_no_standard_stream_is_needed_and_no_file_takes_its_place(tmp_path):
    ramp_run(tmp_path / "run.mcap", 0.2)
    assert in_shell(["recover", tmp_path / "run.mcap", "-o", tmp_path / "new.mcap"], "<&- >&- 2>&-") == (0, "")
    assert len(runs.read(tmp_path / "new.mcap").wrench.stamp) == 161
    assert in_shell(["inspect", "none.mcap"], "<&- >&- 2>&-", cwd=tmp_path) == (2, "")


def test_output_that_goes_to_a_full_disk_is_one_line():
    assert in_shell(["--help"], ">/dev/full") == (2, "error: No space left on device: free some space\n")


def test_a_disk_that_is_full_leaves_nothing_half_written_and_is_named(tmp_path, monkeypatch):
    def full(handle):
        raise OSError(errno.ENOSPC, "No space left on device")

    monkeypatch.setattr(os, "fsync", full)
    with pytest.raises(OSError, match="No space left") as report:
        place({"result.json": b"{}"}, tmp_path / "out")
    with pytest.raises(OSError, match="No space left") as run, replacing(tmp_path / "run.mcap") as file:
        file.write(b"x")
    assert (report.value.filename, run.value.filename) == (str(tmp_path / "out"), str(tmp_path / "run.mcap"))
    checkpoint = Checkpoint(tmp_path / "campaign" / "checkpoint")
    with pytest.raises(OSError, match="No space left") as campaign:
        checkpoint.open({"seed": 0})
    assert campaign.value.filename.endswith("campaign.json")
    checkpoint.close()
    assert [path.name for path in tmp_path.rglob("*")] == ["out"]


EXHAUSTED = [
    MemoryError("std::bad_alloc"),
    RuntimeError("RESOURCE_EXHAUSTED: Out of memory allocating 8000000000 bytes."),
    RuntimeError("can't start new thread"),
    ImportError("ft2font.so: failed to map segment from shared object"),
]


@pytest.mark.parametrize("error", EXHAUSTED, ids=lambda error: type(error).__name__)
def test_memory_that_is_not_there_is_one_line(error, monkeypatch, capsys):
    def run(arguments):
        raise error

    monkeypatch.setattr(inspect_command, "run", run)
    assert main(["inspect", "run.mcap"]) == 2
    assert capsys.readouterr().err.startswith("error: out of memory: give this process more (ulimit -v")


def test_another_error_is_not_taken_for_a_lack_of_memory(monkeypatch):
    def run(arguments):
        raise RuntimeError("a mistake of ours")

    monkeypatch.setattr(inspect_command, "run", run)
    with pytest.raises(RuntimeError, match="of ours"):
        main(["inspect", "run.mcap"])


def test_a_limit_under_which_jax_aborts_is_refused_before_it_is_loaded():
    status, said = in_shell(["montecarlo", "barreto2016"], first=f"ulimit -v {LEAST_MEMORY // 1024 - 1};")
    assert status == 2
    assert said == "error: this process may have 1.7 GiB of memory: raise the limit (ulimit -v) to 2 GiB or more\n"


def test_matplotlib_does_not_complain_of_a_home_that_cannot_be_written():
    start_jax()
    assert not logging.getLogger("matplotlib.font_manager").isEnabledFor(logging.WARNING)


def test_a_user_without_a_home_has_no_cache(monkeypatch):
    def nobody(number):
        raise KeyError(number)

    for name in ("HOME", "INERTIA_CACHE", "XDG_CACHE_HOME"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(pwd, "getpwuid", nobody)
    assert cache_folder() is None


def test_a_stream_in_ascii_loses_no_minus_and_no_column(monkeypatch):
    lines = ["trajectory  g·m²                 I11", "3σ          −28.3 ± 1.0  −2.0 … 7.3", "σ", "ñ₀́", "ᴴ漢"]
    with monkeypatch.context() as patch:
        patch.setattr(sys, "stdout", stream := io.TextIOWrapper(io.BytesIO(), encoding="ascii"))
        main(["--help"])
        stream.seek(0)
        stream.truncate()
        stream.write("\n".join(lines))
        stream.flush()
    shown = stream.buffer.getvalue().decode("ascii").splitlines()
    assert shown == [
        "trajectory  g*m^2                I11",
        "3sigma      -28.3 +-1.0  -2.0 ... 7.3",
        "sigma",
        "n0?",
        "H?",
    ]


def test_a_name_that_is_no_text_is_refused_at_once(capsys):
    assert main(["identify", os.fsdecode(b"run_\xe9.mcap"), "--experiment", "e.toml"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(r"error: no UTF-8 in the argument 'run_\udce9.mcap': rename the file")


def test_names_with_spaces_letters_and_line_feeds(tmp_path, capsys):
    path = tmp_path / "a run é\n漢.mcap"
    ramp_run(path, 0.2)
    assert main(["recover", str(path), "-o", f"{path} new"]) == 0
    assert main(["inspect", f"{path} new"]) in (0, 1)
    assert main(["inspect", f"{path} gone"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert r"a run é\n漢.mcap gone" in line
