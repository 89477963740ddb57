"""The ``inertia`` command: finds the command's module, parses its arguments, turns a user's mistake into one line."""

import argparse
import contextlib
import importlib
import keyword
import os
import signal
import sys
from collections.abc import Iterator, Sequence
from typing import NoReturn

from rig.exceptions import on_one_line, quoted
from uq.trials.watchdog import divide

COMMANDS = {
    "paper": "reproduce the source's Table 2 and figures, beside its printed values",
    "montecarlo": "Monte Carlo of any body, platform, sensors and trajectory",
    "record": "record sensors to an MCAP file",
    "import": "write the named columns of a table as an MCAP run",
    "recover": "save every intact message of a cut or damaged MCAP file",
    "inspect": "channels, rates, gaps, held samples, clocks, suspicious units and axes of a run",
    "simulate": "write a synthetic recorded run with the experiment's errors",
    "centre": "mass, centre of gravity and the load cell's offsets from static poses",
    "design": "the best trajectory this platform can run, as poses and leg lengths",
    "schema": "the JSON Schema of a TOML file, for editors",
    "identify": "identify the inertia tensor from recorded runs",
}


LONGEST = 150
"""Most characters of a complaint about an option that are shown as they are; it repeats whatever was typed."""


class Parser(argparse.ArgumentParser):
    """An argument parser whose complaints are one line and exit status 2."""

    def error(self, message: str) -> NoReturn:
        """End the program with the message in one line."""
        _complain(f"{message if len(message) <= LONGEST else quoted(message)}; see '{self.prog} --help'")
        self.exit(2)


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status: 0 done, 1 done but something is missing, 2 bad input."""
    by_itself = argv is None
    argv = list(sys.argv[1:] if argv is None else argv)
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):
            stream.reconfigure(errors="replace")  # a terminal without σ shows a question mark, not a traceback
    if not argv or argv[0] in ("-h", "--help"):
        print(_overview())
        return 0 if argv else 2
    name, rest = argv[0], argv[1:]
    if name not in COMMANDS:
        _complain(f"unknown command {quoted(name)}: choose one of {', '.join(COMMANDS)}")
        return 2
    if "--distributed" in rest and by_itself:
        status = divide()
        if status is not None:
            return status
    if "--no-cache" in rest:
        rest.remove("--no-cache")
        os.environ["INERTIA_CACHE"] = "off"
    # Matrices are small here: two threads of BLAS would wait for each other, and starting them takes 0.05 s.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    with _leaving_at_once() if by_itself else contextlib.nullcontext():
        module = importlib.import_module(f"uq.cli.{name}{'_' * keyword.iskeyword(name)}")
    parser = Parser(prog=f"inertia {name}", description=COMMANDS[name])
    module.configure(parser)
    try:
        with _once_over_no_interrupt() if by_itself else contextlib.nullcontext():
            status = module.run(parser.parse_args(rest))
            sys.stdout.flush()
        return status
    except BrokenPipeError:  # whoever reads has enough, as with `| head`
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 128 + signal.SIGPIPE
    except OSError as error:
        where = f" {error.filename}" if error.filename is not None else ""
        _complain(f"{error.strerror or error}{where}: check the path and its permissions")
    except module.ERRORS as error:
        _complain(str(error))
    except KeyboardInterrupt:
        print("error: interrupted", file=sys.stderr)
        return 130
    return 2


@contextlib.contextmanager
def _leaving_at_once() -> Iterator[None]:
    """Let Ctrl-C end the program without a word of Python's, which interrupted imports would have much to say of."""

    def leave(*_: object) -> NoReturn:
        os.write(sys.stderr.fileno(), b"error: interrupted\n")
        os._exit(130)

    before = signal.signal(signal.SIGINT, leave)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


@contextlib.contextmanager
def _once_over_no_interrupt() -> Iterator[None]:
    """Let a second Ctrl-C, which comes when the command has ended, not meet Python as it ends."""
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, signal.SIG_IGN)


def _complain(message: str) -> None:
    print(f"error: {on_one_line(message)}", file=sys.stderr)


def _overview() -> str:
    width = max(map(len, COMMANDS))
    lines = [f"  {name:<{width}}  {summary}" for name, summary in COMMANDS.items()]
    return (
        "usage: inertia COMMAND [ARGUMENTS]\n\n"
        + "\n".join(lines)
        + "\n\n'inertia COMMAND --help' explains one command. Compiled code is kept in the user's cache folder; with"
        "\n--no-cache it is not."
    )


if __name__ == "__main__":
    sys.exit(main())
