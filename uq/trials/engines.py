"""The engines of a trial behind one interface: by sums over blocks, sample by sample, or on Gram sums.

:mod:`uq.trials.trial` is the usual one, :mod:`uq.trials.samplewise` takes the cases that sums over samples cannot
express (:mod:`uq.trials.split`), `uq.trials.sums_engine` draws the sums themselves. Each is held
against the trial that ``docs/reference_trial.py`` spells out.
"""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import jax
from jaxtyping import Array, Int, Key

from identify.motion.trajectory import Motion, Trajectory
from identify.rigid_body.inertia import Body
from uq.gram_sums.error_maps import Platform
from uq.gram_sums.setup import EqualRotations, Estimator, Sampling, Setup, cases_of
from uq.sources.draws import Mixing
from uq.sources.source import Source
from uq.trials.samplewise import SampledSetup, needs_samples, prepare_samples, sampled_trial
from uq.trials.split import SplitSetup, first_trial, in_sums
from uq.trials.sums_engine import SumsEngine, sums_trials, with_points
from uq.trials.sums_setup import prepare_sums
from uq.trials.trial import TrialEstimates, prepare, trials, trials_of_equal_rotations
from uq.trials.trial_loop import SEGMENT, Progress, all_trials

AnySetup = Setup | SampledSetup | SumsEngine | SplitSetup
COLLAPSED_BATCH, COLLAPSED_SEGMENT = 250, 5000
"""Trials that a device computes at a time, and between two reports of progress, when they hold no samples."""


def prepare_any(
    motion: Motion,
    body: Body,
    platform: Platform,
    sources: Sequence[Source],
    estimators: Sequence[Estimator],
    *,
    trajectory: Trajectory,
    mixing: Sequence[Mixing] = (),
    dtype: str = "float64",
    sampling: Sampling = "conditioned",
) -> AnySetup:
    """Return what a trial needs: sums in the cases where they tell what the sources do, else every sample."""
    usual: dict[str, Any] = {"mixing": mixing, "dtype": dtype}
    if sampling == "samples":
        if needs_samples(sources, mixing):
            return prepare_samples(motion, body, platform, sources, estimators, trajectory=trajectory, **usual)
        return prepare(motion, body, platform, sources, estimators, sampling=sampling, **usual)
    split = in_sums(motion, trajectory, body, sources, mixing, drawn=sampling == "collapsed")
    parts: list[Any] = []
    if split.summed and sampling == "collapsed":
        parts.append(
            prepare_sums(
                motion, body, platform, split.sources, estimators,
                trajectory=trajectory, mixing=mixing, cases=split.summed,
            )
        )  # fmt: skip
    elif split.summed:
        parts.append(
            prepare(
                motion, body, platform, split.sources, estimators, cases=split.summed, delayed=split.delayed, **usual
            )
        )
    if len(parts) == 1 and not split.sampled and not split.same:
        return parts[0]
    by_samples = [
        prepare_samples(motion, body, platform, sources, estimators, trajectory=trajectory, cases=cases, **usual)
        for cases in (split.sampled, split.same)
        if cases
    ]
    same = first_trial(by_samples.pop()) if split.same else TrialEstimates.none(len(estimators))
    setups = (*parts, *by_samples)
    places = {case: k for k, case in enumerate([*split.summed, *split.sampled, *split.same])}
    cases = cases_of(sources)
    return SplitSetup(setups, same, cases, tuple(places[case] for case in cases))


def with_sobol_points(setup: AnySetup, trials: int, seed: int) -> AnySetup:
    """Return the set-up with so many quasi-random trials of what is drawn as sums (:mod:`uq.trials.sums_engine`)."""
    if isinstance(setup, SplitSetup):
        return replace(setup, parts=tuple(with_sobol_points(part, trials, seed) for part in setup.parts))
    return with_points(setup, trials, seed) if isinstance(setup, SumsEngine) else setup


def any_trials(
    setup: AnySetup | EqualRotations, key: Key[Array, ""], indices: Int[Array, " trials"], *, at_once: bool = False
) -> TrialEstimates:
    """Run several trials, for :class:`uq.trials.trial_loop.TrialLoop`."""
    if isinstance(setup, EqualRotations):
        return trials_of_equal_rotations(setup, key, indices, at_once=at_once)
    if isinstance(setup, SplitSetup):
        return setup.joined([any_trials(part, key, indices, at_once=at_once) for part in setup.parts], len(indices))
    if isinstance(setup, SumsEngine):
        return sums_trials(setup, key, indices)
    if isinstance(setup, Setup):
        return trials(setup, key, indices, at_once=at_once)
    by_number = lambda index: sampled_trial(setup, key, index)  # noqa: E731
    return jax.vmap(by_number)(indices) if at_once else jax.lax.map(by_number, indices)


def how_computed(setup: AnySetup, sources: Sequence[Source]) -> dict[str, Any]:
    """Return what a result says of sources that sums tell only nearly, and of cases that need every sample.

    ``in_sums``: what stands for a source where sums tell it; ``by_samples``: cases computed sample by sample; ``once``:
    those among them in which nothing is drawn.
    """
    parts = setup.parts if isinstance(setup, SplitSetup) else (setup,)
    in_sums = [part for part in parts if not isinstance(part, SampledSetup)]
    names = {name for part in in_sums for case in part.cases for name in case.sources}
    computed = {case.name for part in parts for case in part.cases}
    said = {
        "in_sums": {s.name: s.error_kind.in_sums_as for s in sources if s.error_kind.needs_samples and s.name in names},
        "by_samples": [case.name for part in parts if isinstance(part, SampledSetup) for case in part.cases],
        "once": [case.name for case in setup.cases if case.name not in computed],
    }
    return {key: value for key, value in said.items() if value}


def segment_for(setup: AnySetup) -> int:
    """Return about how many trials a device does between two reports of progress."""
    parts = setup.parts if isinstance(setup, SplitSetup) else [setup]
    return COLLAPSED_SEGMENT if all(isinstance(part, SumsEngine) for part in parts) else SEGMENT


def default_batch(device: jax.Device, sampling: Sampling = "conditioned") -> int:
    """Return how many trials a device computes at a time."""
    if sampling == "collapsed":
        return COLLAPSED_BATCH
    return 8 if device.platform == "cpu" else 64


def run_trials(
    setup: AnySetup,
    trials: int,
    seed: int,
    devices: Sequence[jax.Device],
    batch: int = 1,
    progress: Progress | None = None,
) -> TrialEstimates:
    """Run trials 0 … ``trials`` - 1 spread over devices; return NumPy arrays with the trials on the leading axis."""
    return all_trials(
        any_trials, setup, trials, seed, devices=devices, batch=batch, segment=segment_for(setup), progress=progress
    )
