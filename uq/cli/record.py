"""``inertia record``: sensors to an MCAP file."""

import argparse
import contextlib
import json
import signal
import sys
from collections.abc import Callable, Iterator

from rig.exceptions import RigError

ERRORS = (RigError,)


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("rig", nargs="?", help="the rig file (TOML, see docs/how-to/rig.md)")
    parser.add_argument("-o", "--output", help="RUN.mcap, or a folder in which runs are numbered")
    parser.add_argument("--seconds", type=float, help="stop after so long (default: until Ctrl-C)")
    parser.add_argument("--note", default="", help="a note for the file's metadata")
    parser.add_argument("--list", nargs="*", metavar="PORT", help="show ports and which device answers on them")
    parser.add_argument("--watch", action="store_true", help="show live values, write nothing")


def run(arguments: argparse.Namespace) -> int:
    """Record, list or watch."""
    if arguments.list is not None:
        return _list(arguments.list)
    if arguments.rig is None:
        raise RigError("no rig file given: write one as docs/how-to/rig.md shows, or use --list")
    if arguments.seconds is not None and not arguments.seconds > 0:
        raise RigError(f"--seconds is {arguments.seconds:g}: give a positive number")
    if arguments.watch:
        return _watch(arguments)
    if arguments.output is None:
        raise RigError("no output given: name it with -o RUN.mcap or -o DIR/")
    return _record(arguments)


@contextlib.contextmanager
def _on_signal(stop: Callable[[], None]) -> Iterator[None]:
    """Ctrl-C, SIGTERM and the end of the terminal stop the work cleanly."""
    names = ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")  # the last but one is not on Windows, the last only there
    numbers = [getattr(signal, name) for name in names if hasattr(signal, name)]
    old = {number: signal.signal(number, lambda *_: stop()) for number in numbers}
    try:
        yield
    finally:
        for number, handler in old.items():
            signal.signal(number, handler)


def _record(arguments: argparse.Namespace) -> int:
    from rig.record import memory, rig_file
    from rig.record.recorder import Recorder
    from rig.record.recording_file import run_path
    from rig.record.terminal import Keys, Terminal, summary_lines

    memory.share_one_arena()
    rig = rig_file.load_rig(arguments.rig)
    terminal = Terminal(sys.stderr)
    recorder = Recorder(rig, run_path(arguments.output), note=arguments.note, say=terminal.say)
    with _on_signal(recorder.stop), Keys(sys.stdin, recorder.mark):
        terminal.begin()
        summary = recorder.run(arguments.seconds, progress=terminal.progress)
        terminal.done()
        at_terminal = sys.stdout is not None and sys.stdout.isatty()
        lines = summary_lines(summary) if at_terminal else [json.dumps(summary.to_dict())]
        print(*lines, sep="\n", flush=True)
    return 0 if summary.complete else 1


def _watch(arguments: argparse.Namespace) -> int:
    from rig.record import live_values, rig_file

    stop = live_values.Stop()
    with _on_signal(stop.set):
        for line in live_values.watch(rig_file.load_rig(arguments.rig), stop, seconds=arguments.seconds):
            print(line, flush=True)
    return 0


def _list(ports: list[str]) -> int:
    from rig.record import discover

    answers = discover.discover(ports or None)
    for line in discover.table(answers):
        print(line)
    return 0
