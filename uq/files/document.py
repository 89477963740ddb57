"""TOML files: their content, and the error that names the file and the key."""

import hashlib
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rig.read_limits import require_file
from rig.toml_tables import TomlError, parse_toml
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
    require_file(path)
    data = Path(path).read_bytes()
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
