"""A progress bar: in a notebook a widget, on a terminal a line."""

from collections.abc import Callable
from types import TracebackType
from typing import Any

from rig.exceptions import on_one_line

Progress = Callable[[str, int, int], None]
"""Called with what is computed, such as a trajectory's name, the steps done and the steps asked for."""


class ProgressBar:
    """A bar that vanishes at its end: a context manager to be called with name, done, asked."""

    def __init__(self, *, silent: bool = False, unit: str = "trials", stream: Any = None) -> None:
        """Name whether it shows nothing, what is counted, and where it is drawn (None: on standard error)."""
        self.bar: Any = None
        self.unit = f" {unit}"
        self.silent, self.stream = silent, stream

    def __call__(self, name: str, done: int, asked: int) -> None:
        """Show how many steps of what is named are done."""
        if self.silent:
            return
        name = on_one_line(name)
        if self.bar is None or self.bar.desc != name:
            from tqdm.auto import tqdm

            self.close()
            self.bar = tqdm(desc=name, total=asked, unit=self.unit, leave=False, file=self.stream)
            self.bar.desc = name
            self.bar.initial = self.bar.n = self.bar.last_print_n = done  # what is resumed took no time
        self.bar.total = asked
        self.bar.update(done - self.bar.n)

    def close(self) -> None:
        """End the line of the bar."""
        if self.bar is not None:
            self.bar.close()
            self.bar = None

    def __enter__(self) -> "ProgressBar":
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        self.close()


def progress_of(progress: Progress | bool | None, unit: str = "trials") -> Progress:
    """Return what is to be called: for True a bar, which ends when it is let go of; else nothing happens."""
    return ProgressBar(unit=unit) if progress is True else progress or (lambda *_: None)
