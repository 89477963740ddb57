"""``inertia plan``: which sensor is worth improving, and how long must I measure?"""

import argparse

from rig.exceptions import quoted
from uq.cli.terminal.command_parser import CommandParser
from uq.cli.terminal.common import finish, output_folder, start_jax
from uq.cli.terminal.options import positive_quantity
from uq.cli.terminal.sources import add_without_option, shares_named
from uq.cli.terminal.terminal_bar import TerminalBar
from uq.experiment.experiment import Experiment, ExperimentError
from uq.plan.measurement.measurement_plan import plan_measurement
from uq.plan.measurement.required_duration import GOALS
from uq.plan.measurement.sensor_worth import BOTH


def configure(parser: CommandParser) -> None:
    """Add the command's arguments."""
    parser.value("experiment", "EXPERIMENT.toml", "an experiment file, or the preset barreto2016")
    parser.value(
        "--target", "'0.5 g*m^2'", action="append",
        text="find the duration for this average 3σ; repeatable (half of the present one)",
    )  # fmt: skip
    parser.value(
        "--goal", "GOAL", action="append",
        text=f"components to be averaged: {', '.join(GOALS)}; repeatable (moments and products)",
    )  # fmt: skip
    parser.value("--trajectory", "NAME", "the trajectory (the first)")
    parser.value("--estimator", "NAME", "the estimator (the recording's, or the first)")
    add_without_option(parser)
    parser.value("--out", "DIR", "folder for result.json, report.html and the figure")


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    targets = [positive_quantity("--target", text, "kg*m^2") for text in arguments.target or ()]
    goals = list(dict.fromkeys(arguments.goal or BOTH))
    if unknown := [goal for goal in goals if goal not in GOALS]:
        raise ExperimentError(f"--goal is {quoted(unknown[0])}: choose one of {', '.join(GOALS)}")
    start_jax()
    experiment = Experiment.load(arguments.experiment).without_source(*arguments.without)
    with output_folder(arguments.out) as out:
        with TerminalBar(unit="steps") as bar, shares_named(experiment, out):
            plan = plan_measurement(
                experiment, targets, goals=goals, trajectory=arguments.trajectory, estimator=arguments.estimator,
                progress=bar,
            )  # fmt: skip
        finish(plan, out)
    return 0
