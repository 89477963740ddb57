"""``inertia calibrate``: the rig's errors from runs of known bodies, as sources that an experiment includes."""

import argparse
import os
from datetime import date
from pathlib import Path

from rig.atomic_files import replacing
from rig.exceptions import RigError, on_one_line, quoted
from uq.bodies.calibration.calibrate_files import calibrate_files
from uq.cli.terminal.command_parser import CommandParser
from uq.cli.terminal.common import finish, output_folder, start_jax
from uq.experiment.experiment import Experiment
from uq.files.mistakes import ExperimentError
from uq.files.toml_text import toml_text


def configure(parser: CommandParser) -> None:
    """Add the command's arguments."""
    parser.value("runs", "RUN.mcap", "recorded runs of the known body", nargs="*")
    parser.value(
        "--known", "BODY.toml", nargs="+", action="append", required=True,
        text="the known body, by its drawing or a CAD report; of several, each with its runs: --known A.toml a1.mcap …",
    )  # fmt: skip
    parser.value("--experiment", "E.toml", "the rig: channels, estimators, declared errors", required=True)
    parser.add_argument("-o", "--output", metavar="SOURCES.toml", help="file of sources to write; must not exist")
    parser.value("--due", "DAY", "day by which the rig is to be calibrated again, such as 2026-12-31")
    parser.value("--out", "DIR", "folder for result.json and report.html")


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    start_jax()
    bodies = _bodies(arguments.runs, arguments.known)
    output = None if arguments.output is None else Path(arguments.output)
    if output is not None and os.path.lexists(output):
        raise RigError(f"{quoted(str(output))} exists: give another name to -o")
    experiment = Experiment.load(arguments.experiment)
    with output_folder(arguments.out) as out:
        result = calibrate_files(bodies, experiment, due=_day(arguments.due))
        finish(result, out)
    if output is not None:
        with replacing(output) as file:  # another may have appeared meanwhile
            file.write(toml_text(result.sources()).lstrip().encode())
        print()
        print(on_one_line(f'{output} is written; use it in an experiment: include = ["{output.name}"]'))
    return 0


def _bodies(runs: list[str], known: list[list[str]]) -> list[tuple[str, list[str]]]:
    """Each known body with its runs."""
    if len(known) == 1 and len(known[0]) == 1:
        return [(known[0][0], runs)]
    if runs:
        raise ExperimentError(f"{runs[0]} stands before --known: name the runs of each body behind it")
    return [(body, its_runs) for body, *its_runs in known]


def _day(text: str | None) -> date | None:
    try:
        return None if text is None else date.fromisoformat(text)
    except ValueError:
        raise ExperimentError(f"--due is {quoted(text or '')}: write a date, such as 2026-12-31") from None
