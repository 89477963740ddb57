"""``inertia centre``: mass, centre of gravity and the load cell's offsets from static poses."""

import argparse

from uq.cli.terminal.command_parser import CommandParser
from uq.cli.terminal.common import finish, output_folder, start_jax
from uq.cli.terminal.options import add_window_options
from uq.experiment.experiment import Experiment
from uq.runs.identification.static_centre import centre_file
from uq.runs.recorded.time_window import windows_of_options


def configure(parser: CommandParser) -> None:
    """Add the command's arguments."""
    parser.value("poses", "POSES", "a table of static poses, one a row, or samples that hold them")
    parser.value("--experiment", "E.toml", "columns, units, signs, frames and local gravity", required=True)
    add_window_options(parser, "every still segment of a run is a pose")
    parser.value("--without", "N", "numbers of poses to leave out, from 1", type=int, nargs="+", default=[])
    parser.value("--out", "DIR", "folder for centre.json and report.html")


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    start_jax()
    experiment = Experiment.load(arguments.experiment)
    with output_folder(arguments.out) as out:
        windows = windows_of_options(arguments.limits)
        finish(centre_file(arguments.poses, experiment, windows=windows, without=arguments.without), out)
    return 0
