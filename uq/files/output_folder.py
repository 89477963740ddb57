"""Write files into a folder, all of them or none."""

import os
import tempfile
from collections.abc import Mapping
from pathlib import Path

from rig.atomic_files import naming


def place(content: Mapping[str, bytes], out: Path) -> None:
    """Write files into a folder: all are on the disk before the first is moved into place.

    Raises:
        OSError: the folder cannot be made or written.
    """
    out.mkdir(parents=True, exist_ok=True)
    with naming(out), tempfile.TemporaryDirectory(prefix=".partial-", dir=out) as folder:
        for name, data in content.items():
            _write(Path(folder, name), data)
        for name in content:
            os.replace(Path(folder, name), out / name)


def _write(path: Path, data: bytes) -> None:
    """Write a file down to the disk, so that a full one is noticed here."""
    with path.open("wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())
