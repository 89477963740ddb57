"""The trials of each trajectory of a campaign; trajectories that differ in the point that keeps still run at once."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import jax
import numpy as np

from uq.campaign.trial_setup import same_rotation
from uq.experiment.experiment import TrajectorySpec
from uq.gram_sums.setup import EqualRotations, Setup
from uq.trials.checkpoint import Checkpoint
from uq.trials.distributed import agree, in_turn
from uq.trials.engines import AnySetup, any_trials, segment_for
from uq.trials.trial import TrialEstimates
from uq.trials.trial_loop import Progress, TrialLoop, trials_in


@dataclass(frozen=True)
class TrajectoryRun:
    """The trials of one trajectory so far; more are run on request."""

    setup: AnySetup
    loop: TrialLoop
    """Loop that runs the trials of this trajectory, or of several."""
    number: int | None
    """Index of the trajectory in ``loop``; None: it is the only one."""

    def reach(self, trials: int, progress: Progress | None = None, *, asked: int | None = None) -> None:
        """Run until there are so many trials; see :meth:`uq.trials.trial_loop.TrialLoop.reach`."""
        self.loop.reach(trials, progress, asked=asked)

    def results(self, trials: int) -> TrialEstimates:
        """Return the first so many trials as NumPy arrays."""
        return self.between(0, trials)

    def between(self, first: int, last: int) -> TrialEstimates:
        """Return trials ``first`` … ``last`` - 1, which must be done."""
        return _of_one(self.loop.between(first, last), self.number)


def rotations_of(specs: Mapping[str, TrajectorySpec]) -> list[list[str]]:
    """Return the trajectories' names, those that share a rotation together."""
    groups: list[list[str]] = []
    for name, spec in specs.items():
        equal = next((group for group in groups if same_rotation(specs[group[0]], spec)), None)
        if equal is None:
            groups.append([name])
        else:
            equal.append(name)
    return groups


def start_runs(
    setups: Mapping[str, AnySetup], seed: int, trials: int, store: Checkpoint | None, **options: Any
) -> dict[str, TrajectoryRun]:
    """Begin where a checkpoint ends, at once for trajectories of one rotation that are equally far.

    Args:
        setups: of trajectories that share a rotation.
        seed: seed of every draw.
        trials: how many are asked for.
        store: the checkpoint, if there is one.
        options: of :class:`uq.trials.trial_loop.TrialLoop`.
    """
    done: dict[str, list[TrialEstimates]] = {name: [] for name in setups}
    if store is not None:
        for name in setups:
            done[name] = in_turn(partial(store.load, name, trials))
            agree("checkpoints", sum(map(trials_in, done[name])))
    sizes = {tuple(map(trials_in, segments)) for segments in done.values()}
    if len(setups) > 1 and (len(sizes) > 1 or not all(isinstance(setup, Setup) for setup in setups.values())):
        alone = [_loop([name], [setup], seed, [done[name]], store, options) for name, setup in setups.items()]
        return {name: run for runs in alone for name, run in runs.items()}
    return _loop(list(setups), list(setups.values()), seed, list(done.values()), store, options)


def _loop(
    names: Sequence[str],
    setups: Sequence[Any],
    seed: int,
    done: Sequence[Sequence[TrialEstimates]],
    store: Checkpoint | None,
    options: Mapping[str, Any],
) -> dict[str, TrajectoryRun]:
    numbers = [None] if len(names) == 1 else list(range(len(names)))
    problem = setups[0] if len(names) == 1 else EqualRotations.of(setups)
    keep: Callable[[int, TrialEstimates], None] | None = None
    if store is not None:

        def keep(first: int, estimates: TrialEstimates) -> None:
            for name, number in zip(names, numbers, strict=True):
                store.keep(name, first, _of_one(estimates, number))

    segments = [parts[0] if len(parts) == 1 else _side_by_side(parts) for parts in zip(*done, strict=True)]
    loop = TrialLoop(any_trials, problem, seed, segment=segment_for(setups[0]), done=segments, keep=keep, **options)
    return {n: TrajectoryRun(setup, loop, k) for n, setup, k in zip(names, setups, numbers, strict=True)}


def _of_one(estimates: TrialEstimates, number: int | None) -> TrialEstimates:
    return estimates if number is None else jax.tree.map(lambda leaf: leaf[:, number], estimates)


def _side_by_side(parts: Sequence[TrialEstimates]) -> TrialEstimates:
    return jax.tree.map(lambda *leaves: np.stack(leaves, axis=1), *parts)
