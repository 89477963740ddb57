"""The layout of a table in a text file: encoding, delimiter, decimal mark, names of the columns, units, first row.

Loggers write lines about themselves above the names, and units below or behind them. What tells the numbers from all
that is that the rows of numbers are alike; their delimiter and decimal mark are those that make the most numbers.
"""

import codecs
import csv
import re
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path

from identify.signals.run import RunError
from rig.bags.containers import refuse_other
from rig.exceptions import listed, quoted
from rig.read_limits import require_file
from uq.files.units import NUMBER, UnitError, scale

SAMPLE = 2**18
"""Bytes of a file from which its layout is told."""
ROWS = 50
"""Rows that are compared for it."""
BROKEN = 5
"""Broken rows that may stand between the names and the first row of numbers."""
DELIMITERS = ",;\t| "
DECIMALS = ".,"
MISSING = frozenset({"", "nan", "-nan", "n/a", "na", "null", "none"})
"""Cells without a value, in lower case."""
UNIT_IN_NAME = re.compile(r"(?P<name>.*\S)\s*[\[(](?P<unit>[^\])]*)[\])]")
COMMENT = re.compile(r"^[#%/\s]+")
"""Characters that some programs write in front of the first name."""
GROUPED = re.compile(r"([-+]?[1-9]\d{0,2})((?P<mark>[.,'’ \u00a0\u202f])\d{3})((?P=mark)\d{3})*(?P<fraction>[.,]\d*)?")
"""Pattern of a number with marks between thousands."""
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

    path: Path
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

    def place(self, name: str) -> int:
        """Return the place of the column that answers to a name: as it is written, or without unit or comment's mark.

        Raises:
            RunError: there is none, or several.
        """
        places = [
            place
            for place, spellings in enumerate(zip(self.written, self.names, strict=True))
            if name.strip() in (*spellings, *(COMMENT.sub("", spelling) for spelling in spellings))
        ]
        if not places:
            held = f"it has {listed(self.written)}"
            if not self.named:
                held = f"it names none: write their numbers, 1 to {len(self.names)}"
            raise RunError(f"no column {quoted(name)} in {self.path.name}: {held}")
        if len(places) > 1:
            raise RunError(f"{len(places)} columns {quoted(name)} in {self.path.name}: give each its own name")
        return places[0]

    def unit(self, places: Sequence[int], si: str) -> str | None:
        """Return the unit that the file states of some columns; None: none, several, or none of the dimension."""
        units = {known_unit(self.units[place], si) for place in places}
        return units.pop() if len(units) == 1 else None


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
        RigError: it is a folder, a FIFO or a device, or a file of another program.
        OSError: it cannot be read.
    """
    path = Path(path)
    require_file(path)
    with open(path, "rb") as file:
        data = file.read(SAMPLE)
    refuse_other(path, data, str(path))
    encoding, text = _decoded(data, path.name)
    lines = text.splitlines()
    if len(data) == SAMPLE:
        lines.pop()  # it is cut
    # A preamble is short: the rows from the middle on are rows of numbers.
    typical = [line for line in lines[len(lines) // 2 :] if line.strip()][:ROWS]

    def fit(pair: tuple[str, str]) -> tuple[int, int]:
        numbers, others = _numbers_and_others(chain.from_iterable(_cells(typical, pair[0])), pair[1])
        return numbers, -others

    best = max(((d, m) for d in delimiter or DELIMITERS for m in decimal or DECIMALS if d != m), key=fit)
    if not fit(best)[0]:
        raise RunError(f"no rows of numbers in {path.name}: give a table as text (CSV), one row per sample")
    cells, alike = (
        [[ungrouped(cell, best[1]) for cell in row] for row in _cells(part, best[0])] for part in (lines, typical)
    )
    width = Counter(map(len, alike)).most_common(1)[0][0]
    names, units, first, above = _head(cells, [row for row in alike if len(row) == width], best[1])
    last = cells[first - 1] if first and not names else []
    if last and 0 < width - len(last) <= 2 and _names(last) and not _numbers_and_others(last, best[1])[0]:
        raise RunError(f"line {first} of {path.name} has {len(last)} names for {width} columns: name every column")
    written = names or tuple(str(i + 1) for i in range(width))
    parts = [(UNIT_IN_NAME.fullmatch(name) or {"name": name, "unit": ""}) for name in written]
    below = (*units, *[""] * len(written))
    return TableLayout(
        path=path, encoding=encoding, delimiter=best[0], decimal=best[1], written=written, named=bool(names),
        names=tuple(part["name"] for part in parts), first=first + 1,
        units=tuple(unit or part["unit"] for unit, part in zip(below, parts, strict=False)),
        preamble="\n".join(lines[:above]),
    )  # fmt: skip


def ungrouped(cell: str, decimal: str) -> str:
    """Return a cell without the marks between thousands; "1,008" alone stays, since its comma may be decimal."""
    match = GROUPED.fullmatch(cell)
    if match is None or match["mark"] == decimal:
        return cell
    fraction = match["fraction"] or ""
    certain = fraction[:1] == decimal or (not fraction and cell.count(match["mark"]) > 1)
    return cell.replace(match["mark"], "") if certain else cell


def _decoded(data: bytes, name: str) -> tuple[str, str]:
    """Encoding and text of a file's beginning."""
    encoding = next((encoding for mark, encoding in MARKS if data.startswith(mark)), "utf-8")
    try:
        text = codecs.getincrementaldecoder(encoding)().decode(data)  # it may end within a character
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


def _numbers_and_others(cells: Iterable[str], decimal: str) -> tuple[int, int]:
    """Count the cells that are numbers, and those that are neither a number nor missing."""
    if decimal != ".":
        cells = (cell.replace(".", "x").replace(decimal, ".") for cell in cells)
    kinds = Counter(NUMBER.fullmatch(cell) is not None for cell in cells if cell.lower() not in MISSING)
    return kinds[True], kinds[False]


def _head(
    rows: list[list[str]], alike: list[list[str]], decimal: str
) -> tuple[tuple[str, ...], tuple[str, ...], int, int]:
    """Names and units of the columns, () where there are none, the first row of numbers, and how many rows are above.

    Args:
        rows: all rows.
        alike: some rows of numbers, of one width.
        decimal: decimal mark.
    """
    width = len(alike[0])
    least = width - (not any(row[-1] for row in alike))  # a mark behind each row of numbers, and none behind the names
    counts = [_numbers_and_others(column, decimal) for column in zip(*alike, strict=True)]
    texts = {i for i, (numbers, others) in enumerate(counts) if numbers < others}

    def of_numbers(row: list[str]) -> bool:
        numbers, others = _numbers_and_others((cell for i, cell in enumerate(row) if i not in texts), decimal)
        return len(row) == width and numbers > 0 and others == 0

    def kind(i: int) -> str:
        if i < 0 or len(rows[i]) < least:
            return "short"
        return "sample" if _numbers_and_others(rows[i], decimal)[0] else "words"

    first = next((i for i, row in enumerate(rows) if of_numbers(row)), len(rows))
    while kind(first - 1) == "sample":  # it has a cell that cannot be read: no names
        first -= 1
    head = first - 1
    while kind(head) == "short" and head > max(first - 1 - BROKEN, 0):  # a logger began within a row, or left a line
        head -= 1
    if kind(head) != "words" or (head < first - 1 and not (_names(rows[head]) or _units(rows[head]))):
        return (), (), first, first
    words = (*rows[head], *[""] * (width - len(rows[head])))
    if kind(head - 1) == "words" and _units(words):
        return tuple(rows[head - 1]), words, first, head - 1
    return words, (), first, head


def _names(cells: Sequence[str]) -> bool:
    """Whether cells could name columns: all of them differ, and none is empty."""
    return len(set(cells)) == len(cells) and all(cells)


def _units(cells: Sequence[str]) -> bool:
    """Whether a row states units: most of its cells are units of a quantity that we read."""
    recognised = [
        any(known_unit(cell, si) for si in ("s", "N", "N*m", "rad/s", "m/s^2", "rad")) for cell in cells if cell
    ]
    return 2 * sum(recognised) > len(recognised)
