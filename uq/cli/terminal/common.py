"""Start and end of a command: float64, devices, the output folder, the result."""

import contextlib
import logging
import os
import subprocess
import tempfile
from collections.abc import Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

import jax

from identify.display.text_tables import in_lines
from rig.child_process import processors, start_python
from rig.exceptions import on_one_line, quoted
from uq.files.compilation_cache import keep_compiled
from uq.files.mistakes import ExperimentError

TRIED = 2**20
"""Bytes that an output folder must take before the work begins: a report has a megabyte."""


def start_jax(*, alone: bool = True) -> None:
    """Switch on float64, keep what is compiled, let each processor be a device; before the first array is made.

    ``alone``: this process meets no others, so that its devices can be asked for at once.

    Raises:
        ExperimentError: JAX has no device, as where ``JAX_PLATFORMS`` names a kind that is not here.
    """
    if flags := os.environ.get("XLA_FLAGS"):  # XLA ends a process that has a flag which it does not know
        pipes = {"stdin": subprocess.DEVNULL, "stdout": subprocess.DEVNULL, "stderr": subprocess.PIPE}
        tried = start_python("import jax; jax.devices('cpu')", **pipes)
        errors = tried.communicate()[1]
        if tried.returncode and b"XLA_FLAGS" in errors:
            raise ExperimentError(f"XLA does not know the flags {quoted(flags)}: correct or unset XLA_FLAGS")
    logging.getLogger("matplotlib").setLevel(logging.ERROR)  # a home that cannot be written is no user's concern
    jax.config.update("jax_enable_x64", True)
    with contextlib.suppress(RuntimeError):  # devices exist already, as in a notebook
        jax.config.update("jax_num_cpu_devices", processors())
    keep_compiled()
    try:
        if alone:
            jax.devices()
    except (RuntimeError, AssertionError):
        chosen = quoted(os.environ.get("JAX_PLATFORMS", ""))
        raise ExperimentError(f"JAX has no device with JAX_PLATFORMS={chosen}: unset it, or set it to cpu") from None


@contextlib.contextmanager
def output_folder(text: str | None) -> Iterator[Path | None]:
    """Make the output folder and see that it can be written, before any work is done; gone again if the work fails.

    What draws and writes is loaded before the work, too: where memory is short, that fails at once and not after hours.

    Raises:
        OSError: it cannot be made or written.
    """
    if text is None:
        yield None
        return
    for module in ("scipy.special", "uq.report.report_files", "matplotlib"):
        try:
            import_module(module)
        except UnicodeDecodeError:
            raise ExperimentError("matplotlibrc is no text: correct or remove it") from None
        except ValueError:
            if not (backend := os.environ.get("MPLBACKEND")):
                raise
            which = f"the backend {quoted(backend)}: unset MPLBACKEND, or set it to agg"
            raise ExperimentError(f"matplotlib does not know {which}") from None
    folder = Path(text)
    made = [parent for parent in (folder, *folder.parents) if not parent.exists()]
    folder.mkdir(parents=True, exist_ok=True)
    try:
        with tempfile.TemporaryFile(dir=folder) as file:
            file.write(bytes(TRIED))
        yield folder
    except BaseException:
        with contextlib.suppress(OSError):
            for empty in made:
                empty.rmdir()
        raise


def finish(result: Any, out: Path | None, *more: Any) -> None:
    """Write the files of results, if there is a folder for them, and print them."""
    keep(out, result, *more)
    show(out, result, *more)


def keep(out: Path | None, result: Any, *more: Any) -> None:
    """Write the files of results, if there is a folder for them: before anything is printed, which may fail.

    The figures are drawn as matplotlib does by itself, whatever a ``matplotlibrc`` in the working folder says.
    """
    if out is not None:
        import matplotlib

        from uq.report.report_files import write

        with matplotlib.rc_context(matplotlib.rcParamsDefault):
            write(result, out, *more)


def show(out: Path | None, result: Any, *more: Any) -> None:
    """Print results, and where their files are."""
    print(*(in_lines(str(part)) for part in (result, *more)), sep="\n\n")
    if out is not None:
        name = getattr(result, "file_name", "result.json")
        print(f"\n{on_one_line(f'{name}, report.html and figures are in {out}')}")
