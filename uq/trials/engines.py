"""The engines of a trial behind one interface: by sums over blocks, sample by sample, or on Gram sums.

:mod:`uq.trials.trial` is the usual one, :mod:`uq.trials.samplewise` takes what sums over samples cannot express,
:mod:`uq.trials.collapsed` is for white normal noise and offsets alone. Each is held against the trial that
``docs/reference_trial.py`` spells out.
"""

from collections.abc import Sequence

import jax
from jaxtyping import Array, Int, Key

from identify.motion.trajectory import Motion, Trajectory
from identify.rigid_body.inertia import Body
from uq.files.document import ExperimentError
from uq.gram_sums.error_maps import Platform
from uq.gram_sums.setup import EqualRotations, Estimator, Sampling, Setup
from uq.sources.draws import Mixing
from uq.sources.source import Source
from uq.trials.collapsed import INSTEAD, REFUSED, CollapsedSetup, collapse, collapsed_trials
from uq.trials.samplewise import SampledSetup, needs_samples, prepare_samples, sampled_trial
from uq.trials.trial import TrialEstimates, prepare, trials, trials_of_equal_rotations
from uq.trials.trial_loop import SEGMENT, Progress, all_trials

AnySetup = Setup | SampledSetup | CollapsedSetup
COLLAPSED_BATCH, COLLAPSED_SEGMENT = 1000, 5000
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
    """Return what a trial needs: sums where they express all that the sources do, else every sample.

    Raises:
        ExperimentError: the sums are to be drawn, and their moments do not hold the effect of a source.
    """
    if sampling == "collapsed" and needs_samples(sources, mixing):
        raise ExperimentError(f"{REFUSED}, since a source needs every sample: {INSTEAD}")
    if needs_samples(sources, mixing):
        return prepare_samples(
            motion, body, platform, sources, estimators, trajectory=trajectory, mixing=mixing, dtype=dtype
        )
    if sampling == "collapsed":
        return collapse(motion, body, sources, estimators, mixing=mixing)
    return prepare(motion, body, platform, sources, estimators, mixing=mixing, dtype=dtype, sampling=sampling)


def any_trials(
    setup: AnySetup | EqualRotations, key: Key[Array, ""], indices: Int[Array, " trials"], *, at_once: bool = False
) -> TrialEstimates:
    """Run several trials, for :class:`uq.trials.trial_loop.TrialLoop`."""
    if isinstance(setup, EqualRotations):
        return trials_of_equal_rotations(setup, key, indices, at_once=at_once)
    if isinstance(setup, CollapsedSetup):
        return collapsed_trials(setup, key, indices)
    if isinstance(setup, Setup):
        return trials(setup, key, indices, at_once=at_once)
    by_number = lambda index: sampled_trial(setup, key, index)  # noqa: E731
    return jax.vmap(by_number)(indices) if at_once else jax.lax.map(by_number, indices)


def segment_for(setup: AnySetup) -> int:
    """Return about how many trials a device does between two reports of progress."""
    return COLLAPSED_SEGMENT if isinstance(setup, CollapsedSetup) else SEGMENT


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
