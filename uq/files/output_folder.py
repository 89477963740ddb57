"""Write files into a folder, all of them or none; results that are files."""

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


class HasFiles:
    """Mixin of results that bring files of their own, made but not yet written."""

    contents: Mapping[str, str | bytes]
    """Contents of the files by name."""

    def files(self) -> dict[str, bytes]:
        """Return the files' bytes by name."""
        return {name: data.encode() if isinstance(data, str) else data for name, data in self.contents.items()}

    def write(self, folder: str | Path) -> None:
        """Write the files into a folder, all or none; a file of the same name is replaced.

        Raises:
            OSError: the folder cannot be made or written.
        """
        place(self.files(), Path(folder))


def _write(path: Path, data: bytes) -> None:
    """Write a file down to the disk, so that a full one is noticed here."""
    with path.open("wb") as file:
        file.write(data)
        file.flush()
        os.fsync(file.fileno())
