"""The terminal of a recording: progress on one line, messages above it, keys or lines of input as marks."""

import contextlib
import importlib
import os
import select
import shutil
import threading
from collections.abc import Callable, Iterator
from io import TextIOBase
from typing import Any, TextIO

from rig.record.recorder import Progress, Summary

POSIX = hasattr(os, "tcgetpgrp")
"""Whether keys and pipes can be waited for as POSIX does; else as Windows does."""


class Terminal:
    """Progress and messages on a stream; without a terminal that can rewrite a line only the messages."""

    def __init__(self, stream: TextIO | TextIOBase) -> None:
        self._stream, self._live = stream, stream.isatty() and os.environ.get("TERM") != "dumb"
        self._last: dict[str, tuple[float, int]] = {}

    def say(self, text: str) -> None:
        """One message on a line of its own."""
        self._stream.write(f"\r\x1b[K{text}\n" if self._live else f"{text}\n")
        self._stream.flush()

    def progress(self, progress: Progress) -> None:
        """The line that is always rewritten."""
        if self._live:
            self._stream.write("\r\x1b[K" + self.line(progress)[: self._width() - 1])
            self._stream.flush()

    def _width(self) -> int:
        """Columns of the terminal: a line that wraps cannot be rewritten."""
        with contextlib.suppress(OSError, ValueError):
            return os.get_terminal_size(self._stream.fileno()).columns or shutil.get_terminal_size().columns
        return shutil.get_terminal_size().columns

    def line(self, progress: Progress) -> str:
        """Elapsed time, file size, and per device rate, missing samples and checksum failures."""
        texts = [f"{progress.seconds:7.1f} s  {progress.bytes / 1e6:.1f} MB"]
        for source in progress.sources:
            counts, name = source.counts, source.entry.name
            seconds, samples = self._last.get(name, (0.0, 0))
            rate = (counts.samples - samples) / max(progress.seconds - seconds, 1e-9)
            self._last[name] = progress.seconds, counts.samples
            trouble = "" if source.state == "ok" else f" {source.state.upper()}"
            texts.append(f"{name} {rate:.0f} Hz, {counts.missing} missing, {counts.failures} bad{trouble}")
        return "  |  ".join(texts)

    def begin(self) -> None:
        """Say, to somebody at a terminal, what the keys do."""
        if self._live:
            self.say("Ctrl-C ends the recording, any other key marks an instant")

    def done(self) -> None:
        """Leave the progress line standing."""
        if self._live:
            self._stream.write("\n")


def summary_lines(summary: Summary) -> Iterator[str]:
    """What a recording came to, for a reader; a program reads the summary's JSON."""
    for name, device in summary.devices.items():
        trouble = "" if device["state"] == "ok" else f", {str(device['state']).upper()}"
        yield (
            f"{name}: {device['samples']:,} samples on {device['topic']} at {device['rate_hz']:.6g} Hz, "
            f"{device['missing']:,} missing{trouble}"
        )
    for name, delay in summary.delays.items():
        yield f"{name}: the IMU follows it by {1e3 * delay['delay_s']:.1f} ms"
    marks = f", {summary.marks} marks" if summary.marks else ""
    whole = "complete" if summary.complete else "NOT COMPLETE"
    yield f"{summary.file}: {summary.seconds:.1f} s, {summary.bytes / 1e6:.1f} MB{marks}, {whole}"


class Keys:
    """Calls ``mark`` with every line of input, or with every key where the input is a terminal."""

    def __init__(self, stream: object, mark: Callable[[str], None]) -> None:
        self._mark = mark
        self._ended = threading.Event()
        self._handle = -1
        with contextlib.suppress(OSError, ValueError, AttributeError):
            self._handle = stream.fileno()  # type: ignore[attr-defined]
        self._old: list | None = None
        self._thread: threading.Thread | None = None

    def __enter__(self) -> "Keys":
        if self._handle < 0:
            return self
        keyboard = os.isatty(self._handle)
        if keyboard and POSIX:
            import termios
            import tty

            if os.tcgetpgrp(self._handle) != os.getpgrp():
                return self  # in the background the terminal is not ours to read
            self._old = termios.tcgetattr(self._handle)
            tty.setcbreak(self._handle)
        listen = self._listen_to_console if keyboard and not POSIX else self._listen
        self._thread = threading.Thread(target=listen, name="marks", daemon=True)
        self._thread.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._ended.set()
        if self._thread is not None:
            self._thread.join(1.0)
        if self._old is not None:
            import termios

            termios.tcsetattr(self._handle, termios.TCSADRAIN, self._old)

    def _listen(self) -> None:
        heard = b""
        while not self._ended.is_set():
            if POSIX and not select.select([self._handle], [], [], 0.2)[0]:
                continue
            data = os.read(self._handle, 4096)
            if not data:
                return
            if self._old is not None:
                self._mark(data.decode("utf-8", "replace"))
                continue
            *lines, heard = (heard + data).split(b"\n")
            for line in lines:
                self._mark(line.decode("utf-8", "replace").strip())

    def _listen_to_console(self) -> None:
        """Mark every key of a Windows console; a key without a character sends two."""
        msvcrt: Any = importlib.import_module("msvcrt")
        while not self._ended.wait(0.05):
            while msvcrt.kbhit():
                if (key := msvcrt.getwch()) in "\x00\xe0":
                    msvcrt.getwch()
                else:
                    self._mark(key)
