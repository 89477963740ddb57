"""Functions that the commands share: float64, devices, checks of the output folder, the progress bar."""

import argparse
import contextlib
import logging
import os
import sys
import time
from collections.abc import Iterator, Sequence
from importlib import import_module
from pathlib import Path
from typing import Any

import jax

from identify.signals.run import RunError
from rig.exceptions import RigError, on_one_line, quoted
from uq.experiment.experiment import ExperimentError
from uq.files.compilation_cache import keep_compiled
from uq.terminal.standard_streams import uncontrolled
from uq.trials.progress_bar import ProgressBar

ERRORS = (ExperimentError, RunError, RigError)
GOES_ON = "the same command goes on from there"
"""Advice for an interrupted command that keeps its results so far."""
BETWEEN_LINES = 60.0
"""Seconds after which a line of progress follows another of the same step."""


def start_jax() -> None:
    """Switch on float64, keep what is compiled, let each processor be a device; before the first array is made."""
    logging.getLogger("matplotlib").setLevel(logging.ERROR)  # a home that cannot be written is no user's concern
    jax.config.update("jax_enable_x64", True)
    with contextlib.suppress(RuntimeError):  # devices exist already, as in a notebook
        jax.config.update("jax_num_cpu_devices", processors())
    keep_compiled()


def processors() -> int:
    """Return how many processors this process may use; all there are where the system does not tell."""
    if hasattr(os, "sched_getaffinity"):
        return len(os.sched_getaffinity(0))
    return os.cpu_count() or 1


@contextlib.contextmanager
def output_folder(text: str | None) -> Iterator[Path | None]:
    """Make the output folder and see that it can be written, before any work is done; gone again if the work fails.

    What draws and writes is loaded before the work, too: where memory is short, that fails at once and not after hours.

    Raises:
        OSError: it cannot be made or written.
    """
    if text is None:
        yield None
        return
    for module in ("scipy.special", "uq.report.report_files"):
        import_module(module)
    folder = Path(text)
    made = [parent for parent in (folder, *folder.parents) if not parent.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    if not os.access(folder, os.W_OK):
        raise PermissionError(13, "cannot write to", str(folder))
    try:
        yield folder
    except BaseException:
        with contextlib.suppress(OSError):
            for empty in made:
                empty.rmdir()
        raise


class _Limit(argparse.Action):
    """Keeps ``--from`` and ``--to`` in the order in which they were given."""

    def __call__(
        self, parser: object, namespace: argparse.Namespace, values: object, option: str | None = None
    ) -> None:
        limits = [*getattr(namespace, self.dest), ((option or "").lstrip("-"), values)]
        setattr(namespace, self.dest, limits)


def add_window_options(parser: argparse.ArgumentParser, without: str = "the segments that move are found") -> None:
    """Add ``--from`` and ``--to``, repeatable; :mod:`uq.recorded.time_window` reads ``limits``."""
    for option, what in (("--from", "start"), ("--to", "end")):
        parser.add_argument(
            option, dest="limits", action=_Limit, default=(), metavar="S",
            help=f"{what} of a part of the run that counts: seconds from the run's start, or a mark's name; "
            f"repeatable (without it, {without})",
        )  # fmt: skip


def finish(result: Any, out: Path | None, *more: Any, unsaid: Sequence[Any] = ()) -> None:
    """Print results, but for those that are ``unsaid``, and write their files, if there is a folder for them.

    The figures are drawn as matplotlib does by itself, whatever a ``matplotlibrc`` in the working folder says.
    """
    print(*(result, *more), sep="\n\n")
    if out is not None:
        import matplotlib

        from uq.report.report_files import write

        with matplotlib.rc_context(matplotlib.rcParamsDefault):
            write(result, out, *more, *unsaid)
        name = getattr(result, "file_name", "result.json")
        print(f"\n{on_one_line(f'{name}, report.html and figures are in {out}')}")


def add_samples_options(parser: argparse.ArgumentParser, ways: argparse._ActionsContainer | None = None) -> None:
    """Add the options of a campaign by samples; ``ways`` is the group of the ways to draw, where there are others."""
    (ways or parser).add_argument(
        "--samples", action="store_true", help="draw every sample of every trial: slow, the reference"
    )
    parser.add_argument(
        "--dtype", choices=("float64", "float32"), default="float64",
        help="precision of the samples that are drawn (float64)",
    )  # fmt: skip


def whole_number(text: str) -> int:
    """Parse a whole number, for argparse."""
    try:
        number = int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{quoted(text)} is not a whole number") from None
    if abs(number) >= 2**32:
        raise argparse.ArgumentTypeError(f"{text} is out of range")
    return number


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
