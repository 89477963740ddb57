"""The one exception of this package, and how messages repeat what a user wrote."""

import difflib
import errno
from collections.abc import Iterable

ECHO = 48
"""The most characters of a value or a name that a message repeats."""
LISTED = 60
"""The most characters of a list of names."""

CURES = {
    errno.ENOSPC: "free some space",
    errno.EDQUOT: "free some space",
    errno.EFBIG: "raise the limit on the size of files (ulimit -f)",
    errno.EMFILE: "raise the limit of open files (ulimit -n)",
    errno.ENOMEM: "give it more memory (ulimit -v, the job's limit)",
}


class RigError(ValueError):
    """A user's mistake or a fault of a file or device, in one line: ``<what> <where>: <what to do>``."""


def quoted(value: object) -> str:
    """Return what was written as a message repeats it: one line, text in quotes, of a long one both ends."""
    try:
        text = repr(value[: 2 * ECHO] + value[-ECHO:] if isinstance(value, str) and len(value) > 4 * ECHO else value)
    except ValueError:  # a whole number of more digits than Python writes
        return "a number of thousands of digits"
    half = (ECHO - 1) // 2
    return text if len(text) <= ECHO else f"{text[: ECHO - 1 - half]}…{text[-half:]}"


def cure(error: OSError) -> str:
    """Return what to do about a failure of the system."""
    return CURES.get(error.errno or 0, "check the path and its permissions")


def reason(error: object) -> str:
    """Return what a library says of a failure as a message gives it: one line, not too long."""
    text = on_one_line(str(error))
    return text if len(text) <= ECHO else f"{text[: ECHO - 1]}…"


def listed(names: Iterable[str]) -> str:
    """Return names with commas between them, of many the first ones and how many more there are."""
    all_names = [name if _plain(name) else quoted(name) for name in names]
    shown = list(all_names)
    while len(", ".join(shown)) > LISTED and len(shown) > 1:
        shown.pop()
    more = f" and {len(all_names) - len(shown)} more" if len(shown) < len(all_names) else ""
    return ", ".join(shown) + more


def counted(count: int, noun: str) -> str:
    """Return a count with its noun, in the plural unless it is one: ``1 gap``, ``1,200 samples``."""
    return f"{count:,} {noun}{'' if count == 1 else 's'}"


def choose(name: str, choices: Iterable[str]) -> str:
    """Return which of some names to write instead of an unknown one, the nearest first."""
    names = list(choices)
    return f"{nearest(name, names)}choose one of {listed(names)}"


def nearest(name: str, choices: Iterable[str]) -> str:
    """Return ``did you mean …? `` of the name that is nearest to an unknown one; empty where none is near."""
    close = difflib.get_close_matches(name[:ECHO], list(choices), 1)
    return f"did you mean {close[0]}? " if close else ""


def on_one_line(text: str) -> str:
    """Return a text with control characters written out, such as a line feed in the name of a file.

    Those that turn the direction of text around are among them. They are written as JSON does, so that JSON stays JSON.
    """
    return text if text.isprintable() else "".join(c if c.isprintable() else _written_out(c) for c in text)


def on_its_lines(text: str) -> str:
    """Return a text with control characters written out, but for the ends of its lines."""
    return "\n".join(map(on_one_line, text.split("\n")))


def _written_out(character: str) -> str:
    return {"\n": r"\n", "\r": r"\r", "\t": r"\t"}.get(character, f"\\u{ord(character):04x}")


def _plain(name: str) -> bool:
    return name.isprintable() and len(name) <= ECHO
