"""``inertia paper``: the paper's Table 2 and figures, beside its printed values."""

import argparse
import contextlib
from collections.abc import Mapping

from uq.cli.terminal.command_parser import CommandParser
from uq.cli.terminal.common import keep, output_folder, show, start_jax
from uq.cli.terminal.options import add_campaign_options, whole_number
from uq.cli.terminal.processes import add_cluster_options, checkpoint_in, resumable, together
from uq.cli.terminal.terminal_bar import TerminalBar
from uq.monte_carlo.barreto2016 import paper
from uq.monte_carlo.campaign.campaign import RunOptions, SamplingPlan
from uq.monte_carlo.campaign.statistics import Breakdown, Statistics
from uq.report.tables.paper import row


def configure(parser: CommandParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("--trials", type=whole_number, default=10_000, help="number of trials (10000)")
    add_campaign_options(parser)
    add_cluster_options(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    start_jax(alone=not arguments.distributed)
    with together(arguments) as speaks, output_folder(arguments.out) as out:
        checkpoint = checkpoint_in(out)
        with TerminalBar(silent=not speaks) as progress:

            def show_rows(trajectory: str, trials: int, breakdowns: Mapping[str, Breakdown[Statistics]]) -> None:
                with contextlib.suppress(BrokenPipeError) if out else contextlib.nullcontext():  # its files count
                    for estimator, breakdown in breakdowns.items() if speaks else ():
                        progress.print(row(trajectory, trials, estimator, breakdown.total))

            plan = SamplingPlan(engine=arguments.engine, dtype=arguments.dtype)
            options = RunOptions(checkpoint=checkpoint, progress=progress, shown=show_rows)
            with resumable(out, arguments):
                result = paper(trials=arguments.trials, seed=arguments.seed, plan=plan, options=options)
        if speaks:
            keep(out, result)
            if checkpoint is not None:
                checkpoint.remove()
            print()
            show(out, result)
    return 0
