"""TOML files: their content, and the error that names the file and the key; the content with other values.

Changed content is read anew: the same keys, units and messages as in the file.
"""

import hashlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from copy import deepcopy
from pathlib import Path
from typing import Any

from rig.exceptions import choose, quoted
from rig.read_limits import read_file
from rig.toml_tables import LARGEST_FILE, TomlError, parse_toml
from uq.files.mistakes import ExperimentError


def read_document(path: str | Path, what: str) -> tuple[dict[str, Any], str]:
    """Return the content of a TOML file and the file's SHA-256.

    Args:
        path: the file.
        what: what it should be, for messages.

    Raises:
        ExperimentError: it is no TOML.
        RigError: it is a folder, a FIFO or a device.
        OSError: it cannot be read.
    """
    data = read_file(path, LARGEST_FILE)
    try:
        return parse_toml(data), hashlib.sha256(data).hexdigest()
    except TomlError as error:
        raise ExperimentError(f"not TOML {path}: {error}: give {what} in TOML") from None


@contextmanager
def in_file(path: str | Path) -> Iterator[None]:
    """Name the file in the message of a mistake in it."""
    try:
        yield
    except ExperimentError as error:
        raise ExperimentError(f"{error} (in {path})") from None


Change = Callable[[Mapping[str, Any], Mapping[str, Any]], dict[str, Any]]
"""Function from the keys of a table, and others to put in their place, to its new keys."""


def with_keys(table: Mapping[str, Any], keys: Mapping[str, Any]) -> dict[str, Any]:
    """Return a table with other keys; None leaves a key out. Tuples count as lists, as in TOML."""
    return {key: _as_read(value) for key, value in {**table, **keys}.items() if value is not None}


def with_entry(
    document: Mapping[str, Any],
    table: str,
    name: str,
    keys: Mapping[str, Any],
    needed: Sequence[str],
    change: Change = with_keys,
) -> dict[str, Any]:
    """Return the content with other keys in an entry of ``[[table]]`` or ``[table.NAME]``, or with a new entry.

    Args:
        document: the content.
        table: ``source``, ``estimator`` or ``trajectory``.
        name: of the entry.
        keys: to put in place of those of the same names.
        needed: keys without which there is no new entry.
        change: makes the entry's new keys.

    Raises:
        ExperimentError: there is no such entry, and the keys are not those of a new one.
    """
    entries = _entries(document, table)
    if name not in entries and not set(needed) <= set(keys):
        add = f"or give {', '.join(needed)} to add it"
        raise ExperimentError(f"unknown {table} {quoted(name)}: {choose(name, entries)}, {add}")
    entries[name] = change(entries.get(name, {}), keys)
    named = table == "trajectory"
    content = entries if named else [{"name": entry_name, **entry} for entry_name, entry in entries.items()]
    return {**deepcopy(dict(document)), table: deepcopy(content)}


def _entries(document: Mapping[str, Any], table: str) -> dict[str, Any]:
    """Entries by name, those of a list without it."""
    content = document.get(table, [])
    if isinstance(content, Mapping):
        return dict(content)
    return {entry["name"]: {key: value for key, value in entry.items() if key != "name"} for entry in content}


def _as_read(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _as_read(item) for key, item in value.items()}
    return [_as_read(item) for item in value] if isinstance(value, (list, tuple)) else value
