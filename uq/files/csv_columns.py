"""Named columns of a table in a text file (CSV): how they are declared, and the numbers in them.

``inertia import`` and ``inertia centre`` declare columns alike; docs/tables.md explains it.
"""

import csv
from array import array
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from identify.signals.run import RunError
from uq.files.document import ExperimentError, Table

LONGEST = 2**20
"""Characters that a cell may have."""


@dataclass(frozen=True)
class Columns:
    """Which columns of a table hold which signal."""

    names: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """The columns of each signal, such as ``{"force": ("Fx", "Fy", "Fz")}``."""
    delimiter: str = ","
    """What stands between cells."""
    decimal: str = "."
    """What stands between a number's whole part and its decimals."""


def parse_columns(table: Table, signals: Mapping[str, int | Sequence[str]]) -> Columns:
    """Return the columns that a table of an experiment or map file names.

    Args:
        table: with a list of names for each signal, ``delimiter`` and ``decimal``; all are optional.
        signals: how many columns each signal has (1: a string, not a list); or the keys of a table of names.

    Raises:
        ExperimentError: not so many names, one named twice, or a delimiter that cannot be.
    """
    names = {key: _names(table, key, count) for key, count in signals.items() if key in table.content}
    used = [name for group in names.values() for name in group]
    for name in used:
        if used.count(name) > 1:
            raise ExperimentError(f"column {name!r} is named twice in [{table.where}]: name each column once")
    for key in signals:
        table.raw(key, None)
    delimiter, decimal = table.typed("delimiter", str, ","), table.choice("decimal", (".", ","), ".")
    if len(delimiter) != 1 or delimiter in '"\r\n' or delimiter == decimal:
        raise ExperimentError(
            f"{table.path('delimiter')} is {delimiter!r}: write one character other than the decimal mark"
        )
    return Columns(names, delimiter, decimal)


def _names(table: Table, key: str, count: int | Sequence[str]) -> tuple[str, ...]:
    if not isinstance(count, int):
        parts = Table(table.path(key), table.raw(key))
        names = tuple(parts.typed(part, str) for part in count)
        parts.finish()
        return names
    if count == 1:
        return (table.typed(key, str),)
    raw = table.raw(key)
    if not isinstance(raw, list) or len(raw) != count or not all(isinstance(name, str) for name in raw):
        raise ExperimentError(f"{table.path(key)} is {raw!r}: write the names of {count} columns")
    return tuple(raw)


def read_columns(path: str | Path, columns: Columns) -> dict[str, np.ndarray]:
    """Read the declared columns of a text file whose first line names its columns.

    Returns:
        The numbers of each signal, as they stand in the file, shape (n, number of columns).

    Raises:
        RunError: not text, empty, a column missing or twice in the head, a row of another length than the head, a
            cell that is not a finite number.
        OSError: the file cannot be read.
    """
    named = Path(path).name
    try:
        with open(path, encoding="utf-8-sig", newline="") as file:
            return _read(named, csv.reader(file, delimiter=columns.delimiter, strict=True), columns)
    except UnicodeDecodeError:
        raise RunError(f"not a text file {path}: give a table as text (CSV) in UTF-8") from None
    except csv.Error as error:
        raise RunError(f"no table in {path} ({error}): give a table as text (CSV)") from None


def _read(named: str, lines: Iterator[list[str]], columns: Columns) -> dict[str, np.ndarray]:
    head = [cell.strip() for cell in next(lines, [])]
    if not any(head):
        raise RunError(f"no head in {named}: its first line must name the columns")
    places = {name: _place(named, head, name) for group in columns.names.values() for name in group}
    values = {name: array("d") for name in places}
    number = 1
    for number, row in enumerate(lines, start=2):
        if not row:
            continue
        if len(row) != len(head):
            raise RunError(f"row {number} of {named} has {len(row)} cells, its head {len(head)}: correct the table")
        for name, place in places.items():
            values[name].append(_number(named, name, number, row[place], columns.decimal))
    if not all(values.values()):
        raise RunError(f"no rows in {named}: give a head and one row a sample")
    return {key: np.stack([np.frombuffer(values[n]) for n in group], axis=1) for key, group in columns.names.items()}


def _place(named: str, head: list[str], name: str) -> int:
    count = head.count(name.strip())
    if count == 0:
        raise RunError(f"no column {name!r} in {named}: it has {', '.join(head)}")
    if count > 1:
        raise RunError(f"{count} columns {name!r} in {named}: give each its own name")
    return head.index(name.strip())


def _number(named: str, name: str, row: int, cell: str, decimal: str) -> float:
    try:
        value = float(cell.replace(decimal, ".") if decimal != "." else cell)
    except ValueError:
        value = float("nan")
    if not abs(value) < float("inf") or "_" in cell:
        raise RunError(f"column {name!r} in {named} is {cell.strip()!r} at row {row}: write a finite number")
    return value
