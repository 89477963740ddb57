"""Named columns of a table in a text file (CSV): how they are declared, and the numbers in them.

``inertia import`` and ``inertia centre`` declare columns in the same way; docs/how-to/tables.md explains it.
"""

import csv
from array import array
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar, Literal

import numpy as np

from identify.signals.run import RunError
from rig.exceptions import listed, quoted
from rig.read_limits import require_file
from rig.toml_tables import TomlTable, WrongKeyError


@dataclass(frozen=True)
class CsvColumns:
    """Names of the columns of a table that hold each signal."""

    names: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """Columns of each signal, such as ``{"force": ("Fx", "Fy", "Fz")}``."""
    delimiter: str = ","
    """Character between cells."""
    decimal: str = "."
    """Decimal sign of the numbers."""


class ColumnsTable(TomlTable, frozen=True, kw_only=True):
    """Names of the columns of a table that hold each signal: the signals are keys of the subclasses."""

    SIGNALS: ClassVar[tuple[str, ...]]
    """Keys that hold names of columns: a name, several, or a table of names."""
    delimiter: str = ","
    """Character between cells."""
    decimal: Literal[".", ","] = "."
    """Decimal sign of the numbers."""

    def __post_init__(self) -> None:
        """Refuse a delimiter that cannot be, and a column that is named twice."""
        names = [name for columns in self.columns.names.values() for name in columns]
        for name in names:
            if names.count(name) > 1:
                raise WrongKeyError("", f"names column {quoted(name)} twice: name each column once")
        if len(self.delimiter) != 1 or self.delimiter in '"\r\n' or self.delimiter == self.decimal:
            raise WrongKeyError(
                "delimiter", "write one character other than the decimal mark", f"is {quoted(self.delimiter)}"
            )

    @property
    def columns(self) -> CsvColumns:
        """The columns of each signal that is named."""
        signals = {key: getattr(self, key) for key in self.SIGNALS}
        names = {key: _names(value) for key, value in signals.items() if value is not None}
        return CsvColumns(names, self.delimiter, self.decimal)


def _names(value: str | tuple[str, ...] | TomlTable) -> tuple[str, ...]:
    if isinstance(value, TomlTable):
        return tuple(value.to_dict().values())
    return (value,) if isinstance(value, str) else value


def read_columns(path: str | Path, columns: CsvColumns) -> dict[str, np.ndarray]:
    """Read the declared columns of a text file whose first line names its columns.

    Returns:
        The numbers of each signal, as they stand in the file, shape (n, number of columns).

    Raises:
        RunError: not text, empty, a column missing or twice in the head, a row of another length than the head, a
            cell that is not a finite number.
        RigError: it is a folder, a FIFO or a device.
        OSError: the file cannot be read.
    """
    require_file(path)
    named = Path(path).name
    try:
        with open(path, encoding="utf-8-sig", newline="") as file:
            return _read(named, csv.reader(file, delimiter=columns.delimiter, strict=True), columns)
    except UnicodeDecodeError:
        raise RunError(f"not a text file {path}: give a table as text (CSV) in UTF-8") from None
    except csv.Error as error:
        raise RunError(f"no table in {path} ({error}): give a table as text (CSV)") from None


def _read(named: str, lines: Iterator[list[str]], columns: CsvColumns) -> dict[str, np.ndarray]:
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
        raise RunError(f"no column {quoted(name)} in {named}: it has {listed(head)}")
    if count > 1:
        raise RunError(f"{count} columns {quoted(name)} in {named}: give each its own name")
    return head.index(name.strip())


def _number(named: str, name: str, row: int, cell: str, decimal: str) -> float:
    try:
        value = float(cell.replace(decimal, ".") if decimal != "." else cell)
    except ValueError:
        value = float("nan")
    if not abs(value) < float("inf") or "_" in cell:
        raise RunError(
            f"column {quoted(name)} in {named} is {quoted(cell.strip())} at row {row}: write a finite number"
        )
    return value
