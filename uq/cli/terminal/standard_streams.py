"""Text on its way to the terminal: no control character of a file, and signs that it cannot take in ASCII.

A topic, file or device may be named so that a terminal that shows the name clears its screen, changes its title or
turns text around. So both standard streams write control characters out, whoever prints. What a progress bar needs of
them goes past that, by :func:`uncontrolled`.
"""

import codecs
import contextlib
import os
import sys
import unicodedata
from collections.abc import Iterable, Iterator
from typing import Any

from rig.exceptions import on_its_lines

ASCII = {
    "−": "-", "–": "-", "—": "-", "─": "-", "±": "+-", "²": "^2", "³": "^3", "·": "*", "×": "x", "σ": "sigma",
    "ω": "omega", "Ω": "Omega", "α": "alpha", "χ": "chi", "ρ": "rho", "µ": "u", "μ": "u", "°": " deg", "…": "...",
    "≤": "<=", "≥": ">=", "≈": "~", "√": "sqrt", "→": "->", "∞": "inf", "’": "'", "“": '"', "”": '"',
}  # fmt: skip
"""ASCII text that is printed in place of a sign."""


class ShownText:
    """A stream that writes a text with its control characters written out, but for the ends of lines."""

    def __init__(self, stream: Any) -> None:
        self.stream = uncontrolled(stream)
        if hasattr(self.stream, "reconfigure"):
            self.stream.reconfigure(errors=in_ascii.__name__)

    def write(self, text: str) -> int:
        """Write a text; return its length."""
        self.stream.write(on_its_lines(text))
        return len(text)

    def writelines(self, lines: Iterable[str]) -> None:
        """Write texts one after the other."""
        for line in lines:
            self.write(line)

    def __getattr__(self, name: str) -> Any:
        return getattr(self.stream, name)


def open_closed_streams() -> None:
    """Let a standard stream that is closed lead nowhere: else the next file that is opened takes its place."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        if getattr(sys, name) is None:
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: SIM115  its number is the lowest free


@contextlib.contextmanager
def shown_streams(*, to_the_end: bool) -> Iterator[None]:
    """Let the standard streams write out control characters, and what stands for a sign that their encoding lacks.

    ``to_the_end`` of the process: its last words may be the traceback of an error that nobody expected.
    """
    before = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = ShownText(sys.stdout), ShownText(sys.stderr)
    try:
        yield
    finally:
        if not to_the_end:
            sys.stdout, sys.stderr = before


def uncontrolled(stream: Any) -> Any:
    """Return the stream beneath, for a text that moves the cursor; its caller writes out what comes from a file."""
    return stream.stream if isinstance(stream, ShownText) else stream


def in_ascii(error: UnicodeError) -> tuple[str, int]:
    """Return what is printed in place of a sign that cannot be; spaces behind a longer one make up for it."""
    if not isinstance(error, UnicodeEncodeError):
        raise error
    text, end = error.object, error.start + 1
    sign = text[error.start]
    simpler = ASCII.get(sign) or "".join(ASCII.get(c, c) for c in unicodedata.normalize("NFKD", sign))
    plain = simpler.encode("ascii", "ignore").decode() or "?"
    spaces = len(text[end:]) - len(text[end:].lstrip(" "))
    return plain, end + min(len(plain) - 1, max(spaces - (sign != "±"), 0))


codecs.register_error(in_ascii.__name__, in_ascii)
