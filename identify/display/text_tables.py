"""Small tables, for a terminal and for Jupyter."""

import os
import re
import sys
import textwrap
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass
from html import escape
from itertools import takewhile

FIGURE = re.compile(r"|–|[+−-]?[\d.,]+(e[+−-]?\d+)?( ± [\d.]+(e−\d+)?|\([\d.]+\))?|−?∞")

WIDEST = 199
"""Columns of what goes to no terminal: an editor or a log shows as many."""


@dataclass(frozen=True, repr=False)
class Table:
    """A small table of texts, which shows itself aligned in a terminal and as HTML in a notebook."""

    caption: str
    head: Sequence[str]
    rows: Sequence[Sequence[str]]
    note: str = ""
    """Line of text below the table in a report."""
    wrap: bool = False
    """Whether the table's cells hold text that may be broken into lines."""
    long: bool = False
    """Whether the table is too long for a terminal, so that only notebooks and reports show it."""

    @property
    def numeric(self) -> list[bool]:
        """Mask of the columns that hold figures, to be set to the right."""
        return [all(is_figure(row[k]) for row in self.rows) for k in range(len(self.head))]

    def __repr__(self) -> str:
        return "\n".join([*([self.caption] if self.caption else []), text_table(self.head, self.rows)])

    def _repr_html_(self) -> str:
        return html_table(self.head, self.rows, self.caption)


def text_table(head: Sequence[str], rows: Sequence[Sequence[str]], width: int | None = None) -> str:
    """Return an aligned table: text to the left, figures to the right.

    What is wider than ``width`` (None: :func:`terminal_width`, or ``WIDEST``) comes in several tables one below the
    other, each with the leading columns of text; where these leave no room, as one line a figure.
    """
    head, *rows = lines = [[one_line(cell) for cell in row] for row in (head, *rows)]
    widths = [max(_width(line[k]) for line in lines) for k in range(len(head))]
    right = [all(is_figure(row[k]) for row in rows) for k in range(len(head))]
    labels = list(takewhile(lambda k: not right[k], range(len(head))))
    labels = labels[:1] if len(labels) == len(head) else labels
    limit = width or terminal_width() or WIDEST
    tables = [list(range(len(head)))]
    if sum(widths) + 2 * (len(head) - 1) > limit:
        tables = _columns_that_fit(widths, labels, limit)

    def draw(line: Sequence[str], columns: Sequence[int]) -> str:
        padding = {k: " " * (widths[k] - _width(line[k])) for k in columns}
        return "  ".join(padding[k] + line[k] if right[k] else line[k] + padding[k] for k in columns).rstrip()

    if not tables:
        return "\n".join(text for row in rows for text in _one_a_line(head, row, len(labels), limit))
    ruled = [lines[0], ["─" * width for width in widths], *lines[1:]]
    return "\n\n".join("\n".join(draw(line, columns) for line in ruled) for columns in tables)


def in_lines(text: str) -> str:
    """Return a text with its lines of more than ``WIDEST`` columns, or of the terminal's if it is wider, broken."""
    width = max(terminal_width() or 0, WIDEST)
    breaks = textwrap.TextWrapper(width, subsequent_indent="    ", break_on_hyphens=False)
    return "\n".join(breaks.fill(line) if len(line) > width else line for line in text.split("\n"))


def terminal_width() -> int | None:
    """Return the columns of the terminal; None where what is printed goes to no terminal. ``COLUMNS`` counts first."""
    stated = os.environ.get("COLUMNS", "")
    if stated.isdecimal() and int(stated):
        return int(stated)
    try:
        return os.get_terminal_size(sys.__stdout__.fileno()).columns or None if sys.stdout.isatty() else None  # type: ignore[union-attr]
    except (AttributeError, OSError, ValueError):  # no stream, or one of a notebook
        return None


def _columns_that_fit(widths: Sequence[int], labels: list[int], width: int) -> list[list[int]]:
    """Return the columns of each of several tables, the labels first; none where not even one column fits."""
    tables, taken = [], width + 1
    label_width = sum(widths[k] + 2 for k in labels)
    for k in range(len(labels), len(widths)):
        if taken + 2 + widths[k] > width:
            tables.append([*labels])
            taken = label_width - 2
        tables[-1].append(k)
        taken += 2 + widths[k]
        if taken > width:
            return []
    return tables


def _one_a_line(head: Sequence[str], row: Sequence[str], labels: int, width: int) -> list[str]:
    """Return a row as lines: its labels, then each of its other cells with its head."""
    entries = [f"{name} {cell}".strip() for name, cell in zip(head, row, strict=True) if cell]
    blank = sum(not cell for cell in row[:labels])
    first = ", ".join(entries[: labels - blank])
    return [
        line
        for indent, text in [("", first), *(("  ", text) for text in entries[labels - blank :])]
        for line in textwrap.wrap(text, max(width, 20), initial_indent=indent, subsequent_indent=indent + "  ")
    ]


def one_line(text: str) -> str:
    """Return a text with the ends of its lines written out: a name in it must not begin a line of its own."""
    return text.replace("\n", "\\n")


def html_table(head: Sequence[str], rows: Sequence[Sequence[str]], caption: str) -> str:
    """Return the table as HTML."""
    cells = "".join(f"<th>{escape(cell)}</th>" for cell in head)
    body = "".join(f"<tr>{''.join(map(_cell, row))}</tr>" for row in rows)
    title = f"<caption>{escape(caption)}</caption>" if caption else ""
    return f"<table>{title}<thead><tr>{cells}</tr></thead><tbody>{body}</tbody></table>"


def is_figure(cell: str) -> bool:
    """Whether a cell holds a number, with or without a standard error, or none."""
    return FIGURE.fullmatch(cell) is not None


def _cell(text: str) -> str:
    return f'<td style="text-align:{"right" if is_figure(text) else "left"}">{escape(text)}</td>'


def _width(cell: str) -> int:
    """Columns that a cell takes in a terminal, not counting combining marks."""
    return sum(not unicodedata.combining(character) for character in cell)


def enumerated(words: Sequence[str]) -> str:
    """Return words as a text joins them: ``a, b and c``."""
    *first, last = words
    return f"{', '.join(first)} and {last}" if first else last


def counted(count: int, noun: str) -> str:
    """Return a count with its noun, in the plural unless it is one: ``1 gap``, ``1,200 samples``."""
    return f"{count:,} {noun}{'' if count == 1 else 's'}"


def sentence(text: str) -> str:
    """Return a text with a capital and a full stop."""
    return f"{text[0].upper()}{text[1:]}."
