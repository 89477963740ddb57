"""The user's cache of compiled commands, by which the next call starts at once.

JAX keeps what it has compiled by the code that it lowered (:func:`keep_compiled`). A command also keeps its programs by
what it was given (:func:`keep_programs`), so that the same command traces and lowers nothing.
"""

import hashlib
import os
import platform
import shutil
import sys
import time
import warnings
from pathlib import Path

import jax

from identify.compiled_program import CompiledProgram
from rig.atomic_files import replacing
from uq.files.provenance import code_digest

VARIABLE = "INERTIA_CACHE"
"""Environment variable that names another folder for the cache, or is ``off``."""

DIGEST = hashlib.sha256().digest_size
MONTH = 30 * 86400
"""Length of a month [s]."""


def cache_folder() -> Path | None:
    """Return the folder of compiled code, for this kind of processor; None: switched off, or a user without a home."""
    chosen = os.environ.get(VARIABLE, "")
    if chosen == "off":
        return None
    cache = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    if not chosen and cache.startswith("~"):  # a user without a home
        return None
    return (Path(chosen) if chosen else Path(cache, "inertia-uq")) / f"compiled-{_processor()}"


def keep_compiled() -> None:
    """Let JAX keep and find compiled code in the cache folder; without a folder that can be written, it does without.

    Several processes may share the folder. An entry that cannot be read (a process was killed as it wrote it) is
    compiled again.
    """
    folder = cache_folder()
    if folder is None:
        return
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:
        return
    warnings.filterwarnings("ignore", message="Error (reading|writing) persistent compilation cache")
    jax.config.update("jax_compilation_cache_dir", str(folder))
    jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.0)


def keep_programs() -> None:
    """Let the programs of :mod:`identify.compiled_program` stay in the cache folder; for a command's own process alone.

    Code that is edited or replaced while a process runs, as in notebooks and tests, would not be seen.
    """
    folder = cache_folder()
    if folder is not None:
        CompiledProgram.store = ProgramFolder(folder)


class ProgramFolder:
    """A folder of compiled programs, for one state of our code, of the installed packages and of JAX's settings."""

    def __init__(self, parent: Path) -> None:
        """Name the folder, in a parent; it is made when something is kept."""
        self.folder = parent / f"programs-{_state()}"

    def load(self, name: str) -> bytes | None:
        """Return what was saved under a name; None: nothing, or it is not whole."""
        try:
            content = (self.folder / name).read_bytes()
        except OSError:
            return None
        digest, data = content[:DIGEST], content[DIGEST:]
        return data if hashlib.sha256(data).digest() == digest else None

    def save(self, name: str, data: bytes) -> None:
        """Keep data under a name; where the folder cannot be written, do without."""
        try:
            if not self.folder.exists():
                _remove_unused(self.folder.parent)
            self.folder.mkdir(parents=True, exist_ok=True)
            with replacing(self.folder / name, overwrite=True) as file:
                file.write(hashlib.sha256(data).digest() + data)
        except OSError:
            return


def _remove_unused(parent: Path) -> None:
    """Remove the programs of other states of the code that nothing was added to for a month."""
    for folder in parent.glob("programs-*"):
        if time.time() - folder.stat().st_mtime > MONTH:
            shutil.rmtree(folder, ignore_errors=True)


def _state() -> str:
    """A hash of all that a program depends on and is not given: code, packages, settings of JAX and of its compiler."""
    installed = sorted(path.name for path in Path(jax.__file__).parents[1].glob("*.dist-info"))
    settings = sorted(item for item in os.environ.items() if item[0].startswith(("JAX_", "XLA_")))
    text = f"{code_digest()} {sys.version} {jax.__version__} {installed} {settings}"
    return hashlib.sha256(text.encode()).hexdigest()[:16]


def _processor() -> str:
    """Name the processor and its abilities: compiled code is for them."""
    try:
        lines = Path("/proc/cpuinfo").read_text("utf-8").splitlines()
        text = "".join(sorted({line for line in lines if line.startswith(("model name", "flags", "Features"))}))
    except OSError:
        text = platform.processor()
    return hashlib.sha256(f"{platform.machine()} {text}".encode()).hexdigest()[:12]
