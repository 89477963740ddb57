"""Files that appear under their name only when they are complete."""

import os
import re
import secrets
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from rig.exceptions import RigError

TEMPORARY = re.compile(r"\.(?P<name>.+)\.[0-9a-f]{8}")
"""Name of a file that is not complete yet, or never was: the process was killed."""


def check_output(path: str | os.PathLike[str], *, overwrite: bool = False) -> None:
    """Raise ``RigError`` when there is something at ``path`` that may not be overwritten, or no folder for it."""
    if not overwrite and os.path.lexists(path):
        raise RigError(f"output exists {path}: choose another name, recorded runs are never overwritten")
    if not Path(path).parent.is_dir():
        raise RigError(f"no folder {Path(path).parent}: create it first")


@contextmanager
def replacing(path: str | os.PathLike[str], *, overwrite: bool = False) -> Iterator[IO[bytes]]:
    """Open a temporary file beside ``path``, and give it that name when the block ends well.

    Raises:
        RigError: ``path`` exists and ``overwrite`` is False.
        OSError: the folder is missing or cannot be written.
    """
    check_output(path, overwrite=overwrite)
    target = Path(path)
    temporary = target.with_name(f".{target.name}.{secrets.token_hex(4)}")
    try:
        with naming(target), open(temporary, "xb") as stream:
            yield stream
            stream.flush()
            os.fsync(stream.fileno())
        publish(temporary, target, overwrite=overwrite)
    except BaseException:
        with suppress(FileNotFoundError):
            os.unlink(temporary)
        raise


@contextmanager
def naming(path: str | os.PathLike[str]) -> Iterator[None]:
    """Let an error of the system say which file it met, as where the disk is full."""
    try:
        yield
    except OSError as error:
        error.filename = error.filename or os.fspath(path)
        raise


def publish(temporary: str | os.PathLike[str], target: Path, *, overwrite: bool = False) -> None:
    """Give a finished file its name in one step, never over a file that appeared meanwhile."""
    if overwrite:
        os.replace(temporary, target)
        return
    try:
        os.link(temporary, target)
    except FileExistsError:
        check_output(target)
    except OSError:  # a file system without hard links
        check_output(target)
        os.replace(temporary, target)
        return
    os.unlink(temporary)
