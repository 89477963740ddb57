"""The layout of a table in a text file: encoding, delimiter, decimal mark, names of the columns, units, first row.

Loggers write lines about themselves above the names, and units below or behind them. What tells the numbers from all
that is that the rows of numbers are alike; their delimiter and decimal mark are those that make the most numbers.
"""

import codecs
import csv
import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from identify.signals.run import RunError
from rig.read_limits import require_file
from uq.files.units import UnitError, scale

SAMPLE = 2**18
"""Bytes of a file from which its layout is told."""
ROWS = 50
"""Rows that are compared for it."""
DELIMITERS = (",", ";", "\t", "|", " ")
NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?", re.ASCII)
MISSING = frozenset({"", "nan", "-nan", "n/a", "na", "null", "none"})
"""Cells without a value, in lower case."""
UNIT_IN_NAME = re.compile(r"(?P<name>.*\S)\s*[\[(](?P<unit>[^\])]*)[\])]")
COMMENT = re.compile(r"^[#%/\s]+")
"""Characters that some programs write in front of the first name."""
MARKS = ((codecs.BOM_UTF8, "utf-8-sig"), (codecs.BOM_UTF16_LE, "utf-16"), (codecs.BOM_UTF16_BE, "utf-16"))
SPELLINGS = {
    "nm": "N*m", "newton": "N", "newtonmeter": "N*m", "nmm": "N*mm", "mnm": "mN*m", "ncm": "N*cm",
    "lb": "lbf", "lbs": "lbf", "pound": "lbf", "lbin": "lbf*in", "inlb": "lbf*in", "inlbf": "lbf*in",
    "lbfin": "lbf*in", "lbft": "lbf*ft", "ftlb": "lbf*ft", "ftlbf": "lbf*ft", "lbfft": "lbf*ft", "kgfm": "kgf*m",
    "kgfcm": "kgf*cm", "kgfmm": "kgf*mm", "°/s": "deg/s", "deg/sec": "deg/s", "dps": "deg/s", "rad/sec": "rad/s",
    "1/s": "rad/s", "m/s2": "m/s^2", "m/s/s": "m/s^2", "mm/s2": "mm/s^2", "mg": "mg_0", "sec": "s", "seconds": "s",
    "msec": "ms", "usec": "us", "µs": "us", "nsec": "ns", "°": "deg",
}  # fmt: skip
"""Units as instruments spell them, without blanks, hyphens, dots and stars, in lower case."""


@dataclass(frozen=True)
class TableLayout:
    """Layout of a table in a text file."""

    encoding: str
    delimiter: str
    decimal: str
    names: tuple[str, ...]
    """Names of the columns, without their units; "1", "2" and so on where the file names none."""
    written: tuple[str, ...]
    """Names as they are written."""
    units: tuple[str, ...]
    """Unit of each column as it is written; "" where the file states none."""
    first: int
    """Number of the line with the first row of numbers, from 1."""
    preamble: str
    """Lines above the names."""
    named: bool
    """Whether the file names its columns."""

    @property
    def places(self) -> dict[str, list[int]]:
        """Places of the columns that answer to a name: as it is written, or without a unit or a comment's mark."""
        places: dict[str, list[int]] = {}
        for place, spellings in enumerate(zip(self.written, self.names, strict=True)):
            for spelling in dict.fromkeys((*spellings, *(COMMENT.sub("", name) for name in spellings))):
                places.setdefault(spelling, []).append(place)
        return places

    def unit(self, places: Sequence[int], si: str) -> str | None:
        """Return the unit that the file states of some columns; None: none, several, or none of the dimension."""
        known = {known_unit(self.units[place], si) for place in places}
        return known.pop() if len(known) == 1 else None


def known_unit(text: str, si: str) -> str | None:
    """Return the name by which we know a unit that an instrument wrote; None: it is none of the dimension of ``si``."""
    plain = text.strip().replace("²", "2").replace("·", "*").replace("⋅", "*")
    for name in (plain, plain.replace("s2", "s^2"), SPELLINGS.get(re.sub(r"[\s*.-]", "", plain).lower(), "")):
        try:
            if name and scale(name, si) > 0:
                return name
        except UnitError:
            continue
    return None


def layout(path: str | Path, delimiter: str | None = None, decimal: str | None = None) -> TableLayout:
    """Tell the layout of a table in a text file.

    Args:
        path: the file.
        delimiter: character between cells, where it is known.
        decimal: decimal mark, where it is known.

    Raises:
        RunError: it is no text, or holds no rows of numbers.
        RigError: it is a folder, a FIFO or a device.
        OSError: it cannot be read.
    """
    require_file(path)
    with open(path, "rb") as file:
        data = file.read(SAMPLE)
    encoding, text = _decoded(data, Path(path).name)
    lines = text.splitlines()
    if len(data) == SAMPLE:
        lines.pop()  # it is cut
    # A preamble is short: the rows from the middle on are rows of numbers.
    typical = [line for line in lines[len(lines) // 2 :] if line.strip()][:ROWS]
    pairs = [(d, m) for d in _choices(delimiter, DELIMITERS) for m in _choices(decimal, ".,") if d != m]
    counts = {pair: _numbers_and_others(_cells(typical, pair[0]), pair[1]) for pair in pairs}
    best = max(pairs, key=lambda pair: (counts[pair][0], -counts[pair][1]))
    if not counts[best][0]:
        raise RunError(f"no rows of numbers in {Path(path).name}: give a table as text (CSV), one row a sample")
    rows = _Rows(_cells(lines, best[0]), _cells(typical, best[0]), best[1])
    names, units, first = rows.head()
    parts = [UNIT_IN_NAME.fullmatch(name) for name in names]
    behind = [part["unit"] if part else "" for part in parts]
    return TableLayout(
        encoding=encoding, delimiter=best[0], decimal=best[1], named=bool(names), first=first + 1,
        names=tuple(part["name"] if part else name for part, name in zip(parts, names, strict=True)) or rows.numbers,
        written=names or rows.numbers,
        units=tuple(units[i] if i < len(units) and units[i] else unit for i, unit in enumerate(behind))
        or ("",) * len(rows.numbers),
        preamble="\n".join(lines[: max(first - bool(names) - bool(units), 0)]),
    )  # fmt: skip


def _choices(declared: str | None, usual: Sequence[str]) -> tuple[str, ...]:
    return tuple(usual) if declared is None else (declared,)


def _decoded(data: bytes, name: str) -> tuple[str, str]:
    """Encoding and text of a file's beginning."""
    encoding = next((encoding for mark, encoding in MARKS if data.startswith(mark)), "utf-8")
    cut = data[: len(data) - len(data) % 2] if encoding == "utf-16" else data
    try:
        text = codecs.getincrementaldecoder(encoding)().decode(cut)
    except UnicodeDecodeError:
        encoding, text = "cp1252", data.decode("cp1252", "replace")
    if any(ord(character) < 32 and character not in "\t\r\n\f" for character in text):
        raise RunError(f"not a text file {name}: give a table as text (CSV)")
    return encoding, text


def _cells(lines: Sequence[str], delimiter: str) -> list[list[str]]:
    if delimiter == " ":
        return [line.split() for line in lines]
    try:
        rows = list(csv.reader(lines, delimiter=delimiter, skipinitialspace=True))
    except csv.Error:
        return []
    return [[cell.strip() for cell in row] for row in rows]


def _is_number(cell: str, decimal: str) -> bool:
    return NUMBER.fullmatch(cell if decimal == "." else cell.replace(".", "x").replace(decimal, ".")) is not None


def _numbers_and_others(rows: list[list[str]], decimal: str) -> tuple[int, int]:
    kinds = Counter(_is_number(cell, decimal) for row in rows for cell in row if cell.lower() not in MISSING)
    return kinds[True], kinds[False]


class _Rows:
    """Rows of cells, and what a row of numbers looks like."""

    def __init__(self, rows: list[list[str]], typical: list[list[str]], decimal: str) -> None:
        self.rows, self.decimal = rows, decimal
        self.width = Counter(map(len, typical)).most_common(1)[0][0]
        whole = [row for row in typical if len(row) == self.width]
        columns = [[cell for cell in column if cell.lower() not in MISSING] for column in zip(*whole, strict=True)]
        self.texts = {i for i, column in enumerate(columns) if 2 * sum(map(self._number, column)) < len(column)}

    @property
    def numbers(self) -> tuple[str, ...]:
        """Names of columns that have none."""
        return tuple(str(i + 1) for i in range(self.width))

    def head(self) -> tuple[tuple[str, ...], tuple[str, ...], int]:
        """Names and units of the columns, () where there are none, and the index of the first row of numbers."""
        first = next(i for i, row in enumerate(self.rows) if self._of_numbers(row))
        while first and self._wide(first - 1) and any(map(self._number, self.rows[first - 1])):
            first -= 1  # a row with a cell that cannot be read: a sample, no names
        if not (first and self._wide(first - 1)):
            return (), (), first
        above = tuple(self.rows[first - 1])
        if first > 1 and self._wide(first - 2) and not any(map(self._number, self.rows[first - 2])) and _units(above):
            return tuple(self.rows[first - 2]), above, first
        return above, (), first

    def _number(self, cell: str) -> bool:
        return _is_number(cell, self.decimal)

    def _wide(self, index: int) -> bool:
        return len(self.rows[index]) >= self.width

    def _of_numbers(self, row: list[str]) -> bool:
        cells = [cell for i, cell in enumerate(row) if i not in self.texts and cell.lower() not in MISSING]
        return len(row) == self.width and bool(cells) and all(map(self._number, cells))


def _units(cells: Sequence[str]) -> bool:
    """Whether a row states units: most of its cells are units of a quantity that we read."""
    known = [any(known_unit(cell, si) for si in ("s", "N", "N*m", "rad/s", "m/s^2", "rad")) for cell in cells if cell]
    return 2 * sum(known) > len(known)
