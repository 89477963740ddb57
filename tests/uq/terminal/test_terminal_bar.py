"""What a command shows of its progress where there is no terminal."""

from uq.terminal import common
from uq.terminal.common import TerminalBar


def test_a_log_has_a_line_for_each_step_and_for_each_minute(monkeypatch, capsys):
    """Six calls: a new step, twice within its minute, after it, another step, within its minute."""
    clock = iter([0.0, 1.0, 30.0, 60.9, 61.0, 70.0, 100.0])
    monkeypatch.setattr(common.time, "monotonic", lambda: next(clock))
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
