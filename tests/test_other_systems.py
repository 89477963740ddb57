"""Systems without POSIX: its modules and functions are hidden from the packages, and the commands run."""

import builtins
import fcntl
import json
import os
import subprocess
import sys
import time
import tty
from importlib import resources
from pathlib import Path
from types import SimpleNamespace

import pytest
import serial

from rig.record import port, recording_file, session, terminal
from rig.record.rig_file import Rig
from uq.files.mistakes import ExperimentError
from uq.monte_carlo.trials.checkpoint import Checkpoint

ROOT = Path(__file__).parent.parent
HIDE = """
import builtins, ctypes, os, select, signal, subprocess, sys, types
real_import, real_library, real_fcntl = builtins.__import__, ctypes.CDLL, __import__("fcntl")
HIDDEN = {"fcntl", "termios", "tty", "pty", "resource", "pwd", "grp"}

def without_posix(name, globals=None, *rest, **more):
    importer = (globals or {}).get("__name__", "").partition(".")[0]
    if name.partition(".")[0] in HIDDEN and importer in ("uq", "identify", "rig"):
        raise ImportError(f"No module named {name!r}")  # libraries have their own ways for other systems
    return real_import(name, globals, *rest, **more)

def library(name, *rest, **more):
    if name is None:
        raise TypeError("argument of type 'NoneType' is not iterable")
    return real_library(name, *rest, **more)

builtins.__import__, ctypes.CDLL = without_posix, library
for module, names in ((os, "fork forkpty openpty sched_getaffinity tcgetpgrp getpgrp ttyname O_CLOEXEC O_NOCTTY"
                           " O_NONBLOCK getuid geteuid killpg setsid sysconf"),
                      (select, "poll epoll"), (signal, "SIGHUP SIGPIPE SIGKILL SIGUSR1")):
    for name in names.split():
        delattr(module, name)

def locking(handle, mode, count):
    real_fcntl.lockf(handle, real_fcntl.LOCK_EX | real_fcntl.LOCK_NB, count)

sys.modules["msvcrt"] = types.SimpleNamespace(locking=locking, LK_NBLCK=2)
"""
COMMANDS = """
import contextlib, importlib, io, json, pathlib, sys
root = pathlib.Path(sys.argv[2])
for package in ("rig", "identify", "uq"):
    for path in sorted((root / package).rglob("*.py")):
        name = ".".join(path.relative_to(root).with_suffix("").parts).removesuffix(".__init__")
        importlib.import_module(name)
from uq.cli.main import main

for arguments in json.loads(sys.argv[1]):
    said, complained = io.StringIO(), io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(complained):
        try:
            status = main(arguments)
        except SystemExit as end:
            status = end.code
    print(json.dumps([arguments[0], status, said.getvalue(), complained.getvalue()]))
"""


def without_posix(commands, folder):
    ran = subprocess.run(
        [sys.executable, "-c", HIDE + COMMANDS, commands, str(ROOT)],
        cwd=folder, env=os.environ | {"PYTHONPATH": str(ROOT)}, capture_output=True, text=True,
    )  # fmt: skip
    assert ran.returncode == 0, ran.stderr
    return ran.stdout


@pytest.mark.slow
def test_every_module_is_imported_and_the_commands_run(tmp_path):
    """All but emulated sensors, which need pseudo-terminals and say so."""
    (tmp_path / "rig.toml").write_text(
        '[[device]]\nname = "imu"\nkind = "vectornav"\nport = "emulator:run.mcap"\n'
        '[[device]]\nname = "cell"\nkind = "bota"\nwrench = "on_body"\nport = "emulator:run.mcap"\n'
    )
    preset = resources.files("uq").joinpath("presets", "barreto2016.toml").read_text("utf-8")
    (tmp_path / "e.toml").write_text(preset.replace("180 s", "6 s").replace("27 s", "0.9 s"))
    commands = [
        ["--version"],
        ["montecarlo", "e.toml", "--trajectory", "T1", "--estimator", "central", "--trials", "4", "--out", "out"],
        ["simulate", "e.toml", "--trajectory", "T1", "-o", "run.mcap"],
        ["inspect", "run.mcap"],
        ["identify", "run.mcap", "--experiment", "e.toml", "--estimator", "smoothed"],
        ["recover", "run.mcap", "-o", "again.mcap"],
        ["schema", "rig"],
        ["record", "--list"],
        ["record", "rig.toml", "-o", "recorded.mcap"],
    ]
    answers = [json.loads(line) for line in without_posix(json.dumps(commands), tmp_path).splitlines()]
    assert len(answers) == len(commands)
    for name, status, said, complaint in answers[:-1]:
        assert status == 0, (name, complaint)
        assert said
    _, status, _, complaint = answers[-1]
    assert status == 2
    assert complaint.startswith("error: no emulated sensors on this system")
    assert complaint.count("\n") == 1
    assert not (tmp_path / "recorded.mcap").exists()
    assert (tmp_path / "out" / "result.json").exists()
    assert not (tmp_path / "out" / "checkpoint").exists()


class Console:
    """A Windows console on which these keys are pressed."""

    def __init__(self, keys):
        self.keys = list(keys)

    def kbhit(self):
        return bool(self.keys)

    def getwch(self):
        return self.keys.pop(0)


def wait_for(happened):
    deadline = time.monotonic() + 30
    while not happened() and time.monotonic() < deadline:
        time.sleep(0.01)


def test_keys_of_a_console_are_marks(monkeypatch):
    """An arrow key sends two characters, none of which is a mark."""
    monkeypatch.setattr(terminal, "POSIX", False)
    monkeypatch.setattr(os, "isatty", lambda handle: True)
    monkeypatch.setitem(sys.modules, "msvcrt", Console("a\xe0Hb"))
    heard = []
    with terminal.Keys(sys.__stdin__, heard.append):
        wait_for(lambda: len(heard) == 2)
    assert heard == ["a", "b"]


def test_lines_of_a_pipe_that_cannot_be_waited_for_are_marks(monkeypatch):
    monkeypatch.setattr(terminal, "POSIX", False)
    monkeypatch.setattr(terminal.select, "select", None)
    reader, writer = os.pipe()
    os.write(writer, "start\nσ\n".encode())
    os.close(writer)
    heard = []
    with os.fdopen(reader) as stream, terminal.Keys(stream, heard.append):
        wait_for(lambda: len(heard) == 2)
    assert heard == ["start", "σ"]


def test_a_port_without_a_descriptor_gives_what_has_come(monkeypatch):
    master, slave = os.openpty()
    tty.setraw(slave)
    line = port.SerialPort(os.ttyname(slave), 115200)
    monkeypatch.setattr(line, "_has_descriptor", False)
    monkeypatch.setattr(port, "select", None)
    assert line.read() == b""
    os.write(master, b"frame")
    wait_for(lambda: line._port.in_waiting == 5)
    assert line.read() == b"frame"
    line.close()
    with pytest.raises(port.PortLostError):
        line.read()
    os.close(slave)
    os.close(master)


@pytest.mark.parametrize(
    ("said", "complaint"),
    [("PermissionError(13, 'Access is denied.', None, 5)", "port busy COM3"),
     ("FileNotFoundError(2, 'The system cannot find the file specified.', None, 2)", "no port COM3")],
)  # fmt: skip
def test_why_a_port_of_windows_cannot_be_opened(monkeypatch, said, complaint):
    """As pyserial words it there, without a number."""

    def refuse(*_, **__):
        raise serial.SerialException(f"could not open port 'COM3': {said}")

    monkeypatch.setattr(port, "_Line", refuse)
    with pytest.raises(port.RigError, match=complaint):
        port.open_port("COM3", 115200)


def test_an_open_file_that_cannot_be_deleted_goes_when_it_is_closed(tmp_path, monkeypatch):
    unlink, sink = os.unlink, recording_file.Sink(tmp_path / "run.mcap")

    def refuse(path):
        raise PermissionError(13, "used by another process")

    monkeypatch.setattr(os, "unlink", refuse)
    sink.remove()
    monkeypatch.setattr(os, "unlink", unlink)
    assert sink.path.exists()
    sink.close()
    assert not sink.path.exists()


def test_a_clock_of_coarse_steps_is_a_warning(tmp_path, monkeypatch):
    """Windows before Python 3.13; here it steps by nanoseconds."""
    quiet = session.Session(Rig(tmp_path / "rig.toml", ()))
    assert quiet.warnings == []
    monkeypatch.setattr(time, "get_clock_info", lambda name: SimpleNamespace(resolution=1 / 64))
    assert quiet.warnings == ["the clock steps by 16 ms: Python 3.13 or newer has a better one"]


def test_a_campaign_is_locked_without_fcntl(tmp_path, monkeypatch):
    """Two open files of one process exclude each other by flock only, which stands here for the lock of Windows."""
    real_import = builtins.__import__

    def no_fcntl(name, *rest, **more):
        if name == "fcntl":
            raise ImportError(name)
        return real_import(name, *rest, **more)

    def locking(handle, mode, count):
        assert (mode, count) == (2, 1)
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)

    monkeypatch.setitem(sys.modules, "msvcrt", SimpleNamespace(locking=locking, LK_NBLCK=2))
    monkeypatch.setattr(builtins, "__import__", no_fcntl)
    first, second = Checkpoint(tmp_path / "c"), Checkpoint(tmp_path / "c")
    first.open({"seed": 1})
    with pytest.raises(ExperimentError, match="another campaign writes in"):
        second.open({"seed": 1})
    first.close()
    second.open({"seed": 1})
    second.close()
