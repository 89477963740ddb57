"""Provenance of a result: inputs as JSON takes them, versions, machine, time."""

import hashlib
import math
import platform
import subprocess
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from datetime import UTC, date, datetime, time
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import jax
import numpy as np

from rig.child_process import start_program
from rig.toml_tables import TomlTable


def provenance(**inputs: Any) -> dict[str, Any]:
    """Return the record that every result carries: the given inputs, then package, revision, platform and time."""
    devices = jax.devices()
    return {
        **{name: dict(value) if isinstance(value, Mapping) else value for name, value in inputs.items()},
        "package": f"inertia-uq {_version('inertia-uq')}",
        "git_revision": _revision(),
        "python": platform.python_version(),
        "jax": jax.__version__,
        "platform": f"{platform.system()} {platform.machine()}",
        "devices": f"{len(devices)} x {devices[0].device_kind}",
        "time": datetime.now(UTC).isoformat(timespec="seconds"),
    }


def sha256(path: str | Path) -> str:
    """Return the SHA-256 of a file, in hexadecimal."""
    with open(path, "rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def code_digest() -> str:
    """Return a hash of the code that computes: of `uq` and `identify`, as it stands on disk."""
    uq = Path(__file__).parents[1]
    digest = hashlib.sha256()
    for package in (uq, uq.with_name("identify")):
        for path in sorted(package.rglob("*.py")):
            digest.update(path.relative_to(package.parent).as_posix().encode() + path.read_bytes())
    return digest.hexdigest()


def _version(distribution: str) -> str:
    try:
        return version(distribution)
    except PackageNotFoundError:
        return "unknown"


def _revision() -> str | None:
    """The revision of the checkout that the package runs from, marked when it differs; None when installed."""
    root = Path(__file__).parents[2]
    if not (root / ".git").exists():
        return None

    def git(*arguments: str) -> str:
        pipes = {"stdin": subprocess.DEVNULL, "stdout": subprocess.PIPE, "stderr": subprocess.DEVNULL}
        process = start_program("git", "-C", str(root), *arguments, **pipes)
        printed = process.communicate()[0].decode().strip()
        if process.returncode:
            raise OSError(f"git ended with status {process.returncode}")
        return printed

    try:
        return git("rev-parse", "HEAD") + (
            " (modified)" if git("status", "--porcelain", "--untracked-files=no") else ""
        )
    except OSError:
        return None


def plain_values(value: Any) -> Any:
    """Return a value as numbers, strings, lists and dicts, for JSON."""
    if isinstance(value, Mapping):
        return {key: plain_values(item) for key, item in value.items()}
    if isinstance(value, TomlTable):
        return {"class": type(value).__name__} | plain_values(value.to_dict())
    if is_dataclass(value):
        return {"class": type(value).__name__} | {f.name: plain_values(getattr(value, f.name)) for f in fields(value)}
    if isinstance(value, (list, tuple)):
        return [plain_values(item) for item in value]
    if isinstance(value, (date, time)):
        return value.isoformat()
    if isinstance(value, (np.ndarray, np.generic, jax.Array)):
        return plain_values(np.asarray(value).tolist())
    return str(value) if isinstance(value, float) and not math.isfinite(value) else value
