"""``inertia record`` at serial ports: what it watches, lists and refuses; it starts without JAX."""

import io
import json
import os
import re
import subprocess
import sys

import pytest

from rig.inspection.inspect import inspect
from rig.record.recorder import Progress, Summary
from rig.record.terminal import Terminal
from tests.helpers.emulated_rig import emulated_rig
from tests.helpers.rig_lab import Bench
from uq.cli.main import BROKEN_PIPE, main
from uq.cli.record import summary_lines


@pytest.fixture
def emulated(tmp_path):
    return emulated_rig(tmp_path)


def test_watch_shows_rates_force_and_gravity_and_writes_nothing(emulated, tmp_path):
    before = sorted(tmp_path.iterdir())
    done = subprocess.run(
        [sys.executable, "-m", "uq.cli.main", "record", str(emulated), "--watch", "--seconds", "2.3"],
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert done.returncode == 0
    assert sorted(tmp_path.iterdir()) == before
    rates = [float(rate) for rate in re.findall(r"^cell: (\d+) Hz", done.stdout, re.MULTILINE)]
    assert rates, done.stdout
    assert all(700 < rate < 900 for rate in rates), rates  # 800 Hz, on a machine that may be busy
    assert "gravity" in done.stdout


def test_a_recording_goes_on_when_nobody_reads_its_messages(emulated, tmp_path):
    """As ``2>&1 | head -1``; the file counts. What is printed at the end finds no reader, which the status says."""
    reads, writes = os.pipe()
    os.close(reads)
    command = [sys.executable, "-m", "uq.cli.main", "record", str(emulated), "-o", str(tmp_path / "r.mcap")]
    done = subprocess.run([*command, "--seconds", "0.5"], stdout=writes, stderr=writes, timeout=120)
    os.close(writes)
    assert done.returncode == BROKEN_PIPE
    assert inspect(tmp_path / "r.mcap").findings == []


@pytest.mark.parametrize(("closed", "said"), [("2>&-", "complete"), (">&- 2>&-", "")])
def test_a_recording_goes_on_where_streams_are_closed(emulated, tmp_path, closed, said):
    command = [sys.executable, "-m", "uq.cli.main", "record", str(emulated), "-o", str(tmp_path / "r.mcap")]
    shell = ["sh", "-c", f'exec "$@" {closed}', "sh", *command, "--seconds", "0.5"]
    done = subprocess.run(shell, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0
    assert said in done.stdout
    assert inspect(tmp_path / "r.mcap").findings == []


class Gone(io.StringIO):
    """A terminal that is gone, or a pipe that nobody reads."""

    def isatty(self):
        return True

    def flush(self):
        raise BrokenPipeError


def test_messages_that_nobody_reads_are_dropped(monkeypatch):
    monkeypatch.setenv("TERM", "xterm")
    terminal = Terminal(Gone())
    terminal.begin()
    terminal.say("a")
    terminal.progress(Progress(1.0, 2, []), ["b"])
    terminal.done()


@pytest.mark.parametrize("kinds", [("bota", "xsens"), pytest.param(None, marks=pytest.mark.study)])
def test_list_names_the_devices_that_answer(tmp_path, capsys, monkeypatch, kinds):
    """By default two kinds are asked for, since a port is silent for a second at each that is not there."""
    if kinds:
        monkeypatch.setattr("rig.record.discover.kinds", lambda: kinds)
    with Bench(tmp_path) as bench:
        assert main(["record", "--list", bench.ports["cell"], bench.ports["imu"]]) == 0
        lines = capsys.readouterr().out.splitlines()
    assert "kind 'bota': SensONE-emulated" in lines[0]
    assert "kind 'xsens': MTi-emulated" in lines[1]


XSENS = "[[device]]\nname = 'a'\nkind = 'xsens'\nport = '/dev/x'\n"


LINES = "[[device]]\nname = 'a'\nkind = 'line'\nport = '/dev/x'\n"


RATES = ("0", "-1", "nan", "inf", "1e400", "1e-9", "1e6", "9" * 401)


PLAYED = "[[device]]\nname = 'a'\nkind = 'xsens'\nport = 'emulator:run.mcap?{}'\n"


ADDRESSES = [
    *((f"rate={rate}", "option 'rate' in the port of a is") for rate in (*RATES, "", "fast")),
    *((f"{key}=nan", f"option '{key}' in the port") for key in ("skew_ppm", "delay", "loop")),
    ("loop=2", "from 0 to 1"),
    ("skew_ppm=1e300", "from -100000 to 100000"),
    ("rate", "option 'rate'"),
    ("speed=1", "unknown option 'speed' in the port of a: it takes skew_ppm"),
    ("s" * 5000, "unknown option 'sss"),
]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("x", "not a TOML file"),
        ("", "device holds nothing: describe each sensor in a table [[device]]"),
        ("speed = 3", "unknown key speed: the keys here are device"),
        ("[[device]]\nname = 'a'", "missing key device[a].kind: add it"),
        ("[[device]]\nname = 'a'\nkind = 'bota'\nport = '/dev/x'", "say whether the reading is"),
        ("[[device]]\nname = 'a'\nkind = 'bota'\nport = 3", "device[a].port is 3: write a string"),
        ("[[device]]\nname = 'a b'\nkind = 'xsens'\nport = '/dev/x'", "use letters"),
        (
            "[[device]]\nname = 'a'\nkind = 'xsens'\nport = '/dev/x'\nrotation_to_body = [[1,0,0],[0,1,0],[0,0,2]]",
            "no rotation",
        ),
        ("[[device]]\nname = 'a'\nkind = 'xsens'\nport = 'udp:x'", "udp:NUMBER"),
        ("[[device]]\nname = 'a'\nkind = 'xsens'\nport = 'emulator:no.mcap'", "no run"),
        ("[[device]]\nname = 'a'\nkind = 'xsens'\nport = '/dev/x'\n" * 2, "twice"),
        (f"{XSENS}topic = '/diagnostics'", "the topic of device[a]"),
        (f"{XSENS}topic = '/mark'", "the recorder itself writes"),
        (f"{XSENS}topic = '/raw/a'", "the recorder itself writes"),
        ("[[device]]\nname = 'mark'\nkind = 'line'\nport = '/dev/x'\noptions = { columns = ['a'] }", "itself writes"),
        (f"{XSENS}rotation_to_body = [[nan,0,0],[0,1,0],[0,0,1]]", "rotation_to_body[0][0] is nan"),
        (f"{XSENS}x = 0{'[' * 2000}", "not a TOML file"),
        (f"{XSENS}baudrate = {'9' * 5000}", "not a TOML file"),
        (f"{XSENS}options = {{ rate = 0x{'f' * 5000} }}", "not a TOML file"),
        ("[[device]]\nname = '" + "a" * 41 + "'\nkind = 'xsens'\nport = '/dev/x'", "use at most 40 characters"),
        ("[[device]]\nname = 'a'\nkind = 'xsens'\nport = '/dev/" + "x" * 300 + "'", "at most 120 characters"),
        (f"{LINES}options = {{ columns = ['a parsec'] }}", "choose one of"),
        (f"{LINES}options = {{ columns = ['force_x parsec'] }}", "N, kN, gf, kgf, lbf"),
        ("[[device]]\nname = 'a'\nkind = 'xsens'\nport = 'udp:" + "9" * 5000 + "'", "udp:NUMBER"),
        *((f"{XSENS}baudrate = {value}", "baudrate is") for value in (0, -1, "nan", "inf", "1e400", 0.5)),
        *((f"{XSENS}options = {{ rate = {rate} }}", "'rate' of device kind 'xsens' is out of range") for rate in RATES),
        *((PLAYED.format(option), words) for option, words in ADDRESSES),
        ("[[device]]\nname = 'a'\nkind = 'xsens'\nport = '/dev/x'\noptions = { speed = 1 }", "unknown option"),
    ],
)
def test_a_wrong_rig_file_says_what_to_do(tmp_path, capsys, text, words):
    (tmp_path / "rig.toml").write_text(text)
    assert main(["record", str(tmp_path / "rig.toml"), "-o", str(tmp_path / "run.mcap")]) == 2
    err = capsys.readouterr().err
    assert words in err
    assert err.count("\n") == 1
    assert len(err) <= 200 + len(str(tmp_path))
    assert not (tmp_path / "run.mcap").exists()


def test_missing_arguments_say_what_to_do(tmp_path, capsys):
    for arguments in (["record"], ["record", "x.toml"], ["record", "x.toml", "-o", "y", "--seconds", "-1"]):
        assert main(arguments) == 2
        assert capsys.readouterr().err.startswith("error: ")
    assert main(["record", str(tmp_path / "none.toml"), "-o", str(tmp_path / "y.mcap")]) == 2
    assert "none.toml" in capsys.readouterr().err


def test_recording_never_loads_jax():
    """It must start at once."""
    code = "import sys; import uq.cli.record, rig.record.recorder, rig.record.terminal; print(sorted(sys.modules))"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout
    assert not {"jax", "scipy", "matplotlib", "pint"} & set(json.loads(loaded.replace("'", '"')))


def test_what_a_recording_came_to_is_read_at_a_glance():
    cell = {"topic": "/wrench", "state": "ok", "samples": 8000, "missing": 0, "failures": 0, "rate_hz": 799.96}
    cell |= {"incomplete": ""}
    imu = cell | {"topic": "/imu", "state": "silent", "samples": 12, "missing": 3, "failures": 4, "rate_hz": 1.2}
    imu |= {"incomplete": "3 missing samples, 4 bad frames"}
    summary = Summary("run.mcap", 10.004, 2_345_678, False, {"cell": cell, "imu": imu}, marks=2)
    summary.delays["legs"] = {"delay_s": 0.0213, "delay_correlation": 0.99}
    assert [line.split() for line in summary_lines(summary) if "─" not in line] == [
        ["device", "topic", "samples", "rate", "[Hz]", "missing", "bad", "state"],
        ["cell", "/wrench", "8,000", "799.96", "0", "0", "ok"],
        ["imu", "/imu", "12", "1.2", "3", "4", "silent"],
        ["legs:", "the", "IMU", "follows", "it", "by", "21.3", "ms"],
        ["run.mcap:", "10.0", "s,", "2.3", "MB,", "2", "marks,"]
        + ["NOT", "COMPLETE;", "imu:", "3", "missing", "samples,", "4", "bad", "frames"],
    ]
