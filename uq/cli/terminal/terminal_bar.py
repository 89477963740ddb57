"""Lines that a command prints beside its result, and bars of its progress."""

import os
import sys
import time

from rig.exceptions import on_one_line
from uq.cli.terminal.standard_streams import uncontrolled
from uq.progress_bar import ProgressBar

BETWEEN_LINES = 60.0
"""Seconds after which a line of progress follows another of the same step."""


def say(line: str) -> None:
    """Print a line that is no result."""
    print(on_one_line(line), file=sys.stderr)


class TerminalBar(ProgressBar):
    """A progress bar on a terminal; elsewhere nothing, or a line for each new step and every minute."""

    def __init__(self, *, silent: bool = False, unit: str = "trials", lines: bool = False) -> None:
        """Name what shows no bar, ``silent`` or no terminal; what is counted; whether ``lines`` stand for the bar."""
        super().__init__(silent=silent or not sys.stderr.isatty(), unit=unit, stream=uncontrolled(sys.stderr))
        self.lines = lines and not silent and self.silent
        self.named, self.begin, self.last = "", time.monotonic(), 0.0

    def __call__(self, name: str, done: int, asked: int) -> None:
        """Show how many steps of what is named are done."""
        super().__call__(name, done, asked)
        now = time.monotonic()
        if self.lines and (name != self.named or now - self.last >= BETWEEN_LINES):
            self.named, self.last = name, now
            say(f"{name}: {done} of {asked}{self.unit} after {now - self.begin:.0f} s")

    def __enter__(self) -> "TerminalBar":
        return self

    def print(self, line: str) -> None:
        """Print a line of results above the bar, at once."""
        if self.bar is not None:
            self.bar.clear()
        print(line, flush=True)
        if self.bar is not None:
            self.bar.refresh()


class ReadingBar(TerminalBar):
    """A bar of the reading of a large file, for :data:`rig.read_limits.watch`."""

    def __init__(self) -> None:
        super().__init__(unit="MB", lines=True)

    def watch(self, path: str | os.PathLike[str], position: int, size: int) -> None:
        """Show how much of a file is read, until it is read; what follows takes as long."""
        self(f"reading {os.path.basename(path)}", position // 10**6, size // 10**6)
        if position >= size:
            self.close()
            say(f"{os.path.basename(path)} is read; computing, which may take several times as long")
