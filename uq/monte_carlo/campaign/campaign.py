"""The Monte Carlo campaign: thousands of trials, batched, on every device; statistics of each case and estimator."""

import numbers
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any, get_args

import jax
import jax.numpy as jnp
import numpy as np
from jax import process_count

from identify.exceptions import explains_names
from identify.floating_point import check_precision
from identify.signals.estimator_spec import EstimatorSpec
from rig.exceptions import quoted
from uq.experiment.experiment import Experiment, ExperimentError, TrajectorySpec
from uq.experiment.experiment_tables import left_out_note
from uq.files.provenance import code_digest, provenance
from uq.monte_carlo.campaign.campaign_result import MonteCarloResult
from uq.monte_carlo.campaign.statistics import Breakdown, Statistics, breakdown
from uq.monte_carlo.campaign.trial_setup import setting_of, true_motions
from uq.monte_carlo.coverage.adaptive_procedure import Blocks, Goal, Stability, not_stable
from uq.monte_carlo.trials.checkpoint import Checkpoint
from uq.monte_carlo.trials.chooser import EngineName, engine_of
from uq.monte_carlo.trials.engine import Engine, Estimates
from uq.monte_carlo.trials.joined_processes import agree, in_turn, meet
from uq.monte_carlo.trials.trial_loop import TrialLoop, trials_in
from uq.progress_bar import Progress, progress_of
from uq.sources.quasi_random import REPLICATES, Points

LEAST_QUASI_RANDOM = 16 * REPLICATES
"""Fewer trials are random: a replicate's dispersion would be hardly known."""

ShownFigures = Callable[[str, int, Mapping[str, Breakdown[Statistics]]], None]
"""Called with the trajectory's name, the trials done and the breakdowns by estimator."""


@dataclass(frozen=True)
class SamplingPlan:
    """The way trials are drawn: on it their numbers depend, besides the seed and the experiment."""

    engine: EngineName = "sums"
    """``sums`` draws what the noise of all samples leaves in the sums that an estimate needs
    (:mod:`uq.monte_carlo.trials.sums_engine`); cases that sums do not tell are computed by samples
    (:mod:`uq.monte_carlo.trials.chooser`). ``samples`` draws every sample
    (:mod:`uq.monte_carlo.trials.samples_engine`)."""
    points: Points = "random"
    """``quasi-random`` (:mod:`uq.sources.quasi_random`) for trials on sums in a number that is given, best 8 × 2^k."""
    dtype: str = "float64"
    """Precision of samples that are drawn, ``float64`` or ``float32``; sums over them have JAX's default precision."""
    goal: Goal | None = None
    """Run blocks of trials until estimate, standard uncertainty and coverage interval of every component, with all
    sources together, are stable for every trajectory and estimator
    (:mod:`uq.monte_carlo.coverage.adaptive_procedure`); None: the number of trials is given."""

    def check(self, trials: int) -> None:
        """Refuse what cannot be.

        Raises:
            ExperimentError: no such engine, points that cannot be, too few trials for the goal.
        """
        if self.engine not in get_args(EngineName):
            raise ExperimentError(
                f"unknown engine {quoted(self.engine)}: choose one of {', '.join(get_args(EngineName))}"
            )
        possible = self.engine == "sums" and self.goal is None and trials >= LEAST_QUASI_RANDOM
        if self.points == "quasi-random" and not possible:
            raise ExperimentError(
                f"quasi-random trials are on sums, not adaptive, and {LEAST_QUASI_RANDOM} or more: leave points out"
            )
        if self.goal is not None and trials < 2 * self.goal.least_block:
            raise ExperimentError(f"{trials} trials: an adaptive campaign needs {2 * self.goal.least_block} or more")


@dataclass(frozen=True)
class RunOptions:
    """Options of the run that change no number: devices, batches, a checkpoint, progress."""

    devices: Sequence[jax.Device] | None = None
    """Devices to spread the trials over; None for all."""
    batch: int | None = None
    """Trials that one device computes at a time; None for what suits the engine."""
    checkpoint: Checkpoint | str | Path | None = None
    """Folder that keeps what is done, so that the same call goes on where it was interrupted."""
    progress: Progress | bool | None = None
    """Called after each segment of trials; True: a bar."""
    shown: ShownFigures | None = None
    """Called as a trajectory's figures come: by samples early, after 200 trials, and when it is done; not if
    adaptive."""


TRIALS, MOST_TRIALS = 10_000, 1_000_000
"""Trials of a campaign, and the most of an adaptive one, unless they are given."""

EARLY = 200
"""Trials after which a trajectory's figures are shown for the first time, where they take a while."""


@explains_names
def montecarlo(
    experiment: Experiment,
    *,
    trials: int | None = None,
    seed: int = 0,
    trajectories: str | Sequence[str] | None = None,
    estimators: str | Sequence[str] | None = None,
    plan: SamplingPlan = SamplingPlan(),
    options: RunOptions = RunOptions(),
) -> MonteCarloResult:
    """Run the Monte Carlo of an experiment.

    Every trial draws each source once and solves every estimator for all sources together, each group alone and each
    source alone, from the same draws. The numbers depend on the seed, the plan and the experiment, not on the options,
    nor on where a campaign was interrupted.

    Args:
        experiment: body, platform, trajectories, sources, estimators.
        trials: number of trials, at least 1; the most of them with a goal. None for 10,000, or 1,000,000 at most.
        seed: seed of every draw.
        trajectories: name or names of the trajectories; None for all.
        estimators: name or names of the estimators; None for all. Those that run together use the same samples.
        plan: how the trials are drawn.
        options: where and how they are run.

    Among several processes (:mod:`uq.monte_carlo.trials.joined_processes`) each computes its share of the trials; all
    return the result.

    Raises:
        ExperimentError: no trials, no such trajectory or estimator, nothing to estimate from, a plan that cannot be, or
            a checkpoint that is damaged or of another campaign.
    """
    for name, given in (("trials", trials), ("seed", seed)):
        if not isinstance(given, numbers.Integral | None) or (name, given) == ("seed", None):
            raise TypeError(f"Argument `{name}` must be a whole number, but is {given!r}.")
    trials = (MOST_TRIALS if plan.goal else TRIALS) if trials is None else trials
    if trials < 1:
        raise ExperimentError(f"{trials} trials: ask for one or more")
    if options.batch is not None and options.batch < 1:
        raise ExperimentError(f"batch of {options.batch}: ask for one or more")
    plan.check(trials)
    warned = check_precision(plan.dtype)
    plan = replace(plan, dtype="float32") if warned else plan
    campaign = Campaign(
        experiment=experiment, estimators=experiment.selected_estimators(estimators),
        trajectories=experiment.selected_trajectories(trajectories), trials=trials, seed=seed, plan=plan,
        options=options,
    )  # fmt: skip
    store = options.checkpoint
    store = Checkpoint(store) if isinstance(store, (str, Path)) else store
    try:
        campaign.start(store)
        if plan.goal is None:
            stability, breakdowns = None, campaign.run()
        else:
            trials, stability = campaign.run_until_stable(replace(plan.goal, joint=True))
            breakdowns = {name: campaign.breakdowns(name, trials) for name in campaign.loops}
    finally:
        if store is not None:
            store.close()
    meet()
    errors = {name: campaign.errors(name, 0, trials) for name in campaign.loops}
    about = campaign.settings | ({"computed": campaign.computed} if campaign.computed else {})
    record = provenance(**experiment.inputs(), trials=trials, seed=seed, **about)
    notes = [*warned, *_limits(stability, trials), *left_out_note(experiment.left_out)]
    return MonteCarloResult(
        trials=trials, seed=seed, nominal=campaign.truth, breakdowns=breakdowns, warnings=tuple(notes),
        provenance=record, errors=errors, stability=stability, points=plan.points,
    )  # fmt: skip


@dataclass(frozen=True)
class Campaign:
    """The trials of an experiment on its trajectories: as they were asked for, and as far as they have been run."""

    experiment: Experiment
    estimators: Sequence[EstimatorSpec]
    trajectories: Mapping[str, TrajectorySpec]
    trials: int
    """Number of trials; the most of them with a goal."""
    seed: int
    plan: SamplingPlan
    options: RunOptions
    loops: dict[str, TrialLoop] = field(default_factory=dict)
    """Trials of each trajectory so far, by its name."""
    computed: dict[str, dict[str, Any]] = field(default_factory=dict)
    """Words on the choice of a trajectory's engine (:mod:`uq.monte_carlo.trials.chooser`), where there are any."""

    @property
    def truth(self) -> np.ndarray:
        """The true tensor, packed [kg·m²]."""
        return np.asarray(self.experiment.body.inertia)

    @property
    def settings(self) -> dict[str, Any]:
        """Settings on which the numbers depend besides experiment, trials and seed."""
        return {"engine": self.plan.engine, "points": self.plan.points, "dtype": self.plan.dtype}

    def errors(self, name: str, first: int, last: int) -> np.ndarray:
        """Return estimate minus truth of these trials on a trajectory, (trials, estimators, cases, 6) [kg·m²]."""
        return np.asarray(self.loops[name].results(last, first)) - self.truth

    def breakdowns(self, name: str, trials: int) -> dict[str, Breakdown[Statistics]]:
        """Return the breakdowns of a trajectory by estimator."""
        errors, cases = self.errors(name, 0, trials), self.loops[name].problem.cases
        return {e.name: breakdown(cases, errors[:, k], self.plan.points) for k, e in enumerate(self.estimators)}

    def start(self, store: Checkpoint | None) -> None:
        """Prepare every trajectory; its trials go on where a checkpoint ends."""
        devices = list(self.options.devices or jax.devices())
        motions = true_motions(self.experiment, self.trajectories)
        if store is not None or process_count() > 1:
            identity = self._identity(devices)
            agree("campaigns", [identity, self.trials, list(self.trajectories)])
            if store is not None:
                in_turn(lambda: store.open(identity))
        points = (self.trials, self.seed) if self.plan.points == "quasi-random" else None
        for name, spec in self.trajectories.items():
            setting = setting_of(self.experiment, spec, self.estimators, motions.pop(name))
            engine, computed = engine_of(setting, engine=self.plan.engine, dtype=self.plan.dtype, points=points)
            self.computed.update({name: computed} if computed else {})
            resumed = {} if store is None else self._resumed(store, name, engine)
            self.loops[name] = engine.loop(self.seed, devices=devices, batch=self.options.batch, **resumed)

    def _resumed(self, store: Checkpoint, name: str, engine: Engine) -> dict[str, Any]:
        """Return the trials of a trajectory that a checkpoint holds, and what keeps further ones there."""
        shape = (len(self.estimators), len(engine.cases), 6)
        done: list[Estimates] = in_turn(partial(store.load, name, self.trials, shape))
        agree("checkpoints", sum(map(trials_in, done)))
        return {"done": done, "keep": partial(store.keep, name)}

    def run(self) -> dict[str, dict[str, Breakdown[Statistics]]]:
        """Run every trajectory to the end and show its figures; return its breakdowns."""
        progress, shown, breakdowns = progress_of(self.options.progress), self.options.shown, {}
        for name, loop in self.loops.items():
            early = shown and loop.segment <= EARLY < self.trials
            for trials in (EARLY, self.trials) if early else (self.trials,):
                loop.reach(trials, partial(progress, name), asked=self.trials)
                breakdowns[name] = self.breakdowns(name, trials)
                if shown:
                    shown(name, trials, breakdowns[name])
        return breakdowns

    def run_until_stable(self, goal: Goal) -> tuple[int, dict[str, dict[str, Stability]]]:
        """Run all trajectories block by block until every estimator is stable on each; trials, what is reached."""
        progress, block = progress_of(self.options.progress), goal.least_block
        pairs = [(name, k) for name in self.loops for k in range(len(self.estimators))]
        blocks = {pair: Blocks(goal, len(pairs)) for pair in pairs}
        needed, count = self.trials, len(self.loops)
        for trials in range(block, self.trials + 1, block):
            for place, (name, loop) in enumerate(self.loops.items()):
                others = place * trials + (count - 1 - place) * (trials - block)  # those of all trajectories together
                loop.reach(trials, lambda done, _: progress("adaptive", others + done, count * needed))  # noqa: B023
                error = self.errors(name, trials - block, trials)[:, :, 0]
                for k in range(len(self.estimators)):
                    blocks[name, k].add(error[:, k])
            stability = {pair: blocks[pair].stability() for pair in pairs}
            if all(reached.stable for reached in stability.values()):
                break
            more = (reached.trials_needed(trials) for reached in stability.values())
            needed = min(self.trials, max(trials + block, *more))
        return trials, {n: {e.name: stability[n, k] for k, e in enumerate(self.estimators)} for n in self.loops}

    def _identity(self, devices: Sequence[jax.Device]) -> dict[str, Any]:
        """Return the settings that a checkpoint and a campaign must share for the same bits to come out."""
        return {
            "seed": self.seed,
            **self.settings,
            "batch": self.options.batch,
            "experiment": self.experiment.inputs()["resolved"],
            "estimators": [e.name for e in self.estimators],
            "sums": str(jnp.result_type(float)),
            "devices": devices[0].device_kind,
            "jax": jax.__version__,
            "code": code_digest(),
        }


def _limits(stability: Mapping[str, Mapping[str, Stability]] | None, trials: int) -> list[str]:
    """A warning for every trajectory and estimator that the limit of trials left unstable."""
    return [
        f"{trajectory}, {estimator}: {not_stable(reached, trials)}"
        for trajectory, estimators in (stability or {}).items()
        for estimator, reached in estimators.items()
        if not reached.stable
    ]
