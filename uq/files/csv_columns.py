"""Named columns of a table in a text file (CSV): how they are declared, and the numbers in them.

``inertia import`` and ``inertia centre`` declare columns in the same way; docs/how-to/tables.md explains it.
"""

import warnings
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, ClassVar, Literal

import numpy as np

from identify.signals.run import RunError
from rig.exceptions import quoted, reason
from rig.toml_tables import TomlTable, WrongKeyError
from uq.files.table_layout import MISSING, TableLayout, layout, ungrouped
from uq.files.units import NUMBER

if TYPE_CHECKING:
    import pandas as pd


@dataclass(frozen=True)
class CsvColumns:
    """Names of the columns of a table that hold each signal."""

    names: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    """Columns of each signal, such as ``{"force": ("Fx", "Fy", "Fz")}``."""
    delimiter: str | None = None
    """Character between cells; None: the file tells it."""
    decimal: str | None = None
    """Decimal mark of the numbers; None: the file tells it."""


class QuaternionColumns(TomlTable, frozen=True, kw_only=True):
    """The columns of a unit quaternion's components."""

    w: str
    x: str
    y: str
    z: str


class ColumnsTable(TomlTable, frozen=True, kw_only=True):
    """Names of the columns of a table that hold each signal: the signals are keys of the subclasses."""

    SIGNALS: ClassVar[tuple[str, ...]]
    """Keys that hold names of columns: a name, several, or a table of names."""
    delimiter: str | None = None
    """Character between cells; missing: the file tells it."""
    decimal: Literal[".", ","] | None = None
    """Decimal mark of the numbers; missing: the file tells it."""

    def __post_init__(self) -> None:
        """Refuse a delimiter that cannot be, and a column that is named twice."""
        names = [name for columns in self.columns.names.values() for name in columns]
        for name in names:
            if names.count(name) > 1:
                raise WrongKeyError("", f"names column {quoted(name)} twice: name each column once")
        mark = self.delimiter
        if mark is not None and (len(mark) != 1 or mark in '"\r\n' or mark == self.decimal):
            raise WrongKeyError("delimiter", "write one character other than the decimal mark", f"is {quoted(mark)}")

    @property
    def columns(self) -> CsvColumns:
        """The columns of each signal that is named."""
        signals = {key: getattr(self, key) for key in self.SIGNALS}
        names = {key: _names(value) for key, value in signals.items() if value is not None}
        return CsvColumns(names, self.delimiter, self.decimal)


def _names(value: str | tuple[str, ...] | TomlTable | Mapping[str, str]) -> tuple[str, ...]:
    if isinstance(value, TomlTable):
        return tuple(value.to_dict().values())
    if isinstance(value, Mapping):
        return tuple(value.values())
    return (value,) if isinstance(value, str) else value


@dataclass(frozen=True)
class CsvTable:
    """Columns of a table as they stand in its file."""

    layout: TableLayout
    places: dict[str, list[int]]
    """Places of the columns of each signal."""
    frame: "pd.DataFrame"
    """The columns by their places."""

    def numbers(self, signal: str, *, complete: bool = False) -> np.ndarray:
        """Return the numbers of a signal, shape (n, number of columns); of an empty cell or NaN: NaN.

        Args:
            signal: its key.
            complete: refuse a cell without a number.

        Raises:
            RunError: a cell is no number, is infinite, or is empty where ``complete``.
        """
        import pandas as pd

        places = self.places[signal]
        cells = self.frame[places]
        # a copy, since pandas' own arrays may be read-only, which scipy's rotations refuse
        values = cells.apply(pd.to_numeric, errors="coerce").to_numpy(float, copy=True)
        bad = np.isinf(values) | np.isnan(values) & (cells.notna().to_numpy() | complete)
        if bad.any():
            column, row = np.argwhere(bad.T)[0]
            cell = quoted(str(cells.iloc[row, column]).strip()) if pd.notna(cells.iloc[row, column]) else "empty or NaN"
            raise RunError(
                f"column {quoted(self.layout.written[places[column]])} in {self.layout.path.name} is {cell} "
                f"at row {self.layout.first + row}: write a finite number"
            )
        return values


def read_columns(path: str | Path, columns: CsvColumns) -> CsvTable:
    """Read the declared columns of a table in a text file.

    Raises:
        RunError: not text, no rows of numbers, a column missing or twice in the head, a row longer than the others.
        RigError: it is a folder, a FIFO or a device.
        OSError: the file cannot be read.
    """
    shape = layout(path, columns.delimiter, columns.decimal)
    places = {signal: [shape.place(name) for name in names] for signal, names in columns.names.items()}
    return CsvTable(shape, places, read_rows(shape))


def read_rows(shape: TableLayout) -> "pd.DataFrame":
    """Read all rows of a table in a text file, the columns by their places.

    Raises:
        RunError: a row is longer than the others.
        OSError: the file cannot be read.
    """
    import pandas as pd

    # A logger that stops may leave half a character of two bytes at the end.
    errors: Literal["ignore", "replace"] = "ignore" if shape.encoding == "utf-16" else "replace"
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", pd.errors.ParserWarning)  # a first row that is longer is cut otherwise
            frame = pd.read_csv(
                shape.path, sep=r"\s+" if shape.delimiter == " " else shape.delimiter, decimal=shape.decimal,
                header=None, names=range(len(shape.names)), index_col=False, skiprows=shape.first - 1,
                skipinitialspace=True, encoding=shape.encoding, encoding_errors=errors, low_memory=False,
                keep_default_na=False,
                na_values=sorted({word for text in MISSING for word in (text, text.upper(), text.title())} | {"NaN"}),
            )  # fmt: skip
    except (pd.errors.ParserError, pd.errors.ParserWarning) as error:
        why = reason(str(error).removeprefix("Error tokenizing data. C error: "))
        why = f"line {shape.first}" if isinstance(error, pd.errors.ParserWarning) else why
        raise RunError(f"a row of {shape.path.name} has more cells than others ({why}): correct the table") from None
    for place in [place for place in frame if not pd.api.types.is_numeric_dtype(frame[place])]:
        frame[place] = frame[place].map(lambda cell: _plain(cell, shape.decimal), na_action="ignore")
    return frame


def _plain(cell: object, decimal: str) -> object:
    """A cell that is a number, as Python writes it; others as they are."""
    if not isinstance(cell, str):
        return cell
    number = ungrouped(cell.strip(), decimal).replace(decimal, ".")
    return number if NUMBER.fullmatch(number) else cell
