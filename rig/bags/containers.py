"""The containers of recordings, by their first bytes: MCAP, rosbag2's SQLite (.db3), ROS 1 bags, zstd around these.

A rosbag2 folder is one run, its files in the order of ``metadata.yaml`` or of their numbers. Every container gives its
messages as chunks of MCAP records, a megabyte or a chunk at a time, so that a file of any length takes little memory.
"""

import hashlib
import os
import re
import tempfile
from collections.abc import Iterator
from pathlib import Path

import zstandard

from rig.bags.message_packing import ZSTD, ContainerFile
from rig.exceptions import RigError, listed
from rig.mcap.records import MAGIC, Batch, Definitions, Scanner, batches, damage
from rig.read_limits import UnpackBudget, require_file

PathLike = str | os.PathLike[str]
BLOCK = 2**9
"""Compressed bytes at a time: they become 16 MiB at most."""
FRAME = 2**12
"""Bytes that a zstd frame counts for, however little it holds."""
LONGEST_METADATA = 2**24
"""Bytes of a metadata.yaml; a file of a run takes some hundred."""
TEXTS = (".csv", ".tsv", ".txt", ".lvm", ".dat", ".asc")
"""Ends of the names of tables as text, which `inertia import` takes."""
THEN = ", then `inertia import FILE.csv -o RUN.mcap`"
BY_NAME = {
    **dict.fromkeys((".xlsx", ".xls", ".ods"), ("a workbook", f"save its sheet as CSV{THEN}")),
    **dict.fromkeys((".npz", ".npy", ".mat"), ("arrays", f"write them as columns of a CSV{THEN}")),
}
"""Files of numbers by the end of their names: their kind, and what to do."""
OTHERS = {
    b"TDSm": ("TDMS (LabVIEW)", f"write its channels as CSV, in LabVIEW or with npTDMS{THEN}"),
    b"MDF ": ("MDF", f"write its channels as CSV, with asammdf{THEN}"),
    b"DEWESOFT": ("DEWESoft", f"export it as text in DEWESoft{THEN}"),
    b"ARROW1": ("Arrow", f"write it as CSV, with pandas{THEN}"),
    b"\x89HDF": ("HDF5", f"write its channels as columns of a CSV{THEN}"),
    b"MATLAB": ("MATLAB", f"write its channels as columns of a CSV, with writematrix{THEN}"),
    b"PAR1": ("Parquet", f"write it as CSV, with pandas{THEN}"),
    b"ULog": ("PX4 ULog", f"convert it with `ulog2csv`{THEN}"),
    b"#ROSBAG V1": ("ROS 1 bag of version 1", "convert it with `rosbag fix` or record again"),
    b"\x1f\x8b": ("gzip", "unpack it first"),
    b"PK\x03\x04": ("ZIP", "unpack it first"),
    b"BZh": ("bzip2", "unpack it first"),
    b"\x04\x22\x4d\x18": ("LZ4", "unpack it first"),
    b"\xfd7zXZ": ("XZ", "unpack it first"),
}
"""First bytes of what we do not read, its name, and what to do."""


class McapFile(ContainerFile):
    """An MCAP file."""

    _scanner: Scanner

    @property
    def sha256(self) -> str:
        """The file's hash, once all its batches are taken."""
        return self._scanner.sha256

    @property
    def rest(self) -> int:
        """Bytes behind the file's end mark, which nobody reads, once all its batches are taken."""
        return self._scanner.rest

    def batches(self, definitions: Definitions, types: set[str]) -> Iterator[Batch]:
        """All messages, chunk by chunk."""
        with open(self.path, "rb") as stream:
            self._scanner = Scanner(self.name, stream, self.budget)
            yield from batches(self._scanner, definitions, self.budget, self.name)

    def damage(self, why: str) -> RigError:
        """The error for what is wrong with the chunk read last."""
        return damage(self.name, self._scanner.position, why)


class ZstdFile(ContainerFile):
    """A compressed file of any kind, unpacked to a temporary file while it is read."""

    sha256 = ""
    _inner: ContainerFile

    def batches(self, definitions: Definitions, types: set[str]) -> Iterator[Batch]:
        """The messages of the file inside."""
        with tempfile.TemporaryDirectory(prefix="inertia-") as folder:
            file = Path(folder, "unpacked")
            self.sha256 = _unpack(self.path, file, self.budget)
            self.budget.inside = True
            self._inner = container_file(file, self.budget)
            if isinstance(self._inner, ZstdFile):
                raise RigError(f"zstd within zstd {self.name}: unpack it first")
            yield from self._inner.batches(definitions, types)

    def damage(self, why: str) -> RigError:
        """The error for what is wrong with what was read last."""
        return self._inner.damage(why)


def _unpack(path: PathLike, target: Path, budget: UnpackBudget) -> str:
    """Decompress a file and return its hash."""
    expand, digest, name = zstandard.ZstdDecompressor().decompressobj(), hashlib.sha256(), budget.name
    with open(path, "rb") as packed, open(target, "wb") as file:
        while data := packed.read(BLOCK):
            digest.update(data)
            budget.reached(packed.tell())
            while data:
                if expand.eof:
                    expand = zstandard.ZstdDecompressor().decompressobj()
                    budget.take(FRAME)
                try:
                    plain = expand.decompress(data)
                except zstandard.ZstdError as error:
                    raise RigError(f"cut or damaged {name} (it does not decompress): fetch or pack it again") from error
                budget.take(len(plain))
                file.write(plain)
                data = expand.unused_data
    if not expand.eof:
        raise RigError(f"cut or damaged {name} (it ends early): fetch or pack it again")
    return digest.hexdigest()


def container_file(path: PathLike, budget: UnpackBudget | None = None) -> ContainerFile:
    """The reader of a file, by its first bytes; ``budget``: of the file that it was unpacked from.

    Raises:
        RigError: it is of no kind that is read.
        OSError: it cannot be opened.
    """
    require_file(path)
    with open(path, "rb") as stream:
        start = stream.read(16)
    budget = UnpackBudget(path) if budget is None else budget
    if start.startswith(ZSTD):
        return ZstdFile(path, budget)
    if start == b"SQLite format 3\0":
        from rig.bags.sqlite_bag import SqliteFile

        return SqliteFile(path, budget)
    if start.startswith(b"#ROSBAG V2.0"):
        from rig.bags.ros1_bag import Ros1File

        return Ros1File(path, budget)
    if not start.startswith(MAGIC):
        if Path(path).suffix.lower() in TEXTS:
            cure = f"`inertia import {budget.name} -o RUN.mcap` proposes a map of it"
            raise RigError(f"not a recording {budget.name} but a table: {cure}")
        refuse_other(path, start, str(budget.name))
    return McapFile(path, budget)


def refuse_other(path: PathLike, start: bytes, name: str) -> None:
    """Refuse a file of a program that is known and not read, with the way on.

    Args:
        path: the file.
        start: its first bytes.
        name: what messages call it.

    Raises:
        RigError: it is such a file, by its first bytes or the end of its name.
    """
    by_start = (what for first, what in OTHERS.items() if start.startswith(first))
    known = BY_NAME.get(Path(path).suffix.lower()) or next(by_start, None)
    if start.startswith((MAGIC, ZSTD, b"SQLite format 3\0", b"#ROSBAG V2.0")):
        raise RigError(f"no table {name} but a recording: give it to `inertia inspect` or `inertia identify` as it is")
    if known is not None:
        raise RigError(f"neither recording nor table {name} but {known[0]}: {known[1]}")


def recording_files(path: PathLike) -> list[ContainerFile]:
    """The files of a recording, in order: a file by itself, or those of a rosbag2 folder.

    Raises:
        RigError: it holds no recording, or several.
        OSError: it cannot be opened.
    """
    return [container_file(file) for file in (folder_files(Path(path)) if os.path.isdir(path) else [path])]


def recording_sha256(path: PathLike, files: list[ContainerFile]) -> str:
    """The file's hash; of a folder, the hash of its files' hashes, each on a line (``sha256sum`` of these)."""
    if not os.path.isdir(path):
        return files[0].sha256
    return hashlib.sha256("".join(f"{file.sha256}\n" for file in files).encode()).hexdigest()


NUMBERED = re.compile(r"(?P<stem>.*)_(?P<number>0|[1-9]\d*)\.(mcap|db3)(\.zstd)?")
FILE_PATHS = re.compile(r"^\s*relative_file_paths:\s*(?:\[(?P<inline>[^\]]*)\]|(?P<block>(?:- [^\n]*\s*)+))", re.M)
BAGS = (".mcap", ".db3", ".bag", ".zstd")


def folder_files(folder: Path) -> list[Path]:
    """The files of a rosbag2 folder, in order.

    Raises:
        RigError: it is empty, a file of its metadata.yaml is missing or there twice, or its files are several runs.
    """
    about = folder / "metadata.yaml"
    if about.is_file():
        names = _listed_files(about)
        if len(set(names)) < len(names):
            raise RigError(f"a file twice in {about}: name each file of the run once")
        missing = [name for name in names if not (folder / name).is_file()]
        if missing:
            raise RigError(f"no file {listed(missing[:1])} in {folder}, which its metadata.yaml names: fetch it")
        if names:
            return [folder / name for name in names]
    files = sorted(file for file in folder.iterdir() if file.suffix in BAGS)
    if not files:
        raise RigError(f"no recording in the folder {folder}: give a rosbag2 folder or a file")
    if len(files) == 1:
        return files
    numbers = {file: NUMBERED.fullmatch(file.name) for file in files}
    if len({match and match["stem"] for match in numbers.values()}) > 1 or not all(numbers.values()):
        raise RigError(
            f"several runs in the folder {folder}, which has no metadata.yaml: "
            f"name one of {listed(file.name for file in files)}"
        )
    return sorted(files, key=lambda file: int(match["number"]) if (match := numbers[file]) else 0)


def _listed_files(about: Path) -> list[str]:
    """The entries of ``relative_file_paths``; names alone, since a folder may have been moved."""
    if about.stat().st_size > LONGEST_METADATA:
        raise RigError(f"too long {about}: it is no list of a run's files")
    match = FILE_PATHS.search(about.read_text("utf-8", "replace"))
    if match is None:
        return []
    entries = match["block"].split("\n") if match["block"] else match["inline"].split(",")
    names = (entry.strip().removeprefix("- ").strip("'\" ") for entry in entries)
    return [Path(name).name for name in names if name]
