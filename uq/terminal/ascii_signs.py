"""Signs that a terminal or file cannot take, in ASCII: a minus must not get lost."""

import codecs
import sys
import unicodedata

ASCII = {
    "−": "-", "–": "-", "—": "-", "─": "-", "±": "+-", "²": "^2", "³": "^3", "·": "*", "×": "x", "σ": "sigma",
    "ω": "omega", "Ω": "Omega", "α": "alpha", "χ": "chi", "ρ": "rho", "µ": "u", "μ": "u", "°": " deg", "…": "...",
    "≤": "<=", "≥": ">=", "≈": "~", "√": "sqrt", "→": "->", "∞": "inf", "’": "'", "“": '"', "”": '"',
}  # fmt: skip
"""Replacement in ASCII of each sign."""


def print_ascii_where_needed() -> None:
    """Let the standard streams print what stands for a sign that their encoding lacks."""
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors=in_ascii.__name__)


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
