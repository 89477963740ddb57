"""The terminal of a recording: progress in a block of lines, messages above it, keys or lines of input as marks."""

import contextlib
import importlib
import os
import select
import shutil
import threading
from collections.abc import Callable, Sequence
from io import TextIOBase
from typing import Any, TextIO

from rig.exceptions import on_one_line
from rig.record.recorder import Progress

POSIX = hasattr(os, "tcgetpgrp")
"""Whether keys and pipes can be waited for as on POSIX systems; otherwise as on Windows."""


class Terminal:
    """Progress and messages on a stream; without a terminal that can rewrite a line only the messages.

    Attributes:
        live: whether the stream is such a terminal.
    """

    def __init__(self, stream: TextIO | TextIOBase) -> None:
        self._stream = stream
        self.live = stream.isatty() and os.environ.get("TERM") != "dumb"
        self._height = 0
        self._last: dict[str, tuple[float, int]] = {}

    def say(self, text: str) -> None:
        """One message on a line of its own."""
        self._write(f"{self._clear() if self.live else ''}{on_one_line(text)}\n")

    def progress(self, progress: Progress, more: Sequence[str] = ()) -> None:
        """The block that is always rewritten: a line of the recording, and more lines."""
        if self.live:
            columns, rows = self._size()
            texts = [on_one_line(text) for text in (self.line(progress), *more)]
            lines = [text[: columns - 1] for text in texts][: max(rows - 1, 1)]
            self._write(self._clear() + "\n".join(lines))
            self._height = len(lines)

    def _clear(self) -> str:
        """Return the characters that remove the block from the screen, and put the cursor where the block began."""
        up = f"\x1b[{self._height - 1}A" if self._height > 1 else ""
        self._height = 0
        return f"\r{up}\x1b[J" if up else "\r\x1b[K"

    def _size(self) -> tuple[int, int]:
        """Columns and rows of the terminal: what wraps or scrolls cannot be rewritten."""
        usual = shutil.get_terminal_size()
        with contextlib.suppress(OSError, ValueError):
            size = os.get_terminal_size(self._stream.fileno())
            return size.columns or usual.columns, size.lines or usual.lines
        return usual.columns, usual.lines

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
        if self.live:
            self.say("Ctrl-C ends the recording, any other key marks an instant")

    def done(self) -> None:
        """Leave the block standing."""
        if self.live:
            self._write("\n")
            self._height = 0

    def _write(self, text: str) -> None:
        """Write a text; nothing where nobody reads it any more (``| head``), which must not end a recording."""
        with contextlib.suppress(OSError):
            self._stream.write(text)
            self._stream.flush()


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
