"""``inertia record``: sensors to an MCAP file."""

import argparse
import contextlib
import json
import signal
import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from identify.display.text_tables import text_table
from rig.exceptions import RigError, on_one_line
from uq.cli.terminal.command_parser import CommandParser

if TYPE_CHECKING:
    from rig.record.recorder import Progress, Summary
    from uq.runs.live.second_process import SecondProcess


def configure(parser: CommandParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("rig", nargs="?", help="the rig file (TOML, see docs/how-to/rig.md)")
    parser.add_argument("-o", "--output", help="RUN.mcap, or a folder in which runs are numbered")
    parser.add_argument("--seconds", type=float, help="stop after this many seconds (default: until Ctrl-C)")
    parser.add_argument("--note", default="", help="a note for the file's metadata")
    parser.switch("--json", "print at the end what was recorded as a line of JSON")
    parser.value("--list", "PORT", "show ports and the devices that answer on them", nargs="*")
    parser.switch("--watch", "show live values, write nothing")
    parser.value("--identify", "E.toml", "identify while recording, by this experiment file")
    parser.value(
        "--until", '"5 g*m^2"',
        text="with --identify: end when half the interval of 95 %% of every component is no more than this",
    )  # fmt: skip


def run(arguments: argparse.Namespace) -> int:
    """Record, list or watch."""
    if arguments.list is not None:
        return _list(arguments.list)
    if arguments.rig is None:
        raise RigError("no rig file given: write one as docs/how-to/rig.md shows, or use --list")
    if arguments.seconds is not None and not arguments.seconds > 0:
        raise RigError(f"--seconds is {arguments.seconds:g}: give a positive number")
    target = _target(arguments)
    if arguments.watch:
        return _watch(arguments)
    if arguments.output is None:
        raise RigError("no output given: name it with -o RUN.mcap or -o DIR/")
    return _record(arguments, target)


@contextlib.contextmanager
def _on_signal(stop: Callable[[], None], *, to_the_end: bool = False) -> Iterator[None]:
    """Ctrl-C, SIGTERM and the end of the terminal stop the work cleanly.

    ``to_the_end`` of the process: another Ctrl-C does not undo the status of work that is done.
    """
    names = ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")  # the last but one is not on Windows, the last only there
    numbers = [getattr(signal, name) for name in names if hasattr(signal, name)]
    old = {number: signal.signal(number, lambda *_: stop()) for number in numbers}
    try:
        yield
    finally:
        for number, handler in () if to_the_end else old.items():
            signal.signal(number, handler)


def _target(arguments: argparse.Namespace) -> float | None:
    """Return the target that ``--until`` states [kg·m²]."""
    if arguments.identify is not None and arguments.watch:
        raise RigError("--identify reads the file, and --watch writes none: leave one of them out")
    if arguments.until is None:
        return None
    if arguments.identify is None:
        raise RigError("--until needs --identify E.toml, which determines the uncertainty")
    from uq.cli.terminal.options import positive_quantity

    return positive_quantity("--until", arguments.until, "kg*m^2")


def _record(arguments: argparse.Namespace, target: float | None) -> int:
    from rig.record import memory, rig_file
    from rig.record.recorder import Recorder
    from rig.record.recording_file import run_path
    from rig.record.terminal import Keys, Terminal
    from uq.cli.terminal.standard_streams import uncontrolled

    memory.share_one_arena()
    rig, path = rig_file.load_rig(arguments.rig), run_path(arguments.output)
    terminal = Terminal(uncontrolled(sys.stderr))
    recorder = Recorder(rig, path, note=arguments.note, say=terminal.say)
    with _beside(arguments, path, target, recorder.stop) as process:

        def tell() -> None:
            while process is not None and process.messages:
                terminal.say(process.messages.popleft())

        def show(progress: "Progress") -> None:
            tell()
            if process is not None and not terminal.live and (line := process.line()):
                terminal.say(line)
            terminal.progress(progress, () if process is None else process.block)

        nothing_follows = arguments.by_itself and arguments.identify is None
        with _on_signal(recorder.stop, to_the_end=nothing_follows), Keys(sys.stdin, recorder.mark):
            terminal.begin()
            summary = recorder.run(arguments.seconds, progress=show)
            terminal.done()
            tell()
            lines = [json.dumps(summary.to_dict())] if arguments.json else summary_lines(summary)
            print(*map(on_one_line, lines), sep="\n", flush=True)
    reached = target if process is not None and process.target_reached else None
    identified = arguments.identify is None or _identified(path, arguments.identify, reached, terminal.say)
    return 0 if summary.complete and identified else 1


def summary_lines(summary: "Summary") -> Iterator[str]:
    """Return what was recorded as a table of devices and a line on the file."""
    head = ("device", "topic", "samples", "rate [Hz]", "missing", "bad", "state")
    rows = [
        (
            name,
            str(device["topic"]),
            f"{device['samples']:,}",
            f"{device['rate_hz']:.6g}",
            f"{device['missing']:,}",
            f"{device['failures']:,}",
            str(device["state"]),
        )
        for name, device in summary.devices.items()
    ]
    yield from text_table(head, rows).splitlines()
    for name, delay in summary.delays.items():
        yield f"{name}: the IMU follows it by {1e3 * delay['delay_s']:.1f} ms"
    marks = f", {summary.marks} marks" if summary.marks else ""
    state = "complete" if summary.complete else "NOT COMPLETE"
    reasons = [f"{name}: {device['incomplete']}" for name, device in summary.devices.items() if device["incomplete"]]
    state = "; ".join((state, *reasons))
    yield f"{summary.file}: {summary.seconds:.1f} s, {summary.bytes / 1e6:.1f} MB{marks}, {state}"


@contextlib.contextmanager
def _beside(
    arguments: argparse.Namespace, path: Path, target: float | None, reached: Callable[[], None]
) -> "Iterator[SecondProcess | None]":
    """The second process, where it is asked for."""
    if arguments.identify is None:
        yield None
        return
    from uq.runs.live.second_process import SecondProcess

    process = SecondProcess(arguments.rig, arguments.identify, str(path), target, reached)
    try:
        yield process
    finally:
        process.close()


def _identified(path: Path, experiment: str, reached: float | None, say: Callable[[str], None]) -> bool:
    """Print what ``inertia identify`` says of the file, a target that it misses first; return whether it could."""
    from uq.cli.terminal.common import finish, start_jax
    from uq.experiment.experiment import Experiment
    from uq.files.mistakes import MISTAKES
    from uq.report.certificate.certificate import Certificate
    from uq.runs.identification.identify_files import identify_files
    from uq.runs.live.estimate_lines import missed

    start_jax()
    try:
        result = identify_files([str(path)], Experiment.load(experiment))
    except MISTAKES as error:
        say(f"error: {path} is recorded, but cannot be identified: {on_one_line(str(error))}")
        return False
    print()
    if reached is not None and (text := missed(result.interval95, reached, result.contradicted)):
        print(text)
    finish(Certificate(result), None)
    return True


def _watch(arguments: argparse.Namespace) -> int:
    from rig.record import live_values, rig_file
    from rig.record.session import Stop

    stop = Stop()
    with _on_signal(stop.set):
        for line in live_values.watch(rig_file.load_rig(arguments.rig), stop, seconds=arguments.seconds):
            print(on_one_line(line), flush=True)
    return 0


def _list(ports: list[str]) -> int:
    from rig.record import discover

    answers = discover.discover(ports or None)
    for line in discover.table(answers):
        print(on_one_line(line))
    return 0
