"""The Monte Carlo campaign: thousands of trials, batched, on every device; statistics of each case and estimator."""

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, get_args

import jax
import jax.numpy as jnp
import numpy as np
from jax import process_count, process_index

from identify.exceptions import explains_names
from identify.floating_point import check_precision
from identify.signals.estimator_spec import EstimatorSpec
from rig.exceptions import quoted
from uq.campaign.campaign_result import MonteCarloResult
from uq.campaign.statistics import GRAM_METRE, Breakdown, Statistics, breakdown
from uq.campaign.trajectory_runs import TrajectoryRun, rotations_of, start_runs
from uq.campaign.trial_setup import prepare_setup, true_motions
from uq.coverage.adaptive_procedure import Blocks, Goal, Stability, not_stable
from uq.experiment.experiment import Experiment, ExperimentError
from uq.experiment.experiment_tables import left_out_note
from uq.files.provenance import code_digest, provenance
from uq.gram_sums.setup import Sampling
from uq.sources.quasi_random import REPLICATES, Points
from uq.trials.checkpoint import Checkpoint
from uq.trials.distributed import agree, in_turn, meet
from uq.trials.engines import AnySetup, default_batch, how_computed, with_sobol_points
from uq.trials.progress_bar import Progress, progress_of
from uq.trials.trial_loop import default_devices

__all__ = [
    "GRAM_METRE",
    "Breakdown",
    "MonteCarloResult",
    "Progress",
    "Statistics",
    "montecarlo",
]

TRIALS, MOST_TRIALS = 10_000, 1_000_000
"""Trials of a campaign, and the most of an adaptive one, unless they are given."""

LEAST_QUASI_RANDOM = 16 * REPLICATES
"""Fewer trials are random: a replicate's dispersion would be hardly known."""

EARLY = 200
"""Trials after which a trajectory's figures are shown for the first time."""

Shown = Callable[[str, int, Mapping[str, Breakdown[Statistics]]], None]
"""Called with the trajectory's name, the trials done and the breakdowns by estimator."""


@explains_names
def montecarlo(
    experiment: Experiment,
    *,
    trials: int | None = None,
    seed: int = 0,
    trajectories: str | Sequence[str] | None = None,
    estimators: str | Sequence[str] | None = None,
    dtype: str = "float64",
    sampling: Sampling = "conditioned",
    points: Points | None = None,
    adaptive: bool = False,
    digits: int = 1,
    tolerance: float | None = None,
    batch: int | None = None,
    devices: Sequence[jax.Device] | None = None,
    progress: Progress | bool | None = None,
    checkpoint: Checkpoint | str | Path | None = None,
    shown: Shown | None = None,
) -> MonteCarloResult:
    """Run the Monte Carlo of an experiment.

    Every trial draws each source once and solves every estimator for all sources together, each group alone and each
    source alone, from the same draws. The numbers depend on the seed, the dtype, the sampling and the experiment, not
    on ``batch`` or ``devices``, nor on where a campaign was interrupted.

    Args:
        experiment: body, platform, trajectories, sources, estimators.
        trials: number of trials, at least 1; the most of them if adaptive. None for 10,000, or 1,000,000 at most.
        seed: seed of every draw.
        trajectories: name or names of the trajectories; None for all.
        estimators: name or names of the estimators; None for all. Those that run together use the same samples.
        dtype: precision of the draws and features, ``"float64"`` or ``"float32"``.
        sampling: ``"conditioned"`` draws the load cell's white noise as the sums that it leaves, given the gyro's
            draws; ``"samples"`` draws it sample by sample. The distribution is the same (:mod:`uq.trials.trial`).
            Cases that sums do not tell (:mod:`uq.trials.split`) are computed sample by sample; with ``"samples"`` all
            are where a source is of a kind that sums tell only nearly (delay, quantisation). ``"collapsed"`` draws the
            sums that the gyro's noise leaves, too, an approximation that costs nothing per sample
            (:mod:`uq.trials.sums_engine`).
        points: ``"quasi-random"`` (:mod:`uq.sources.quasi_random`), for sums that are drawn (collapsed) in a number of
            trials that is given, best 8 × 2^k; or ``"random"``. None for quasi-random where they can be.
        adaptive: run blocks of trials until estimate, standard uncertainty and 95 % coverage interval of every
            component, with all sources together, are stable for every trajectory and estimator
            (:mod:`uq.coverage.adaptive_procedure`).
        digits: significant digits of the standard uncertainties that are to be stable, if adaptive.
        tolerance: the numerical tolerance of every component instead of digits [kg·m²].
        batch: trials that one device computes at a time; None for 8 on a CPU, 64 elsewhere, 250 if collapsed.
        devices: devices to spread the trials over; None for all.
        progress: called after each segment of trials; True: a bar.
        checkpoint: folder that keeps what is done, so that the same call goes on where it was interrupted.
        shown: called as a trajectory's figures come: early, after 200 trials, and when it is done; not if adaptive.

    Among several processes (:mod:`uq.trials.distributed`) each computes its share of the trials, and all return the
    result.

    Raises:
        ExperimentError: no trials, no such trajectory or estimator, nothing to estimate from, a goal that cannot be,
            sources that ``sampling`` cannot draw, or a checkpoint that is damaged or of another campaign.
    """
    progress = progress_of(progress)
    trials = (MOST_TRIALS if adaptive else TRIALS) if trials is None else trials
    goal = _goal(digits, tolerance, trials) if adaptive else None
    if trials < 1:
        raise ExperimentError(f"{trials} trials: ask for one or more")
    if sampling not in get_args(Sampling):
        raise ExperimentError(f"unknown sampling {quoted(sampling)}: choose one of {', '.join(get_args(Sampling))}")
    if batch is not None and batch < 1:
        raise ExperimentError(f"batch of {batch}: ask for one or more")
    warned = check_precision(dtype)
    dtype = "float32" if warned else dtype
    if sampling == "collapsed" and dtype != "float64":
        raise ExperimentError(
            "sums are drawn (collapsed) in float64 only: leave dtype at float64, with JAX's float64 on"
        )
    devices = list(devices or default_devices())
    batch = batch or default_batch(devices[0], sampling)
    chosen = [experiment.estimator(name) for name in distinct(estimators)] or list(experiment.estimators)
    if not chosen:
        raise ExperimentError("no [[estimator]] in the experiment: add one")
    wanted = distinct(trajectories) or list(experiment.trajectories) or [experiment.select()[0]]
    specs = dict(map(experiment.select, wanted))
    points = _points(points, sampling, trials, adaptive)
    settings = {"seed": seed, "dtype": dtype, "sampling": sampling, "points": points, "batch": batch}
    limit, truth = trials, np.asarray(experiment.body.inertia)
    motions = true_motions(experiment, specs, devices) if sampling == "collapsed" else {}
    store = checkpoint_of(checkpoint) if isinstance(checkpoint, (str, Path)) else checkpoint

    def prepared(name: str) -> AnySetup:
        motion = motions.pop(name, None)
        with jax.default_device(None if motion is None else next(iter(motion.t.devices()))):
            setup = prepare_setup(experiment, specs[name], chosen, dtype=dtype, sampling=sampling, motion=motion)
        return with_sobol_points(setup, limit, seed) if points == "quasi-random" else setup

    def start(names: Sequence[str]) -> dict[str, TrajectoryRun]:
        setups = {name: prepared(name) for name in names}
        return start_runs(setups, seed, limit, store, devices=devices, batch=batch)

    try:
        if store is not None or process_count() > 1:
            identity = _identity(experiment, chosen, devices, settings)
            agree("campaigns", [identity, limit, wanted])
        if store is not None:
            in_turn(lambda: store.open(identity))
        rotations = [[name] for name in specs] if sampling == "collapsed" else rotations_of(specs)
        runs: dict[str, TrajectoryRun] = {}
        breakdowns, stability = {}, None
        if goal is not None or sampling == "collapsed":  # side by side
            started = {name: run for names in rotations for name, run in start(names).items()}
            runs = {name: started[name] for name in specs}
        if goal is None:
            for run in runs.values():
                run.loop.begin(trials)
            for name in specs:
                if name not in runs:
                    runs |= start(next(names for names in rotations if name in names))
                for so_far in (EARLY, trials) if shown and trials > EARLY else (trials,):
                    runs[name].reach(so_far, _named(progress, name), asked=trials)
                    breakdowns[name] = _breakdowns(runs[name], chosen, so_far, truth, points)
                    if shown:
                        shown(name, so_far, breakdowns[name])
        else:
            trials, stability = _until_stable(runs, [e.name for e in chosen], goal, trials, experiment, progress)
            breakdowns = {name: _breakdowns(run, chosen, trials, truth, points) for name, run in runs.items()}
    finally:
        if store is not None:
            store.close()
    meet()
    errors = {name: np.asarray(runs[name].results(trials).inertia) - truth for name in specs}
    how = {name: said for name in specs if (said := how_computed(runs[name].setup, experiment.sources))}
    record = provenance(**experiment.inputs(), trials=trials, **settings, **({"computed": how} if how else {}))
    warned = [*warned, *_limits(stability, trials), *left_out_note(experiment.left_out)]
    return MonteCarloResult(trials, seed, truth, breakdowns, tuple(warned), record, errors, stability, points)


def _points(points: Points | None, sampling: Sampling, trials: int, adaptive: bool) -> Points:
    """Return the kind of points that trials are drawn from: as given, otherwise quasi-random where possible."""
    can_be = sampling == "collapsed" and not adaptive and trials >= LEAST_QUASI_RANDOM
    if points == "quasi-random" and not can_be:
        raise ExperimentError(
            "quasi-random trials are of sums that are drawn (collapsed), not adaptive, and "
            f"{LEAST_QUASI_RANDOM} or more: leave points out"
        )
    return points or ("quasi-random" if can_be else "random")


def checkpoint_of(folder: str | Path, say: Callable[[str], None] | None = None) -> Checkpoint:
    """Return the checkpoint in a folder, for this process among those of the campaign."""
    return Checkpoint(
        folder, say=say if process_index() == 0 else None, processes=process_count(), process=process_index()
    )


def _breakdowns(
    run: TrajectoryRun, estimators: Sequence[EstimatorSpec], trials: int, truth: np.ndarray, points: Points
) -> dict[str, Breakdown[Statistics]]:
    """Breakdowns of one trajectory by estimator."""
    inertia, ok = map(np.asarray, run.results(trials))
    return {
        estimator.name: breakdown(run.setup.cases, inertia[:, k] - truth, ok[:, k], points)
        for k, estimator in enumerate(estimators)
    }


def _goal(digits: int, tolerance: float | None, trials: int) -> Goal:
    try:
        goal = Goal(digits, tolerance, joint=True)
    except ValueError as error:
        raise ExperimentError(f"adaptive: {error}") from None
    if trials < 2 * goal.least_block:
        raise ExperimentError(f"{trials} trials: an adaptive campaign needs {2 * goal.least_block} or more")
    return goal


def _until_stable(
    runs: Mapping[str, TrajectoryRun],
    estimators: Sequence[str],
    goal: Goal,
    most: int,
    experiment: Experiment,
    progress: Progress | None,
) -> tuple[int, dict[str, dict[str, Stability]]]:
    """Run all trajectories block by block until every estimator is stable on each of them; trials, what is reached."""
    block, pairs = goal.least_block, [(name, k) for name in runs for k in range(len(estimators))]
    blocks = {pair: Blocks(goal, len(pairs)) for pair in pairs}
    truth = np.asarray(experiment.body.inertia)
    asked = most
    for trials in range(block, most + 1, block):
        for place, (name, run) in enumerate(runs.items()):
            others = place * trials + (len(runs) - 1 - place) * (trials - block)
            run.reach(trials, _overall(progress, others, len(runs) * asked))
            error = np.asarray(run.between(trials - block, trials).inertia)[:, :, 0] - truth
            for k in range(len(estimators)):
                blocks[name, k].add(error[:, k])
        stability = {pair: blocks[pair].stability() for pair in pairs}
        if all(of.stable for of in stability.values()):
            break
        asked = min(most, max(trials + block, *(of.trials_needed(trials) for of in stability.values())))
    return trials, {name: {e: stability[name, k] for k, e in enumerate(estimators)} for name in runs}


def _limits(stability: Mapping[str, Mapping[str, Stability]] | None, trials: int) -> list[str]:
    """A warning for every trajectory and estimator that the limit of trials left unstable."""
    return [
        f"{trajectory}, {estimator}: {not_stable(of, trials)}"
        for trajectory, estimators in (stability or {}).items()
        for estimator, of in estimators.items()
        if not of.stable
    ]


def _identity(
    experiment: Experiment,
    estimators: Sequence[EstimatorSpec],
    devices: Sequence[jax.Device],
    settings: Mapping[str, Any],
) -> dict[str, Any]:
    """Return the settings that a checkpoint and a campaign must share for the same bits to come out."""
    return {
        **settings,
        "experiment": experiment.inputs()["resolved"],
        "estimators": [e.name for e in estimators],
        "sums": str(jnp.result_type(float)),
        "devices": devices[0].device_kind,
        "jax": jax.__version__,
        "code": code_digest(),
    }


def distinct(given: str | Sequence[str] | None) -> list[str]:
    """Return names without repeats."""
    return list(dict.fromkeys([given] if isinstance(given, str) else given or []))


def _named(progress: Progress | None, name: str) -> Callable[[int, int], None] | None:
    return None if progress is None else lambda done, asked: progress(name, done, asked)


def _overall(progress: Progress | None, before: int, asked: int) -> Callable[[int, int], None] | None:
    """Progress of an adaptive campaign: trials of all trajectories together, against those that seem to be needed."""
    return None if progress is None else lambda done, _: progress("adaptive", before + done, asked)
