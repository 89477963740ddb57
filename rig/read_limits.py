"""Limits on the reading of a stranger's file: regular files, with a limit on what they unpack to.

A few bytes can claim, or truly hold, gigabytes. A file may unpack to 64 MiB and to 100 times the bytes that were read
of it so far, in pieces of at most 128 MiB. Every library that unpacks is told the limit before it starts.
"""

import json
import math
import os
import stat
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from rig.exceptions import RigError

PathLike = str | os.PathLike[str]
ALLOWANCE = 2**26
"""Bytes that any file may unpack to."""
RATIO = 100
"""Bytes more for each byte read."""
PIECE = 2**27
"""Largest chunk or record [bytes], which are held in memory as a whole."""
SLOW = 8.0
"""Seconds of reading a file after which :data:`watch` is told, once a second."""
watch: Callable[[PathLike, int, int], None] = lambda path, position, size: None  # noqa: E731
"""Called with a file, the bytes that are read and its length, where reading takes long; a command shows a bar."""
VARIABLE = "INERTIA_UNPACK_GIB"
"""Environment variable that raises both the allowance and the largest piece [GiB]."""


class UnpackError(RigError):
    """A file unpacks to more than it may."""


@dataclass
class UnpackBudget:
    """Count of the bytes that a file has unpacked to; what is packed inside it counts to the same budget.

    Attributes:
        name: of the file, for messages.
        read: bytes read of the file so far.
        unpacked: bytes that came of them.
        inside: the following bytes are unpacked from the file: they earn no allowance.
        piece: the largest number of bytes that are held at once.
    """

    name: PathLike
    read: int = 0
    unpacked: int = 0
    inside: bool = False

    def __post_init__(self) -> None:
        extra = _raised()
        self._allowance, self.piece = max(ALLOWANCE, extra), max(PIECE, extra)

    def reached(self, position: int) -> None:
        """So many bytes of the file have been read."""
        if not self.inside:
            self.read = position

    @property
    def left(self) -> int:
        """The largest number of bytes that may come next."""
        return max(0, min(self.piece, self._allowance + RATIO * self.read - self.unpacked))

    def take(self, count: int) -> None:
        """Count what was unpacked, or is about to be. Raises ``UnpackError`` when it is more than ``left``."""
        if count > self.left:
            raise self.exceeded()
        self.unpacked += count

    def exceeded(self) -> UnpackError:
        """The error for more than ``left``."""
        allowance, piece = f"{self._allowance / 2**20:g} MiB", f"{self.piece / 2**20:g} MiB"
        return UnpackError(
            f"too much to unpack in {self.name}: over {allowance} and {RATIO} times the {self.read} bytes read, "
            f"or {piece} at once; if you trust the file, set {VARIABLE}=4 or more"
        )


def _raised() -> int:
    """The bytes that the environment variable allows; 0 without it."""
    text = os.environ.get(VARIABLE, "")
    if not text:
        return 0
    try:
        size = float(text)
    except ValueError:
        size = math.nan
    if not 0 < size < 2**20:  # so written that NaN is refused
        raise RigError(f"the environment variable {VARIABLE} is no number of GiB: set it to 4, for example")
    return round(size * 2**30)


def require_file(path: PathLike) -> None:
    """Refuse what is no regular file: a FIFO or a device may never end, or never begin.

    Raises:
        RigError: it is a folder, a FIFO, a socket or a device.
        OSError: there is none.
    """
    mode = os.stat(path).st_mode
    if not stat.S_ISREG(mode):
        kinds = {stat.S_IFDIR: "a folder", stat.S_IFIFO: "a FIFO", stat.S_IFSOCK: "a socket"}
        raise RigError(f"not a file {path} but {kinds.get(stat.S_IFMT(mode), 'a device')}: give a file")


def read_file(path: PathLike, most: int) -> bytes:
    """Return the first bytes of a file, one more than ``most`` if it has them. Raises as :func:`require_file`."""
    require_file(path)
    with open(path, "rb") as file:
        return file.read(most + 1)


def parse_json(text: str | bytes) -> Any:
    """Return the content of JSON text.

    Raises:
        ValueError: it is no JSON, its lists or objects lie too deep, or a number has thousands of digits.
    """
    try:
        return json.loads(text)
    except RecursionError:
        raise ValueError("lists or objects are nested too deeply") from None
