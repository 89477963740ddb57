"""``inertia noise``: noise of every channel of a recording at rest, as sources that an experiment includes."""

import argparse
import os
from pathlib import Path

from rig.atomic_files import replacing
from rig.exceptions import RigError, on_one_line, quoted
from uq.cli.terminal.command_parser import CommandParser
from uq.cli.terminal.common import finish, output_folder, start_jax
from uq.experiment.experiment import Experiment
from uq.files.toml_text import toml_text
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
    output = None if arguments.output is None else Path(arguments.output)
    if output is not None and os.path.lexists(output):
        raise RigError(f"{quoted(str(output))} exists: give another name to -o")
    with output_folder(arguments.out) as out:
        result = still_noise(arguments.still, recording)
        finish(result, out)
    if output is not None:
        with replacing(output) as file:  # another may have appeared meanwhile
            file.write(toml_text(result.sources()).lstrip().encode())
        print()
        print(on_one_line(f'{output} is written; use it in an experiment: include = ["{output.name}"]'))
    return 0
