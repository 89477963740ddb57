"""What the commands share: float64, devices, checks of the output folder, the progress bar."""

import argparse
import contextlib
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from types import TracebackType
from typing import Any

import jax
from tqdm import tqdm

from identify.run import RunError
from rig.errors import RigError
from uq.experiment import ExperimentError

ERRORS = (ExperimentError, RunError, RigError)


def start_jax() -> None:
    """Switch on float64 and let each processor be a device of its own; before the first array is made."""
    jax.config.update("jax_enable_x64", True)
    with contextlib.suppress(RuntimeError):  # devices exist already, as in a notebook
        jax.config.update("jax_num_cpu_devices", len(os.sched_getaffinity(0)))


@contextlib.contextmanager
def output_folder(text: str | None) -> Iterator[Path | None]:
    """Make the output folder and see that it can be written, before any work is done; gone again if the work fails.

    Raises:
        OSError: it cannot be made or written.
    """
    if text is None:
        yield None
        return
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


def finish(result: Any, out: Path | None, *more: Any) -> None:
    """Print results and write their files, if there is a folder for them."""
    print(*(result, *more), sep="\n\n")
    if out is not None:
        from uq.report import write

        write(result, out, *more)
        print(f"\nresult.json, report.html and figures are in {out}")


def whole_number(text: str) -> int:
    """Parse a whole number, for argparse."""
    try:
        number = int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number") from None
    if abs(number) >= 2**32:
        raise argparse.ArgumentTypeError(f"{text} is out of range")
    return number


class ProgressBar:
    """A progress bar on a terminal, nothing elsewhere: a context manager to be called with name, done, asked."""

    def __init__(self) -> None:
        self.bar: tqdm | None = None

    def __call__(self, name: str, done: int, asked: int) -> None:
        if not sys.stderr.isatty():
            return
        if self.bar is None or self.bar.desc != name:
            self.close()
            self.bar = tqdm(desc=name, total=asked, unit=" trials", leave=False)
            self.bar.desc = name
            self.bar.initial = self.bar.n = self.bar.last_print_n = done  # what is resumed took no time
        self.bar.total = asked
        self.bar.update(done - self.bar.n)

    def close(self) -> None:
        if self.bar is not None:
            self.bar.close()
            self.bar = None

    def __enter__(self) -> "ProgressBar":
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()
