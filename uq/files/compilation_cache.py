"""The user's cache of compiled code, JAX's own, by which the next call compiles nothing."""

import hashlib
import os
import platform
import warnings
from pathlib import Path

import jax

VARIABLE = "INERTIA_CACHE"
"""Environment variable that names another folder for the cache, or is ``off``."""


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


def _processor() -> str:
    """Name the processor and its abilities: compiled code is for them."""
    try:
        lines = Path("/proc/cpuinfo").read_text("utf-8").splitlines()
        text = "".join(sorted({line for line in lines if line.startswith(("model name", "flags", "Features"))}))
    except OSError:
        text = platform.processor()
    return hashlib.sha256(f"{platform.machine()} {text}".encode()).hexdigest()[:12]
