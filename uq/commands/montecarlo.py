"""``inertia montecarlo``: any body, platform, sensors and trajectory."""

import argparse

from uq.budget_result import BudgetResult
from uq.campaign import montecarlo
from uq.commands._common import ERRORS, ProgressBar, finish, output_folder, start_jax, whole_number
from uq.experiment import Experiment
from uq.source_budget import budget

__all__ = ["ERRORS", "configure", "run"]


def configure(parser: argparse.ArgumentParser) -> None:
    """Add the command's arguments."""
    parser.add_argument("experiment", metavar="EXPERIMENT.toml", help="an experiment file, or the preset barreto2016")
    parser.add_argument("--trials", type=whole_number, default=10_000, help="number of trials (10000)")
    parser.add_argument("--seed", type=whole_number, default=0, help="seed of every draw (0)")
    parser.add_argument("--trajectory", action="append", metavar="NAME", help="a trajectory; repeatable (all)")
    parser.add_argument("--estimator", action="append", metavar="NAME", help="an estimator; repeatable (all)")
    parser.add_argument(
        "--dtype", choices=("float64", "float32"), default="float64", help="precision of the draws (float64)"
    )
    parser.add_argument(
        "--budget", nargs="?", type=whole_number, const=1000, metavar="PAIRS",
        help="who causes what: shares of every source and group, from this many pairs of trials (1000)",
    )  # fmt: skip
    parser.add_argument("--out", metavar="DIR", help="folder for result.json, report.html and the figures")


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    start_jax()
    experiment = Experiment.load(arguments.experiment)
    with output_folder(arguments.out) as out:
        with ProgressBar() as progress:
            result = montecarlo(
                experiment,
                trials=arguments.trials,
                seed=arguments.seed,
                trajectories=arguments.trajectory,
                estimators=arguments.estimator,
                dtype=arguments.dtype,
                progress=progress,
            )
            more = [] if arguments.budget is None else [_budget(experiment, arguments, progress)]
        finish(result, out, *more)
    return 0


def _budget(experiment: Experiment, arguments: argparse.Namespace, progress: ProgressBar) -> BudgetResult:
    return budget(
        experiment,
        trials=arguments.budget,
        seed=arguments.seed,
        trajectories=arguments.trajectory,
        estimators=arguments.estimator,
        dtype=arguments.dtype,
        progress=progress,
    )
