"""``inertia montecarlo``: any body, platform, sensors and trajectory."""

import argparse
from collections.abc import Collection
from itertools import product
from pathlib import Path
from typing import Any

from identify.display.reporting import Result
from rig.exceptions import choose, quoted
from uq.analysis.propagation.experiment_law import law
from uq.analysis.propagation.law_result import LawResult
from uq.analysis.propagation.law_validation import validate_law
from uq.analysis.sensitivity.budget_shares import FEWEST_PAIRS
from uq.analysis.sensitivity.source_budget import budget
from uq.cli.terminal.command_parser import CommandParser
from uq.cli.terminal.common import finish, keep, output_folder, show, start_jax
from uq.cli.terminal.options import add_campaign_options, positive_quantity, swept_values, whole_number
from uq.cli.terminal.processes import add_cluster_options, checkpoint_in, resumable, together
from uq.cli.terminal.sources import add_without_option, shares_named
from uq.cli.terminal.terminal_bar import TerminalBar, say
from uq.experiment.experiment import Experiment, ExperimentError
from uq.monte_carlo.campaign.campaign import MOST_TRIALS, TRIALS, RunOptions, SamplingPlan, montecarlo
from uq.monte_carlo.campaign.campaign_result import MonteCarloResult
from uq.monte_carlo.campaign.sweep import sweep
from uq.monte_carlo.coverage.adaptive_procedure import Goal
from uq.monte_carlo.trials.checkpoint import Checkpoint
from uq.progress_bar import Progress
from uq.sources.quasi_random import Points


def configure(parser: CommandParser) -> None:
    """Add the command's arguments."""
    parser.value("experiment", "EXPERIMENT.toml", "an experiment file, or the preset barreto2016")
    parser.add_argument(
        "--trials", type=whole_number, help=f"number of trials ({TRIALS}); with --adaptive the most ({MOST_TRIALS})"
    )
    parser.value("--trajectory", "NAME", "a trajectory; repeatable (all)", action="append")
    parser.value("--estimator", "NAME", "an estimator; repeatable (all)", action="append")
    sampling = parser.add_mutually_exclusive_group()
    add_campaign_options(parser, sampling)
    sampling.add_argument(
        "--quasi-random", action="store_true", help="quasi-random trials: the same precision from fewer trials"
    )
    sampling.add_argument("--collapsed", action="store_true", help=argparse.SUPPRESS)
    parser.switch("--adaptive", "run until mean, uncertainty and 95 %% interval are stable")
    parser.add_argument(
        "--digits", type=whole_number, help="with --adaptive: significant digits of the uncertainty to be stable (1)"
    )
    parser.switch("--law", "show the law of propagation beside the Monte Carlo")
    parser.value("--tolerance", "'0.05 g*m^2'", "with --adaptive: the tolerance instead of digits")
    parser.value(
        "--budget", "PAIRS", nargs="?", type=whole_number, const=1000,
        text="shares of each source and group in the variance, from this many pairs of trials (1000)",
    )  # fmt: skip
    parser.value(
        "--sweep", "KEY=A:B:N",
        text="campaigns at N values of a number of the experiment, from the same draws, such as "
        "source.M_bias.sigma='0.01 N*m:0.1 N*m:10', or at values with commas between them; repeatable",
        action="append",
    )  # fmt: skip
    parser.value(
        "--against", "NAME",
        "3σ of each motion over that of this one, by component, from the same draws, which tell small differences; "
        "with --sweep: of each value over that at this one",
    )  # fmt: skip
    add_without_option(parser)
    add_cluster_options(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    goal = _goal(arguments)
    if arguments.budget is not None and arguments.budget < FEWEST_PAIRS:
        raise ExperimentError(f"--budget is {arguments.budget}: ask for {FEWEST_PAIRS} pairs of trials or more")
    if arguments.budget is not None and arguments.distributed:
        raise ExperimentError("--budget is for one process: leave out --distributed, or make the budget by itself")
    if arguments.collapsed:
        say("--collapsed is the default now: leave it out")
    start_jax(alone=not arguments.distributed)
    if arguments.sweep:
        return _swept(arguments)
    with together(arguments) as speaks:
        return _run(arguments, goal, speaks)


def _run(arguments: argparse.Namespace, goal: Goal | None, speaks: bool) -> int:
    loaded = Experiment.load_bodies(arguments.experiment)
    experiments = {name: experiment.without_source(*arguments.without) for name, experiment in loaded.items()}
    for experiment in experiments.values():
        _check_against(arguments.against, arguments.trajectory or experiment.trajectories)
    folders = {name: None if arguments.out is None else Path(arguments.out, name) for name in experiments}
    checkpoints = {name: checkpoint_in(folder) for name, folder in folders.items()}
    laws = {name: _law(arguments, name, experiment) for name, experiment in experiments.items() if arguments.law}
    with output_folder(arguments.out) as out:
        with resumable(out, arguments):
            campaigns = {
                name: _campaign(arguments, name, experiment, checkpoints[name], goal, speaks)
                for name, experiment in experiments.items()
            }
            budgets = {name: _budget(arguments, name, experiment) for name, experiment in experiments.items()}
        if not speaks:
            return 0
        results: dict[str, list[Result]] = {}
        for name, campaign in campaigns.items():
            by_law = [laws[name]] if name in laws else []
            beside = [] if arguments.against is None else [campaign.against(arguments.against)]
            checked = [validate_law(prediction, campaign) for prediction in by_law]
            results[name] = [campaign, *beside, *budgets[name], *checked]
            keep(folders[name], *results[name], *by_law)
        for checkpoint in checkpoints.values():
            if checkpoint is not None:
                checkpoint.remove()
        for name, shown in results.items():
            if name:
                print(f"\nbody {name}\n")
            show(folders[name], *shown)
    return 0


def _swept(arguments: argparse.Namespace) -> int:
    """Run the campaigns of a sweep."""
    for option in ("adaptive", "law", "budget", "distributed"):
        if getattr(arguments, option):
            raise ExperimentError(f"--{option} is of one campaign: leave it out with --sweep")
    values = dict(map(swept_values, arguments.sweep))
    keys = {", ".join(key): key for key in product(*values.values())}
    _check_against(arguments.against, keys)
    experiment = Experiment.load(arguments.experiment).without_source(*arguments.without)
    with output_folder(arguments.out) as out:
        with TerminalBar() as bar:
            result = sweep(
                experiment, values, trials=arguments.trials, **_choices(arguments), plan=_plan(arguments),
                options=RunOptions(progress=bar),
            )  # fmt: skip
        finish(result, out, *([] if arguments.against is None else [result.against(keys[arguments.against])]))
    return 0


def _check_against(name: str | None, names: Collection[str]) -> None:
    """Refuse a name that no case has, and a lone case."""
    if name is not None and name not in names:
        raise ExperimentError(f"--against is {quoted(name)}: {choose(name, names)}")
    if name is not None and len(names) < 2:
        raise ExperimentError(f"--against {name} has nothing beside it: give another --trajectory, or --sweep")


def _plan(arguments: argparse.Namespace, goal: Goal | None = None) -> SamplingPlan:
    points: Points = "quasi-random" if arguments.quasi_random else "random"
    return SamplingPlan(engine=arguments.engine, points=points, dtype=arguments.dtype, goal=goal)


def _law(arguments: argparse.Namespace, name: str, experiment: Experiment) -> LawResult:
    """The law, before any trial; shares of what it does not take are in the folder if a campaign was there before."""
    with shares_named(experiment, Path(arguments.out, name) if arguments.out else None):
        return law(experiment, arguments.trajectory, arguments.estimator)


def _campaign(
    arguments: argparse.Namespace,
    name: str,
    experiment: Experiment,
    checkpoint: Checkpoint | None,
    goal: Goal | None,
    speaks: bool,
) -> MonteCarloResult:
    with TerminalBar(silent=not speaks) as bar:
        return montecarlo(
            experiment, trials=arguments.trials, **_choices(arguments),
            plan=_plan(arguments, goal),
            options=RunOptions(checkpoint=checkpoint, progress=_by_body(name, bar)),
        )  # fmt: skip


def _by_body(name: str, bar: TerminalBar) -> Progress:
    """The bar, with the body's name before the trajectory's."""
    return lambda trajectory, *trials: bar(f"{name} {trajectory}".strip(), *trials)


def _choices(arguments: argparse.Namespace) -> dict[str, Any]:
    """Seed, trajectories and estimators, which campaign and budget share."""
    return {"seed": arguments.seed, "trajectories": arguments.trajectory, "estimators": arguments.estimator}


def _goal(arguments: argparse.Namespace) -> Goal | None:
    """Return the goal of an adaptive run; None: the number of trials is given."""
    if not arguments.adaptive:
        if arguments.digits is not None or arguments.tolerance is not None:
            raise ExperimentError("--digits and --tolerance are for an adaptive run: add --adaptive")
        return None
    if arguments.digits is not None and arguments.tolerance is not None:
        raise ExperimentError("--digits and --tolerance are given: choose one")
    tolerance = None
    if arguments.tolerance is not None:
        tolerance = positive_quantity("--tolerance", arguments.tolerance, "kg*m^2")
    try:
        return Goal(1 if arguments.digits is None else arguments.digits, tolerance)
    except ValueError as error:
        raise ExperimentError(f"adaptive: {error}") from None


def _budget(arguments: argparse.Namespace, name: str, experiment: Experiment) -> list[Result]:
    """The budget, if it is asked for."""
    if arguments.budget is None:
        return []
    with TerminalBar() as bar:
        result = budget(
            experiment, trials=arguments.budget, **_choices(arguments),
            engine=arguments.engine, dtype=arguments.dtype, progress=_by_body(name, bar),
        )  # fmt: skip
    return [result]
