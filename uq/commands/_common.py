"""What the commands share: float64, devices, checks of the output folder, the progress bar."""

import argparse
import contextlib
import os
import sys
from pathlib import Path
from types import TracebackType

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


def output_folder(text: str | None) -> Path | None:
    """Make the output folder and see that it can be written, before any work is done.

    Raises:
        OSError: it cannot.
    """
    if text is None:
        return None
    folder = Path(text)
    folder.mkdir(parents=True, exist_ok=True)
    if not os.access(folder, os.W_OK):
        raise PermissionError(13, "cannot write to", str(folder))
    return folder


def whole_number(text: str) -> int:
    """Parse a whole number, for argparse."""
    try:
        return int(text)
    except ValueError:
        raise argparse.ArgumentTypeError(f"{text!r} is not a whole number") from None


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
        self.bar.update(done - self.bar.n)

    def close(self) -> None:
        if self.bar is not None:
            self.bar.close()
            self.bar = None

    def __enter__(self) -> "ProgressBar":
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()
