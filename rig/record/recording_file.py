"""The file that a recording grows in, and its channels; a full disk leaves it cut back to its last whole chunk."""

import os
from pathlib import Path
from typing import Literal, NamedTuple

from mcap.writer import Writer

from rig.atomic_files import check_output
from rig.mcap import cdr, message_definitions
from rig.mcap.writer import register
from rig.record.rig_file import DeviceEntry

TYPES = {
    "wrench": message_definitions.WRENCH,
    "imu": message_definitions.IMU,
    "joints": message_definitions.VALUES,
    "values": message_definitions.VALUES,
}


class OutputChannel(NamedTuple):
    """A channel of the file, how its messages are made, and which numbers of a sample they hold."""

    channel: int
    encode: cdr.Encode
    numbers: slice


def outputs(writer: Writer, entry: DeviceEntry) -> list[OutputChannel]:
    """Announce the channels of a device."""
    announced, start = [], 0
    for channel, topic in zip(entry.device.channels, entry.topics, strict=True):
        stop = start + len(channel.signals)
        kind = TYPES[channel.measures]
        encode = cdr.encoder(kind, entry.frame_id, channel.names)
        announced.append(OutputChannel(register(writer, kind, topic), encode, slice(start, stop)))
        start = stop
    return announced


class Sink:
    """A new file, written without a buffer of its own; ``whole`` bytes can be read whatever happens next.

    Raises:
        RigError: the file exists or its folder is missing.
        OSError: it cannot be created.
    """

    def __init__(self, path: Path) -> None:
        check_output(path)
        self.path = path
        as_bytes = getattr(os, "O_BINARY", 0)  # Windows writes text unless told otherwise
        self._handle = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL | as_bytes, 0o666)
        self._unwanted, self._was_cut = False, False
        self._position = 0
        self.whole = 0

    def write(self, data: bytes | bytearray | memoryview) -> int:
        """Write all of ``data`` or raise OSError."""
        view = memoryview(data)
        self._was_cut |= os.fstat(self._handle).st_size < self._position
        while view:
            count = os.write(self._handle, view)
            self._position += count
            view = view[count:]
        return len(data)

    def tell(self) -> int:
        """Number of bytes written."""
        return self._position

    def flush(self) -> None:
        """Everything is with the operating system already, where the death of this process does not reach it."""

    def mark_whole(self) -> None:
        """Everything up to here can be read whatever happens next."""
        self.whole = self._position

    def cut_back(self) -> None:
        """Take away what was written since the last ``mark_whole``: half a chunk."""
        os.ftruncate(self._handle, self.whole)
        self._position = self.whole

    @property
    def place(self) -> Literal["there", "moved", "deleted", "cut"]:
        """State of the file under its name; what is written to a deleted file is lost with the process.

        One that another program has cut has zeros up to where writing went on.
        """
        here = os.fstat(self._handle)
        if not here.st_nlink:
            return "deleted"
        self._was_cut |= here.st_size < self._position
        if self._was_cut:
            return "cut"
        try:
            return "there" if os.path.samestat(here, os.stat(self.path)) else "moved"
        except OSError:
            return "moved"

    def remove(self) -> None:
        """Delete the file, if it is still there; by ``close``, where an open file cannot be deleted (Windows)."""
        if self.place == "there":
            try:
                os.unlink(self.path)
            except PermissionError:
                self._unwanted = True

    def close(self) -> None:
        """Bring the file to disk and close it."""
        try:
            os.fsync(self._handle)
        finally:
            unwanted = self._unwanted and self.place == "there"
            os.close(self._handle)
            if unwanted:
                os.unlink(self.path)


def run_path(output: str | os.PathLike[str]) -> Path:
    """The file to record to: ``output`` itself, or the next free ``run_0001.mcap`` where it is a folder (or ends in /).

    Raises:
        RigError: the file exists or its folder is missing.
    """
    text = os.fspath(output)
    if not text.endswith(os.sep) and not os.path.isdir(text):
        path = Path(text)
        check_output(path)
        return path
    folder = Path(text)
    folder.mkdir(parents=True, exist_ok=True)
    taken = [int(p.stem[4:]) for p in folder.glob("run_*.mcap") if p.stem[4:].isdigit()]
    return folder / f"run_{max(taken, default=0) + 1:04d}.mcap"
