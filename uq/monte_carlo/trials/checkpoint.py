"""Results of a long campaign so far, in a folder: one file a segment of trials, each with its checksum.

``campaign.json`` describes the campaign; every part names it by its digest. A part is a line of JSON and the bytes of
an array of estimates. Among several processes, each of which is given all trials, the first writes. Files are written
beside their place and moved into it, so that a campaign that is killed leaves whole parts only. A folder in which
anything does not fit is not used at all. What is deleted has the name of such a file, and begins with this campaign's
digest.
"""

import contextlib
import hashlib
import importlib
import json
import os
import re
import stat
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from rig.atomic_files import TEMPORARY, replacing
from rig.exceptions import listed, quoted
from rig.read_limits import parse_json, require_file
from uq.files.mistakes import ExperimentError
from uq.monte_carlo.trials.engine import Estimates
from uq.monte_carlo.trials.joined_processes import is_first
from uq.sources.draws import stream_number

FORMAT = 3
"""Version of the files' format."""
HEADER = {"campaign", "trajectory", "first", "dtype", "shape"}
"""Keys of the line of JSON that a part begins with, its checksum besides."""
HEAD, LOCK = "campaign.json", "lock"
PART = re.compile(r"[0-9a-f]{8}-[0-9]{10,}\.part")


class Checkpoint:
    """A folder with the segments of one campaign that are done."""

    def __init__(self, folder: str | Path, *, say: Callable[[str], None] | None = None) -> None:
        """Name the folder; nothing is read or written before :meth:`open`.

        Args:
            folder: where the parts are kept; made when the first is written.
            say: called with a line where a campaign is resumed.
        """
        self.folder, self.say = Path(folder), say
        self.digest, self.lock = "", -1
        self.made: list[Path] = []
        """Lock, folder and folders above it that this campaign, or an earlier call of it, has made."""

    def open(self, identity: Mapping[str, Any]) -> None:
        """Make the folder that of one campaign, or see that it is.

        Raises:
            ExperimentError: the folder is in use, damaged, of another campaign, or has files of no campaign.
            OSError: it cannot be read or written.
        """
        digest, head = _digest(identity), self.folder / HEAD
        if is_first():
            self.refuse_strangers()
            places = (self.folder / LOCK, self.folder, *self.folder.parents)
            self.made = [place for place in places if not place.exists()]
            self.folder.mkdir(parents=True, exist_ok=True)
            self._lock()
        if head.exists():
            self._compare(head, dict(identity), digest)
            self.made = [self.folder / LOCK, self.folder]
        elif not is_first():
            raise ExperimentError(f"no {head} on this machine: give --out a folder that all processes share")
        elif any(self.folder.glob("*.part")):
            raise ExperimentError(f"no {HEAD} in {self.folder}: {_delete(self.folder)}")
        else:
            _write(head, json.dumps({"format": FORMAT, "digest": digest, "campaign": identity}, indent=1).encode())
        self.digest = digest

    def refuse_strangers(self) -> None:
        """Refuse a folder with anything in it that no campaign writes.

        Raises:
            ExperimentError: such a file, or a folder.
            OSError: the folder cannot be read.
        """
        for path in sorted(self.folder.iterdir()) if self.folder.exists() else ():
            if not (_is_empty_file(path) if path.name == LOCK else _name(path)):
                raise ExperimentError(
                    f"{quoted(path.name)} in {self.folder} is no file of a campaign: "
                    "choose another folder, or move that elsewhere"
                )

    def load(self, trajectory: str, trials: int, shape: tuple[int, ...]) -> list[Estimates]:
        """Return the segments of a trajectory that are done, from its first trial on.

        Args:
            trajectory: its name.
            trials: how many are asked for, to say so.
            shape: of one trial's estimates.

        Raises:
            ExperimentError: a part is cut, edited, missing, or of another campaign.
            OSError: it cannot be read.
        """
        parts: list[Estimates] = []
        done = 0
        for path in sorted(self.folder.glob(f"{_stem(trajectory)}-*.part")):
            header, estimates = self._read(path, shape)
            if (header["trajectory"], header["first"]) != (trajectory, done):
                raise ExperimentError(f"a part before {path} is missing: {_delete(self.folder)}")
            done += len(estimates)
            parts.append(estimates)
        if done and self.say and is_first():
            self.say(f"resuming {trajectory} at trial {min(done, trials):,} of {trials:,}")
        return parts

    def keep(self, trajectory: str, first: int, estimates: Estimates) -> None:
        """Write a segment; the first process alone does."""
        if not is_first():
            return
        path = self.folder / f"{_stem(trajectory)}-{first:010d}.part"
        content = np.asarray(estimates)
        header = {
            "campaign": self.digest, "trajectory": trajectory, "first": first, "dtype": content.dtype.str,
            "shape": content.shape,
        }  # fmt: skip
        payload = content.tobytes()
        _write(path, json.dumps(header | {"sha256": _checksum(header, payload)}).encode() + b"\n" + payload)

    def close(self) -> None:
        """Unlock the folder; delete the campaign's files if there is nothing to resume from."""
        if self.lock >= 0 and any(self.folder.glob("*.part")):
            self._unlock()
        elif self.lock >= 0:
            self.remove()

    def remove(self) -> None:
        """Delete this campaign's files, then the folder and those above it that were made for it, if they are empty.

        All stays where another process goes on from it. Whatever else has come into the folder stays, too.
        """
        if self.lock < 0 and not self.digest:  # it was never open
            return
        with contextlib.suppress(OSError, ExperimentError):
            if self.lock < 0:
                self._lock()
            for path in self.folder.iterdir():
                if self._has_seal(path):
                    path.unlink()
            self._unlock()  # first: Windows deletes no open file, and NFS gives it another name
            for place in self.made:
                place.rmdir() if place.is_dir() else place.unlink()
        self._unlock()

    def _has_seal(self, path: Path) -> bool:
        """Whether a file is of this campaign: by its name, and by its first bytes; a half-written one ends in them."""
        if not self.digest or not (name := _name(path)) or not stat.S_ISREG(path.lstat().st_mode):
            return False
        head = {"format": FORMAT, "digest": self.digest} if name == HEAD else {"campaign": self.digest}
        seal = json.dumps(head, indent=1 if name == HEAD else None).encode().rstrip(b"\n}")
        with path.open("rb") as file:
            first = file.read(len(seal))
        return first == seal if path.name == name else seal.startswith(first)

    def _lock(self) -> None:
        self.lock = os.open(self.folder / LOCK, os.O_CREAT | os.O_RDWR, 0o644)
        try:
            _lock_file(self.lock)
        except OSError:
            self._unlock()
            raise ExperimentError(f"another campaign writes in {self.folder}: wait for it, or choose another") from None

    def _unlock(self) -> None:
        if self.lock >= 0:
            os.close(self.lock)
            self.lock = -1

    def _compare(self, head: Path, identity: dict[str, Any], expected: str) -> None:
        require_file(head)
        try:
            content = parse_json(head.read_text("utf-8"))
            version, digest, stored = content["format"], content["digest"], dict(content["campaign"])
            edited = digest != _digest(stored)
        except (ValueError, KeyError, TypeError, RecursionError):
            raise ExperimentError(f"{head} is cut or edited: {_delete(self.folder)}") from None
        if version != FORMAT:
            raise ExperimentError(f"{head} has the format {quoted(version)}, not {FORMAT}: {_delete(self.folder)}")
        if edited:
            raise ExperimentError(f"{head} is edited: {_delete(self.folder)}")
        if digest != expected:
            given = json.loads(json.dumps(identity))
            other = [key for key in {**stored, **given} if stored.get(key) != given.get(key)]
            raise ExperimentError(
                f"{self.folder} is of another campaign (other {listed(other)}): "
                f"give the same arguments as before, choose another folder, or {_delete(self.folder)}"
            )

    def _read(self, path: Path, shape: tuple[int, ...]) -> tuple[dict[str, Any], Estimates]:
        require_file(path)
        line, _, payload = path.read_bytes().partition(b"\n")
        try:
            header = parse_json(line)
            intact = header.pop("sha256") == _checksum(header, payload) and header.keys() == HEADER
            estimates = np.frombuffer(payload, header["dtype"]).reshape(header["shape"])
            intact = intact and estimates.dtype in (np.float32, np.float64) and estimates.shape[1:] == shape
        except (ValueError, KeyError, AttributeError, TypeError, OverflowError, RecursionError):
            intact = False
        if not intact:
            raise ExperimentError(f"{path} is cut or edited (its checksum is another): {_delete(self.folder)}")
        if header.get("campaign") != self.digest:
            raise ExperimentError(f"{path} is of another campaign: {_delete(self.folder)}")
        return header, estimates


def _name(path: Path) -> str | None:
    """The name of a campaign's file, under which it or its half-written content stands; None: it is no such file."""
    half = TEMPORARY.fullmatch(path.name)
    name = half["name"] if half else path.name
    return name if name == HEAD or PART.fullmatch(name) else None


def _is_empty_file(path: Path) -> bool:
    status = path.lstat()
    return stat.S_ISREG(status.st_mode) and status.st_size == 0


def _lock_file(handle: int) -> None:
    """Lock an open file until it is closed, or this process ends. Raises OSError where another has locked it."""
    try:
        import fcntl
    except ImportError:  # Windows
        msvcrt: Any = importlib.import_module("msvcrt")
        msvcrt.locking(handle, msvcrt.LK_NBLCK, 1)
    else:
        fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)


def _delete(folder: Path) -> str:
    return f"delete {folder} to start again"


def _stem(trajectory: str) -> str:
    """Stem of a trajectory's files, whatever characters its name has."""
    return f"{stream_number(trajectory):08x}"


def _digest(content: Any) -> str:
    return hashlib.sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def _checksum(header: dict[str, Any], payload: bytes) -> str:
    return hashlib.sha256(_digest(header).encode() + payload).hexdigest()


def _write(path: Path, data: bytes) -> None:
    """Write a file beside its place, down to the disk, and move it there."""
    with replacing(path, overwrite=True) as file:
        file.write(data)
