"""``inertia simulate``: a synthetic recorded run with the experiment's errors."""

import argparse

from rig.exceptions import on_one_line
from uq.cli.terminal.command_parser import CommandParser
from uq.cli.terminal.common import start_jax
from uq.cli.terminal.options import whole_number
from uq.experiment.experiment import Experiment, ExperimentError
from uq.monte_carlo.campaign.simulation import simulate


def configure(parser: CommandParser) -> None:
    """Add the command's arguments."""
    parser.value("experiment", "EXPERIMENT.toml", "an experiment file, or the preset barreto2016")
    parser.add_argument(
        "-o", "--output", metavar="RUN.mcap", required=True, help="the file to write; it must not exist"
    )
    parser.value("--trajectory", "NAME", "the trajectory (the first)")
    parser.add_argument("--seed", type=whole_number, default=0, help="seed of every draw (0)")
    parser.add_argument("--trial", type=whole_number, default=0, help="number of the Monte Carlo's trial (0)")


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    start_jax()
    if arguments.trial < 0:
        raise ExperimentError(f"trial {arguments.trial}: give zero or more")
    simulated = simulate(
        Experiment.load(arguments.experiment), arguments.trajectory, seed=arguments.seed, trial=arguments.trial
    )
    simulated.write(arguments.output)
    print(on_one_line(f"{simulated.run!r} written to {arguments.output}"))
    return 0
