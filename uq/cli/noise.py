"""``inertia noise``: noise of every channel of a recording at rest, as sources that an experiment includes."""

import argparse

from uq.cli.terminal.command_parser import CommandParser
from uq.cli.terminal.common import finish, output_folder, start_jax
from uq.cli.terminal.sources import new_sources_file, write_sources
from uq.experiment.experiment import Experiment
from uq.runs.recorded.still_noise import still_noise


def configure(parser: CommandParser) -> None:
    """Add the command's arguments."""
    parser.value("still", "STILL.mcap", "a recording at rest, as long as a measurement or longer")
    parser.add_argument("-o", "--output", metavar="SOURCES.toml", help="file of sources to write; must not exist")
    parser.value("--experiment", "E.toml", "meaning of the channels: units, signs, frames")
    parser.value("--out", "DIR", "folder for result.json, report.html and the figure with the fit")


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    start_jax()
    recording = None if arguments.experiment is None else Experiment.load(arguments.experiment).recording
    output = new_sources_file(arguments.output)
    with output_folder(arguments.out) as out:
        result = still_noise(arguments.still, recording)
        finish(result, out)
    write_sources(output, result.sources())
    return 0
