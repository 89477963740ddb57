"""The ``inertia`` command: finds the command's module, parses its arguments, turns a user's mistake into one line."""

import argparse
import importlib
import keyword
import os
import sys
from collections.abc import Sequence
from typing import NoReturn

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


class Parser(argparse.ArgumentParser):
    """An argument parser whose complaints are one line and exit status 2."""

    def error(self, message: str) -> NoReturn:
        """End the program with the message in one line."""
        self.exit(2, f"error: {message}; see '{self.prog} --help'\n")


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
        print(f"error: unknown command '{name}': choose one of {', '.join(COMMANDS)}", file=sys.stderr)
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
    module = importlib.import_module(f"uq.cli.{name}{'_' * keyword.iskeyword(name)}")
    parser = Parser(prog=f"inertia {name}", description=COMMANDS[name])
    module.configure(parser)
    try:
        return module.run(parser.parse_args(rest))
    except OSError as error:
        where = f" {error.filename}" if error.filename is not None else ""
        print(f"error: {error.strerror or error}{where}: check the path and its permissions", file=sys.stderr)
    except module.ERRORS as error:
        print(f"error: {error}", file=sys.stderr)
    except KeyboardInterrupt:
        print("error: interrupted", file=sys.stderr)
        return 130
    return 2


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
