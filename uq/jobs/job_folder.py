"""The folder of a job: it appears when it is complete, and says what it was made from."""

import hashlib
import json
import os
import secrets
import shutil
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from rig.atomic_files import TEMPORARY, naming
from rig.exceptions import RigError, listed, quoted
from uq.files.provenance import sha256
from uq.jobs.body_request import BodyRequest

MADE_FROM = "job.json"
"""File of a job's folder that says what its result was made from."""
RESULT = "result.json"


def inputs_of(request: BodyRequest, version: str) -> dict[str, Any]:
    """Return what a result depends on: hashes of all files, options, the program's version.

    Args:
        request: of the body.
        version: of this program.

    Raises:
        OSError: a file cannot be read.
    """
    content = dict(request.experiment.inputs())
    content.pop("experiment_file", None)  # its name and its comments change no result
    urdf = request.experiment.recording.urdf  # a path, which changes with the working folder
    resolved = content["resolved"]
    content["resolved"] = {**resolved, "recording": {**resolved["recording"], "urdf": None}}
    text = json.dumps(content, sort_keys=True, default=str)
    return {
        "runs": [digest(path) for path in request.runs],
        "experiment": hashlib.sha256(text.encode()).hexdigest(),
        "urdf": None if urdf is None else digest(urdf),
        "centre": None if request.centre is None else digest(request.centre),
        "tare": [digest(path) for path in request.tare],
        "expected": None if request.expected is None else digest(request.expected),
        "method": request.method,
        "mounting": None if request.mountings is None else list(request.mountings),
        "export": list(request.formats),
        "inertia-uq": version,
    }


def digest(path: str | Path) -> str:
    """Return the SHA-256 of a file, or of the names and files of a folder. Raises OSError: it cannot be read."""
    if not os.path.isdir(path):
        return sha256(path)
    files = sorted(file for file in Path(path).rglob("*") if file.is_file())
    lines = [f"{sha256(file)}  {file.relative_to(path).as_posix()}\n" for file in files]
    return hashlib.sha256("".join(lines).encode()).hexdigest()


def record_of(folder: Path) -> dict[str, Any] | None:
    """Return what a job's folder says of its result: inputs, verdict, line; None: there is none, or it is no job's."""
    try:
        record = json.loads((folder / MADE_FROM).read_text("utf-8"))
        whole = isinstance(record["inputs"], dict) and (folder / RESULT).is_file()
        return {key: record[key] for key in ("inputs", "verdict", "line")} if whole else None
    except (OSError, ValueError, KeyError, TypeError):
        return None


def changed(before: Mapping[str, Any], now: Mapping[str, Any]) -> str:
    """Return in words which inputs are others than before; '': none."""
    names = [name for name in now if before.get(name) != now[name]]
    return listed(names) if names else ""


def refuse_strangers(folder: Path) -> None:
    """Refuse to replace what no job has made. Raises RigError: something is there."""
    if folder.exists() and record_of(folder) is None and (not folder.is_dir() or any(folder.iterdir())):
        raise RigError(f"{quoted(str(folder))} holds something else than a job's result: move it, or rename the job")


@contextmanager
def appearing(folder: Path) -> Iterator[Path]:
    """Yield a folder beside ``folder`` that takes its place, and its name, when the block ends well.

    Raises:
        RigError: as :func:`refuse_strangers`.
        OSError: the folder cannot be written.
    """
    refuse_strangers(folder)
    new, old = (folder.with_name(f".{folder.name}.{secrets.token_hex(4)}") for _ in range(2))
    with naming(folder):
        new.mkdir()
        try:
            yield new
            if folder.exists():
                folder.rename(old)
            new.rename(folder)
        finally:
            for path in (new, old):
                shutil.rmtree(path, ignore_errors=True)


def tidy(folder: Path) -> None:
    """Remove what earlier attempts at a job left beside its folder when they were killed."""
    for path in folder.parent.iterdir():
        name = TEMPORARY.fullmatch(path.name)
        if name and name["name"] == folder.name and path.is_dir():
            shutil.rmtree(path, ignore_errors=True)
