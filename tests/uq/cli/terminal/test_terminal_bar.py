"""What a command shows of its progress where there is no terminal."""

from rig import read_limits
from rig.mcap.records import Scanner
from tests.helpers.saved_runs import written
from uq.cli.terminal import terminal_bar
from uq.cli.terminal.terminal_bar import ReadingBar, TerminalBar


def test_a_log_has_a_line_for_each_step_and_for_each_minute(monkeypatch, capsys):
    """Six calls: a new step, twice within its minute, after it, another step, within its minute."""
    clock = iter([0.0, 1.0, 30.0, 60.9, 61.0, 70.0, 100.0])
    monkeypatch.setattr(terminal_bar.time, "monotonic", lambda: next(clock))
    with TerminalBar(unit="steps", lines=True) as bar:
        for name, done in [("starts", 0), ("starts", 1), ("starts", 2), ("starts", 3), ("limits", 0), ("limits", 1)]:
            bar(name, done, 14)
    lines = ["starts: 0 of 14 steps after 1 s", "starts: 3 of 14 steps after 61 s", "limits: 0 of 14 steps after 70 s"]
    assert capsys.readouterr().err.splitlines() == lines


def test_others_say_nothing(capsys):
    for options in ({}, {"silent": True, "lines": True}):
        with TerminalBar(**options) as bar:
            bar("T1", 1, 2)
    assert capsys.readouterr() == ("", "")


def test_a_file_that_takes_long_to_read_says_how_far_it_is(tmp_path, monkeypatch, capsys):
    path, told = tmp_path / "run.mcap", []
    written(path)
    monkeypatch.setattr(read_limits, "SLOW", 0.0)
    monkeypatch.setattr(read_limits, "watch", lambda *which: told.append(which))
    with open(path, "rb") as stream:
        list(Scanner(path, stream))
    size = path.stat().st_size
    assert told == [(path, told[0][1], size), (path, size, size)]
    bar = ReadingBar()
    bar.watch(path, 12 * 10**6, 99 * 10**6)
    bar.watch(path, 99 * 10**6, 99 * 10**6)
    reading, computing = capsys.readouterr().err.splitlines()
    assert reading == "reading run.mcap: 12 of 99 MB after 0 s"
    assert computing == "run.mcap is read; computing, which may take several times as long"
