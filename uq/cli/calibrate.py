"""``inertia calibrate``: the rig's errors from runs of known bodies, as sources that an experiment includes."""

import argparse
from datetime import date

from rig.exceptions import quoted
from uq.bodies.calibration.calibrate_files import calibrate_files
from uq.cli.terminal.command_parser import CommandParser
from uq.cli.terminal.common import finish, output_folder, start_jax
from uq.cli.terminal.sources import new_sources_file, write_sources
from uq.experiment.experiment import Experiment
from uq.files.mistakes import ExperimentError


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
    output = new_sources_file(arguments.output)
    experiment = Experiment.load(arguments.experiment)
    with output_folder(arguments.out) as out:
        result = calibrate_files(bodies, experiment, due=_day(arguments.due))
        finish(result, out)
    write_sources(output, result.sources())
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
