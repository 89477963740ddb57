"""The Monte Carlo campaign: thousands of trials, batched, on every device; statistics of each case and estimator."""

from collections.abc import Callable, Mapping, Sequence
from itertools import cycle
from pathlib import Path
from typing import Any, get_args

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import process_count, process_index

from identify.motion.trajectory import Motion, further_from_still, sample
from identify.precision import check_precision
from identify.signals.estimator_spec import EstimatorSpec
from uq.campaign.campaign_result import MonteCarloResult
from uq.campaign.statistics import GRAM_METRE, Breakdown, Statistics, breakdown
from uq.coverage.adaptive_procedure import Blocks, Goal, Stability, not_stable
from uq.experiment.experiment import Experiment, ExperimentError, TrajectorySpec, samples
from uq.files.provenance import provenance
from uq.gram_sums.error_maps import Platform
from uq.gram_sums.setup import Estimator, Sampling
from uq.sources.source import BLOCK
from uq.trials.batches import Trials, run_trials
from uq.trials.checkpoint import Checkpoint, code_digest
from uq.trials.distributed import agree, in_turn, meet
from uq.trials.samplewise import AnySetup, needs_samples, prepare_any

__all__ = [
    "GRAM_METRE",
    "Breakdown",
    "MonteCarloResult",
    "Progress",
    "Statistics",
    "montecarlo",
    "prepare_setup",
    "run_trials",
    "true_motion",
]

TRIALS, MOST_TRIALS = 10_000, 1_000_000
"""Trials of a campaign, and the most of an adaptive one, unless they are given."""

COLLAPSED_BATCH = 1000
"""Trials that a device computes at a time when they hold no samples."""

EARLY = 200
"""Trials after which a trajectory's figures are shown for the first time."""

Shown = Callable[[str, int, Mapping[str, Breakdown]], None]
"""Called with the trajectory's name, the trials done and the breakdowns by estimator."""

Progress = Callable[[str, int, int], None]
"""Called with the trajectory's name, the trials done and the trials asked for."""


def montecarlo(
    experiment: Experiment,
    *,
    trials: int | None = None,
    seed: int = 0,
    trajectories: str | Sequence[str] | None = None,
    estimators: str | Sequence[str] | None = None,
    dtype: str = "float64",
    sampling: Sampling = "conditioned",
    adaptive: bool = False,
    digits: int = 1,
    tolerance: float | None = None,
    batch: int | None = None,
    devices: Sequence[jax.Device] | None = None,
    progress: Progress | None = None,
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
            Sources that need every sample (:mod:`uq.trials.samplewise`) have it sample by sample. ``"collapsed"`` draws
            the sums that the gyro's noise leaves, too, an approximation that costs nothing per sample
            (:mod:`uq.trials.collapsed`).
        adaptive: run blocks of trials until estimate, standard uncertainty and 95 % coverage interval of every
            component, with all sources together, are stable for every trajectory and estimator
            (:mod:`uq.coverage.adaptive_procedure`).
        digits: significant digits of the standard uncertainties that are to be stable, if adaptive.
        tolerance: the numerical tolerance of every component instead of digits [kg·m²].
        batch: trials that one device computes at a time; None for 8 on a CPU, 64 elsewhere, 500 if collapsed.
        devices: devices to spread the trials over; None for all.
        progress: called after each stretch of trials.
        checkpoint: folder that keeps what is done, so that the same call goes on where it was interrupted.
        shown: called as a trajectory's figures come: early, after 200 trials, and when it is done; not if adaptive.

    Among several processes (:mod:`uq.trials.distributed`) each computes its share of the trials, and all return the
    result.

    Raises:
        ExperimentError: no trials, no such trajectory or estimator, nothing to estimate from, a goal that cannot be,
            sources that ``sampling`` cannot draw, or a checkpoint that is damaged or of another campaign.
    """
    trials = (MOST_TRIALS if adaptive else TRIALS) if trials is None else trials
    goal = _goal(digits, tolerance, trials) if adaptive else None
    if trials < 1:
        raise ExperimentError(f"{trials} trials: ask for one or more")
    if sampling not in get_args(Sampling):
        raise ExperimentError(f"unknown sampling '{sampling}': choose one of {', '.join(get_args(Sampling))}")
    if batch is not None and batch < 1:
        raise ExperimentError(f"batch of {batch}: ask for one or more")
    if sampling != "collapsed" and needs_samples(experiment.sources, experiment.mixing):
        sampling = "samples"
    warned = check_precision(dtype)
    dtype = "float32" if warned else dtype
    if sampling == "collapsed" and dtype != "float64":
        raise ExperimentError(
            "sums are drawn (collapsed) in float64 only: leave dtype at float64, with JAX's float64 on"
        )
    devices = list(devices or jax.devices())
    batch = batch or (COLLAPSED_BATCH if sampling == "collapsed" else default_batch(devices[0]))
    chosen = [experiment.estimator(name) for name in distinct(estimators)] or list(experiment.estimators)
    if not chosen:
        raise ExperimentError("no [[estimator]] in the experiment: add one")
    wanted = distinct(trajectories) or list(experiment.trajectories) or [experiment.select()[0]]
    specs = dict(map(experiment.select, wanted))
    settings = {"seed": seed, "dtype": dtype, "sampling": sampling, "batch": batch}
    limit, truth = trials, np.asarray(experiment.body.inertia)
    motions = true_motions(experiment, specs, devices) if sampling == "collapsed" else {}
    kept = checkpoint_of(checkpoint) if isinstance(checkpoint, (str, Path)) else checkpoint

    def start(name: str) -> Trials:
        motion = motions.pop(name, None)
        with jax.default_device(None if motion is None else next(iter(motion.t.devices()))):
            setup = prepare_setup(experiment, specs[name], chosen, dtype=dtype, sampling=sampling, motion=motion)
        if kept is None:
            return Trials(setup, seed, devices, batch)
        done = in_turn(lambda: kept.load(name, limit))
        agree("checkpoints", sum(len(part.ok) for part in done))
        return Trials(setup, seed, devices, batch, done=done, keep=lambda *stretch: kept.keep(name, *stretch))

    try:
        if kept is not None or process_count() > 1:
            identity = _identity(experiment, chosen, devices, settings)
            agree("campaigns", [identity, limit, wanted])
        if kept is not None:
            in_turn(lambda: kept.open(identity))
        runs: dict[str, Trials] = {}
        breakdowns, stability = {}, None
        if goal is None:
            ahead = {name: start(name) for name in specs} if sampling == "collapsed" else {}  # side by side
            for run in ahead.values():
                run.begin(trials)
            for name in specs:
                runs[name] = ahead.get(name) or start(name)
                for so_far in (EARLY, trials) if shown and trials > EARLY else (trials,):
                    runs[name].reach(so_far, _named(progress, name), asked=trials)
                    breakdowns[name] = _breakdowns(runs[name], chosen, so_far, truth)
                    if shown:
                        shown(name, so_far, breakdowns[name])
        else:
            runs = {name: start(name) for name in specs}
            trials, stability = _until_stable(runs, [e.name for e in chosen], goal, trials, experiment, progress)
            breakdowns = {name: _breakdowns(run, chosen, trials, truth) for name, run in runs.items()}
    finally:
        if kept is not None:
            kept.close()
    meet()
    errors = {name: np.asarray(run.estimates(trials).inertia) - truth for name, run in runs.items()}
    record = provenance(**experiment.inputs(), trials=trials, **settings)
    warned = [*warned, *_limits(stability, trials)]
    return MonteCarloResult(trials, seed, truth, breakdowns, tuple(warned), record, errors, stability)


def checkpoint_of(folder: str | Path, say: Callable[[str], None] | None = None) -> Checkpoint:
    """Return the checkpoint in a folder, for this process among those of the campaign."""
    return Checkpoint(
        folder, say=say if process_index() == 0 else None, processes=process_count(), process=process_index()
    )


def _breakdowns(
    run: Trials, estimators: Sequence[EstimatorSpec], trials: int, truth: np.ndarray
) -> dict[str, Breakdown]:
    """Breakdowns of one trajectory by estimator."""
    inertia, ok = map(np.asarray, run.estimates(trials))
    return {
        estimator.name: breakdown(run.setup.cases, inertia[:, k] - truth, ok[:, k])
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
    runs: Mapping[str, Trials],
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
        found = {pair: blocks[pair].stability() for pair in pairs}
        if all(of.stable for of in found.values()):
            break
        asked = min(most, max(trials + block, *(of.trials_needed(trials) for of in found.values())))
    return trials, {name: {e: found[name, k] for k, e in enumerate(estimators)} for name in runs}


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
    """What a checkpoint must have in common with a campaign for the same bits to come out."""
    return {
        **settings,
        "experiment": experiment.inputs()["resolved"],
        "estimators": [e.name for e in estimators],
        "sums": str(jnp.zeros(()).dtype),
        "devices": devices[0].device_kind,
        "jax": jax.__version__,
        "code": code_digest(),
    }


def default_batch(device: jax.Device) -> int:
    """Return how many trials a device computes at a time."""
    return 8 if device.platform == "cpu" else 64


def distinct(given: str | Sequence[str] | None) -> list[str]:
    """Return names without repeats."""
    return list(dict.fromkeys([given] if isinstance(given, str) else given or []))


def prepare_setup(
    experiment: Experiment,
    spec: TrajectorySpec,
    estimators: Sequence[EstimatorSpec],
    *,
    dtype: str = "float64",
    sampling: Sampling = "conditioned",
    motion: Motion | None = None,
) -> AnySetup:
    """Return what a trial needs for one trajectory of an experiment, its motion where it is known.

    Raises:
        ExperimentError: an estimator needs more samples than the trajectory has, or a higher rate.
    """
    motion = motion or true_motion(experiment, spec)
    fitted = fitted_estimators(estimators, spec, len(motion.t))
    return prepare_any(
        motion,
        experiment.body,
        platform_of(experiment, spec),
        experiment.sources,
        fitted,
        mixing=experiment.mixing,
        dtype=dtype,
        sampling=sampling,
    )


def fitted_estimators(estimators: Sequence[EstimatorSpec], spec: TrajectorySpec, n: int) -> list[Estimator]:
    """Return estimators with their taps for a trajectory of ``n`` samples.

    Raises:
        ExperimentError: an estimator needs more samples than the trajectory has, or a higher rate.
    """
    fitted = [_fitted(e, spec.rate) for e in estimators]
    for estimator in fitted:
        needed = 2 * len(estimator.taps) + 2
        if len(estimator.taps) > BLOCK:
            raise ExperimentError(f"estimator '{estimator.name}' has more than {2 * BLOCK} points: give a higher band")
        if n < needed:
            raise ExperimentError(
                f"estimator '{estimator.name}' needs {needed} samples, but the trajectory has {n}: "
                "raise its duration or rate"
            )
    return fitted


def true_motion(experiment: Experiment, spec: TrajectorySpec) -> Motion:
    """Return a trajectory's true motion at its samples."""
    platform = platform_of(experiment, spec)
    return sample(
        spec.trajectory,
        jnp.asarray(samples(spec)),
        r_cg_from_still=platform.r_cg_from_still,
        gravity=platform.gravity,
    )


def true_motions(
    experiment: Experiment, specs: Mapping[str, TrajectorySpec], devices: Sequence[jax.Device]
) -> dict[str, Motion]:
    """Return the true motions by name; rotations that differ only in the point that keeps still are computed once.

    Different rotations are computed side by side on this process's own of the devices, where they are left.
    """
    own = cycle(device for device in devices if device.process_index == jax.process_index())
    found: dict[str, Motion] = {}
    for name, spec in specs.items():
        alike = next((other for other in found if _turn_alike(specs[other], spec)), None)
        if alike is None:
            with jax.default_device(next(own)):
                found[name] = true_motion(experiment, spec)
            continue
        still, of_alike = (platform_of(experiment, one).r_cg_from_still for one in (spec, specs[alike]))
        found[name] = further_from_still(found[alike], np.asarray(still) - np.asarray(of_alike))
    return found


def _turn_alike(one: TrajectorySpec, other: TrajectorySpec) -> bool:
    return bool(
        eqx.tree_equal((one.trajectory, one.duration, one.rate), (other.trajectory, other.duration, other.rate))
    )


def platform_of(experiment: Experiment, spec: TrajectorySpec) -> Platform:
    """Return what carries the body on a trajectory."""
    still = np.zeros(3) if spec.still == "cg" else experiment.r_cg_from_omb
    return Platform(spec.trajectory, np.array(experiment.gravity), still)


def _fitted(estimator: EstimatorSpec, rate: float) -> Estimator:
    if estimator.lowpass is not None:
        raise ExperimentError(
            f"estimator '{estimator.name}' has a low-pass, which is for recorded runs: leave it out here"
        )
    try:
        return Estimator(estimator.name, jnp.asarray(estimator.taps(rate)))
    except ValueError as error:
        raise ExperimentError(f"estimator '{estimator.name}': {error}") from None


def _named(progress: Progress | None, name: str) -> Callable[[int, int], None] | None:
    return None if progress is None else lambda done, asked: progress(name, done, asked)


def _overall(progress: Progress | None, before: int, asked: int) -> Callable[[int, int], None] | None:
    """Progress of an adaptive campaign: trials of all trajectories together, against those that seem to be needed."""
    return None if progress is None else lambda done, _: progress("adaptive", before + done, asked)
