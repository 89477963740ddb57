"""A TOML table that knows where it stands: typed values out, or one line that names the key."""

import hashlib
import tomllib
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from datetime import date, datetime
from pathlib import Path
from typing import Any, Literal, TypeVar

import numpy as np

from rig.toml_tables import TomlError, TomlTable, read_table
from uq.files.units import UnitError, quantity

T = TypeVar("T")
Declared = TypeVar("Declared", bound=TomlTable)


class ExperimentError(ValueError):
    """A mistake in an experiment file, in one line: what, where, what to do."""


def read_document(path: str | Path, what: str) -> tuple[dict[str, Any], str]:
    """Return the content of a TOML file and the file's SHA-256.

    Args:
        path: the file.
        what: what it should be, for messages.

    Raises:
        ExperimentError: it is no TOML.
        OSError: it cannot be read.
    """
    data = Path(path).read_bytes()
    try:
        return tomllib.loads(data.decode()), hashlib.sha256(data).hexdigest()
    except UnicodeDecodeError:
        raise ExperimentError(f"not a text file {path}: give {what} in TOML") from None
    except tomllib.TOMLDecodeError as error:
        raise ExperimentError(f"not TOML {path}: {error}") from None


@contextmanager
def in_file(path: str | Path) -> Iterator[None]:
    """Name the file in the message of a mistake in it."""
    try:
        yield
    except ExperimentError as error:
        raise ExperimentError(f"{error} (in {path})") from None


REQUIRED: Any = object()
LARGEST = 1_000_000
"""Largest whole number that a file may hold."""


class Table:
    """A TOML table that knows where it stands and which of its keys have been used."""

    def __init__(self, where: str, content: object):
        if not isinstance(content, Mapping):
            raise ExperimentError(f"{where} is {content!r}: write a table")
        self.where, self.content, self.used = where, content, set[str]()

    def path(self, key: str) -> str:
        """Return a key with the tables above it."""
        return f"{self.where}.{key}" if self.where else key

    def raw(self, key: str, default: Any = REQUIRED) -> Any:
        """Return a value as it stands in the file."""
        self.used.add(key)
        if key not in self.content and default is REQUIRED:
            raise ExperimentError(f"missing key {self.path(key)}: add it")
        return self.content.get(key, default)

    def quantity(self, key: str, unit: str, default: Any = REQUIRED, *, positive: bool = False) -> Any:
        """Return a value in ``unit``."""
        raw = self.raw(key, default)
        if raw is default and key not in self.content:
            return default
        value = _quantity(self.path(key), raw, unit)
        if positive and value <= 0:
            raise ExperimentError(f"{self.path(key)} is {raw!r}: write a value above zero")
        return value

    def vector(self, key: str, unit: str, default: Any = REQUIRED, *, size: Literal[2, 3] = 3) -> np.ndarray:
        """Return three values in ``unit``, one an axis, or the two ends of a range, shape (size,)."""
        raw = self.raw(key, default)
        if not isinstance(raw, list) or len(raw) != size:
            wanted = {2: "two values with their units", 3: "three values with their units, one an axis"}[size]
            raise ExperimentError(f"{self.path(key)} is {raw!r}: write {wanted}")
        return np.array([_quantity(f"{self.path(key)}[{i}]", item, unit) for i, item in enumerate(raw)])

    def numbers(self, key: str, shape: tuple[int, ...], default: Any = REQUIRED) -> Any:
        """Return finite numbers without a unit, an array of this shape: the entries of a matrix, of a quaternion."""
        raw = self.raw(key, default)
        if key not in self.content:
            return default
        try:
            values = np.array(raw, float) if _only_numbers(raw) else np.array(np.nan)
        except ValueError:  # rows of unequal length
            values = np.array(np.nan)
        if values.shape != shape or not np.isfinite(values).all():
            wanted = f"{shape[0]} rows of {shape[1]} finite numbers" if shape else "a finite number"
            raise ExperimentError(f"{self.path(key)} is {raw!r}: write {wanted}")
        return values

    def choice(self, key: str, choices: tuple[str, ...], default: Any = REQUIRED) -> Any:
        """Return one of these words, or the default."""
        value = self.raw(key, default)
        if key not in self.content:
            return value
        if value not in choices:
            raise ExperimentError(f"{self.path(key)} is {value!r}: choose one of {', '.join(choices)}")
        return value

    def typed(self, key: str, kind: type, default: Any = REQUIRED) -> Any:
        """Return a string, a whole number or a truth value."""
        value = self.raw(key, default)
        if kind is int and isinstance(value, int) and abs(value) > LARGEST:
            raise ExperimentError(f"{self.path(key)} is out of range: write a smaller number")
        if key in self.content and (not isinstance(value, kind) or (kind is not bool and isinstance(value, bool))):
            name = {str: "a string", int: "a whole number", bool: "true or false"}[kind]
            raise ExperimentError(f"{self.path(key)} is {value!r}: write {name}")
        return value

    def date(self, key: str, default: Any = REQUIRED) -> Any:
        """Return a day, written as TOML's date or as its string."""
        return default if self.raw(key, default) is default else day(self.path(key), self.content[key])

    def mapping(self, key: str) -> Mapping[str, Any]:
        """Return a table's content, empty when it is missing."""
        return Table(self.path(key), self.raw(key, {})).content

    def table(self, key: str, build: "Callable[[Table], T]", default: Any = REQUIRED) -> T:
        """Build a value from a table."""
        return build(Table(self.path(key), self.raw(key, default)))

    def declared(self, key: str, table: "type[Declared]", default: Any = REQUIRED) -> "Declared":
        """Return the values of a table that is declared as a type."""
        try:
            return read_table(self.path(key), self.raw(key, default), table)
        except TomlError as error:
            raise ExperimentError(str(error)) from None

    def tables(self, key: str, build: "Callable[[Table], T]") -> tuple[T, ...]:
        """Build a value from each table of an array."""
        items = self.raw(key, [])
        if not isinstance(items, list):
            raise ExperimentError(f"{self.path(key)} is a table: write [[{self.path(key)}]], one for each")
        return tuple(build(Table(f"{self.path(key)}[{_label(i, item)}]", item)) for i, item in enumerate(items))

    def finish(self) -> None:
        """Refuse the keys that nobody asked for."""
        unknown = sorted(set(self.content) - self.used)
        if unknown:
            known = ", ".join(sorted(self.used))
            raise ExperimentError(f"unknown key {self.path(unknown[0])}: the keys here are {known}")


def day(where: str, raw: object) -> date:
    """Return a day that stands somewhere in a file."""
    if isinstance(raw, datetime):
        return raw.date()
    try:
        return raw if isinstance(raw, date) else date.fromisoformat(raw if isinstance(raw, str) else "")
    except ValueError:
        raise ExperimentError(f"{where} is {raw!r}: write a date, such as 2026-03-31") from None


def _only_numbers(raw: object) -> bool:
    """Whether a number, or lists of numbers: no strings, no truth values."""
    if isinstance(raw, list):
        return all(map(_only_numbers, raw))
    return isinstance(raw, (int, float)) and not isinstance(raw, bool) and bool(abs(raw) < 1e300)


def _label(index: int, item: object) -> str:
    name = item.get("name") if isinstance(item, Mapping) else None
    return name if isinstance(name, str) else str(index)


def _quantity(where: str, raw: object, unit: str) -> float:
    try:
        return quantity(raw, unit)
    except UnitError as error:
        raise ExperimentError(f"{where} {error}") from None
