"""The ``inertia`` command: finds the command's module, parses its arguments, turns a user's mistake into one line."""

import argparse
import contextlib
import gc
import importlib
import importlib.metadata
import importlib.util
import keyword
import os
import sys
import traceback
from collections.abc import Sequence
from pathlib import Path

from identify.display.rounding import concise
from rig import read_limits
from rig.exceptions import cure, quoted, reason
from uq.cli.terminal.command_parser import CommandParser, complain
from uq.cli.terminal.interrupt import STATUS as INTERRUPTED
from uq.cli.terminal.interrupt import Interrupt, leave
from uq.cli.terminal.standard_streams import open_closed_streams, shown_streams
from uq.cli.terminal.terminal_bar import ReadingBar
from uq.files.mistakes import MISTAKES

COMMANDS = {
    "paper": "reproduce the paper's Table 2 and figures, beside its printed values",
    "montecarlo": "Monte Carlo of any body, platform, sensors and trajectory",
    "record": "record sensors to an MCAP file",
    "import": "write the named columns of a table as an MCAP run",
    "recover": "save every intact message of a cut or damaged MCAP file",
    "inspect": "channels, rates, gaps, held samples, clocks, suspicious units and axes of a run",
    "noise": "noise of every channel of a recording at rest, as sources for an experiment",
    "simulate": "write a synthetic recorded run with the experiment's errors",
    "calibrate": "the rig's errors from runs of a known body, as sources for an experiment",
    "centre": "mass, centre of gravity and the load cell's offsets from static poses",
    "plan": "which sensor is worth improving, and how long must I measure?",
    "design": "the best trajectory this platform can run, as poses and leg lengths",
    "examples": "the experiments, rigs and bodies that the documentation uses, to run and to change",
    "schema": "the JSON Schema of a TOML file, for editors",
    "identify": "identify the inertia tensor from recorded runs",
}


OURS = "inertia-uq"
"""Name of this distribution."""
BROKEN_PIPE = 141
"""Exit status where nobody reads on: 128 and the number of SIGPIPE, which not every system has."""
WITHOUT_JAX = ("record", "recover", "inspect", "examples", "schema")
LEAST_MEMORY = 7 * 2**28
"""Bytes of address space below which JAX does not start but aborts the process with a page of text."""
SELDOM = 1_000_000
"""New objects after which the garbage collector looks for circles that nothing leads to."""
OUT_OF_MEMORY = ("RESOURCE_EXHAUSTED", "Out of memory", "bad_alloc", "can't start new thread", "failed to map segment",
                 "annot allocate memory")  # fmt: skip
"""Texts of the errors that libraries raise where Python would raise a MemoryError."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status: 0 done, 1 done but something is missing, 2 bad input."""
    interrupt = Interrupt() if argv is None else None
    if interrupt:
        open_closed_streams()
        interrupt.listen()
    with shown_streams(to_the_end=interrupt is not None):
        return _status(list(sys.argv[1:] if argv is None else argv), interrupt)


def _status(argv: list[str], interrupt: Interrupt | None) -> int:
    """Run one command; what it meets is one line."""
    try:
        status = _with_extensions(argv, interrupt)
        sys.stdout.flush()
    except BrokenPipeError:  # whoever reads has enough, as with `| head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return BROKEN_PIPE
    except OSError as error:
        where = f" {error.filename}" if error.filename is not None else ""
        complain(f"{error.strerror or error}{where}: {cure(error)}")
        return 2
    except (MemoryError, RuntimeError, ImportError, SystemError) as error:
        if not isinstance(error, MemoryError) and not any(words in str(error) for words in OUT_OF_MEMORY):
            raise
    except KeyboardInterrupt as error:
        complain("; ".join(("interrupted", *map(str, error.args))))
        if interrupt:
            leave()
        return INTERRUPTED
    else:
        return status
    # Here, where the error and all that its frames held is gone, is memory to say so.
    complain("out of memory: give this process more (ulimit -v, the job's limit), or ask for less at once")
    return 2


def _with_extensions(argv: list[str], interrupt: Interrupt | None) -> int:
    """Run one command; an extension that does not load, or whose name another one has, is one line and status 2."""
    named: dict[tuple[str, str], importlib.metadata.EntryPoint] = {}
    entries = importlib.metadata.entry_points()
    records = argv[:1] == ["record"] and "--identify" not in argv  # nothing may stop a recording that does not need it
    needed = "inertia_uq.devices" if records else "inertia_uq."
    for group in (group for group in entries.groups if group.startswith(needed)):
        for entry in entries.select(group=group):
            other = named.setdefault((entry.group, entry.name), entry)
            if other.value != entry.value:
                both = f"{_distribution(other)} and {_distribution(entry)}"
                complain(f"{both} both name {quoted(entry.name)} in {entry.group}: uninstall or rename one")
                return 2
    try:
        return _run(argv, interrupt)
    except Exception as error:
        selves = [frame.f_locals.get("self") for frame, _ in traceback.walk_tb(error.__traceback__)]
        loading = [s for s in selves if isinstance(s, importlib.metadata.EntryPoint)]
        if not loading or _distribution(loading[0]) == OURS:
            raise
        entry = loading[0]
        what = f"{quoted(entry.name)} in {entry.group}, of {_distribution(entry)}, does not load"
        complain(f"{what} ({type(error).__name__}: {reason(error)}): correct or uninstall it")
        return 2


def _distribution(entry: importlib.metadata.EntryPoint) -> str:
    return entry.dist.name if entry.dist else "a package"


def _run(argv: list[str], interrupt: Interrupt | None) -> int:
    """Run one command; a user's mistake is one line and status 2. No ``interrupt``: within a program."""
    by_itself = interrupt is not None
    if clash := _other_identify():
        complain(f"{clash}: install inertia-uq into an environment of its own (uv tool, pipx, python -m venv)")
        return 2
    if argv[:1] == ["--version"]:
        print(f"inertia-uq {_version()}")
        return 0
    if not argv or argv[0] in ("-h", "--help"):
        print(_overview())
        return 0 if argv else 2
    name, rest = argv[0], argv[1:]
    if refusal := _refusal(name, rest):
        complain(refusal)
        return 2
    notation: contextlib.AbstractContextManager[None] = contextlib.nullcontext()
    if "--concise" in rest:
        rest.remove("--concise")
        notation = concise()
    if "--no-cache" in rest:
        rest.remove("--no-cache")
        os.environ["INERTIA_CACHE"] = "off"
    # XLA reports on stderr that it compiles for long, as the search for a motion does; what fails raises an exception.
    os.environ.setdefault("TF_CPP_MIN_LOG_LEVEL", "3")
    # Matrices are small here: two threads of BLAS would wait for each other, and starting them takes 0.05 s.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    if by_itself:  # imports and traces make millions of objects that stay: looking through them takes 0.3 s
        gc.set_threshold(SELDOM)
    module = importlib.import_module(f"uq.cli.{name}{'_' * keyword.iskeyword(name)}")
    read_limits.watch = ReadingBar().watch
    parser = CommandParser(prog=f"inertia {name}", description=COMMANDS[name])
    module.configure(parser)
    try:
        with interrupt.raising() if interrupt else contextlib.nullcontext(), notation:
            return module.run(parser.parse_args(rest, argparse.Namespace(by_itself=by_itself)))
    except MISTAKES as error:
        complain(str(error))
    finally:
        if by_itself:  # Python's end would look for circles among objects that end with it (0.4 s)
            gc.freeze()
    return 2


def _refusal(name: str, rest: list[str]) -> str | None:
    """Say why a command cannot start, whatever its own options mean."""
    if name not in COMMANDS:
        return f"unknown command {quoted(name[:20])}: choose one of {', '.join(COMMANDS)}"
    if strange := [text for text in rest if not _is_unicode(text)]:
        return f"no UTF-8 in the argument {quoted(strange[0])}: rename the file, or set PYTHONUTF8=1"
    limit = _memory_limit()
    if name not in WITHOUT_JAX and limit is not None and limit < LEAST_MEMORY:
        allowed = f"{limit / 2**30:.2g} GiB"
        return f"this process may have {allowed} of memory: raise the limit (ulimit -v) to 2 GiB or more"
    return None


def _other_identify() -> str | None:
    """Say where a package `identify` lies that is not ours: before ours on the path, or in the same folder as ours.

    Installed after ours it replaces our ``__init__.py``, before ours it leaves ``identify.py``, which ours has not;
    and when it is removed it takes our ``__init__.py`` along.
    """
    folder = Path(__file__).parents[2] / "identify"
    spec = importlib.util.find_spec("identify")
    if spec is None or spec.origin is None:
        return f"files are missing in {folder}, perhaps removed with another package named `identify`"
    at = Path(spec.origin)
    if at == folder / "__init__.py" and not (folder / "identify.py").exists():
        return None
    return f"another package named `identify` is in {at.parent if at.name == '__init__.py' else at} (pre-commit has it)"


def _version() -> str:
    try:
        return importlib.metadata.version(OURS)
    except importlib.metadata.PackageNotFoundError:
        return "(not installed)"


def _memory_limit() -> int | None:
    """Bytes of address space that the process may have; None: no limit, or a system that sets none."""
    try:
        import resource
    except ImportError:
        return None
    limit = resource.getrlimit(resource.RLIMIT_AS)[0]
    return None if limit == resource.RLIM_INFINITY else limit


def _is_unicode(text: str) -> bool:
    """Whether a text can be written into reports and recordings; bytes of the command line may be no characters."""
    try:
        text.encode()
    except UnicodeEncodeError:
        return False
    return True


def _overview() -> str:
    width = max(map(len, COMMANDS))
    lines = [f"  {name:<{width}}  {summary}" for name, summary in COMMANDS.items()]
    return (
        "usage: inertia COMMAND [ARGUMENTS]\n       inertia --version\n\n"
        + "\n".join(lines)
        + "\n\n'inertia COMMAND --help' explains one command. Compiled code is kept in the user's cache folder; with"
        "\n--no-cache it is not. With --concise uncertainties are printed as 374.9(4.9)."
    )


if __name__ == "__main__":
    sys.exit(main())
