"""``inertia inspect``: what is in a run, and what is suspicious about it."""

import argparse
import json
from typing import TYPE_CHECKING

from rig.mcap.message_definitions import IMU
from uq.cli.terminal.command_parser import CommandParser

if TYPE_CHECKING:
    from uq.experiment.experiment import Experiment


NOT_COMPARED = "  wrench and motion are not compared: state in an experiment what moves the body, and give --experiment"
NO_NOISE = (
    "the experiment declares no noise: `inertia noise STILL.mcap -o sources.toml` measures it from a recording at rest"
)


def configure(parser: CommandParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("run", nargs="+", help="recorded runs (MCAP)")
    parser.value("--experiment", "E.toml", "meaning of the channels, mass, centre of gravity")
    parser.switch("--json", "one line of JSON a run instead of text")


def run(arguments: argparse.Namespace) -> int:
    """Inspect every run; 1 when something is suspicious."""
    from identify.display.text_tables import in_lines
    from uq.runs.inspection.inspect_run import inspect_run

    suspicious = False
    experiment = None if arguments.experiment is None else _load(arguments.experiment)
    for path in arguments.run:
        report = inspect_run(path, experiment)
        print(json.dumps(report.to_dict()) if arguments.json else in_lines(str(report)))
        suspicious = suspicious or bool(report.findings)
        if experiment is None and not arguments.json and not any(channel.type == IMU for channel in report.channels):
            print(NOT_COMPARED)
    if experiment is not None and not arguments.json and not any(source.noise for source in experiment.sources):
        print(NO_NOISE)
    return 1 if suspicious else 0


def _load(name: str) -> "Experiment":
    """Read the experiment. Loads JAX, which plain ``inspect`` does without."""
    from uq.cli.terminal.common import start_jax

    start_jax()
    from uq.experiment.experiment import Experiment

    return Experiment.load(name)
