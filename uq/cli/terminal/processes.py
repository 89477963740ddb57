"""Functions for commands that run on several processes: their options, who speaks, how they end."""

import argparse
import contextlib
import os
import sys
import threading
from collections.abc import Iterator
from pathlib import Path

from rig.exceptions import on_one_line, quoted
from uq.cli.terminal.command_parser import CommandParser
from uq.cli.terminal.options import whole_number
from uq.cli.terminal.terminal_bar import say
from uq.files.mistakes import MISTAKES, ExperimentError
from uq.monte_carlo.trials import joined_processes as cluster
from uq.monte_carlo.trials.checkpoint import Checkpoint

LOST = 3
"""Exit status when another process of a campaign is gone."""
ALONE = "the other processes did not join in time: start all of them, or allow more time with --patience"


def add_cluster_options(parser: CommandParser) -> None:
    """Add ``--distributed`` and what it needs where no cluster is detected."""
    parser.switch(
        "--distributed",
        "one of several processes that share the trials; found by the cluster's own environment, or stated:",
    )
    parser.value("--coordinator", "HOST:PORT", "address at which the first process listens")
    parser.value("--processes", "N", "number of processes", type=whole_number)
    parser.value("--process", "I", "number of this process, from 0", type=whole_number)
    parser.value(
        "--patience", "S", f"seconds to wait for the others at the start ({cluster.PATIENCE})", type=whole_number
    )


@contextlib.contextmanager
def together(arguments: argparse.Namespace) -> Iterator[bool]:
    """Join the other processes, if asked for; yields whether this one speaks.

    A process that fails among several ends at once, after its checkpoint is written: it must not wait for the others.
    """
    stated = [arguments.coordinator, arguments.processes, arguments.process]
    if not arguments.distributed:
        if any(value is not None for value in (*stated, arguments.patience)):
            raise ExperimentError(
                "--coordinator, --processes, --process and --patience are for several processes: add --distributed"
            )
        yield True
        return
    if any(value is None for value in stated) and any(value is not None for value in stated):
        raise ExperimentError("--coordinator, --processes and --process belong together: give all three, or none")
    if arguments.coordinator is not None:
        _check(*stated)
    patience = cluster.PATIENCE if arguments.patience is None else arguments.patience
    if patience < 1:
        raise ExperimentError(f"--patience is {patience}: give a second or more")
    timer = threading.Timer(patience, _end, [ExperimentError(ALONE)])
    timer.daemon = True
    timer.start()  # at twice the time JAX's runtime would abort this process with a page of its own
    cluster.join(arguments.coordinator, arguments.processes, arguments.process, patience)
    timer.cancel()
    try:
        yield cluster.is_first()
    except BaseException as error:
        _end(error)
    cluster.leave()


def _check(coordinator: str, processes: int, process: int) -> None:
    host, _, port = coordinator.rpartition(":")
    if not host or not (port.isascii() and port.isdecimal()) or not 0 < int(port[:6]) < 2**16:
        raise ExperimentError(f"--coordinator is {quoted(coordinator)}: write HOST:PORT, with a port from 1 to 65535")
    if not 0 <= process < processes:
        raise ExperimentError(f"--process is {process} of {processes}: number the processes from 0")


def _end(error: BaseException) -> None:
    line, status = None, 1
    if isinstance(error, cluster.FailedElsewhere):
        status = 2
    elif isinstance(error, KeyboardInterrupt):
        line, status = "error: interrupted; run the same command again to continue from --out", 130
    elif isinstance(error, cluster.LostProcess):
        line, status = f"error: {error}", LOST
    elif isinstance(error, (*MISTAKES, OSError)):
        line, status = f"error: {error}", 2
    else:
        sys.excepthook(type(error), error, error.__traceback__)
    if line:
        print(on_one_line(line), file=sys.stderr)
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(status)


def checkpoint_in(folder: Path | None) -> Checkpoint | None:
    """Return the store of finished trials in an output folder, until the result is written; None: no folder.

    Raises:
        ExperimentError: the store has files of no campaign, which is seen before any work is done.
    """
    if folder is None:
        return None
    store = Checkpoint(folder / "checkpoint", say=say)
    store.refuse_strangers()
    return store


@contextlib.contextmanager
def resumable(folder: Path | None, arguments: argparse.Namespace) -> Iterator[None]:
    """Let Ctrl-C say that the same command goes on, where one process keeps its finished trials in a folder."""
    try:
        yield
    except KeyboardInterrupt as error:
        if folder is None or arguments.distributed:
            raise
        raise KeyboardInterrupt("the same command continues from there") from error
