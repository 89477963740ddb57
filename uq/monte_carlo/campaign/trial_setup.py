"""Preparation of the trials of a trajectory: platform, true motion, fitted estimators, set-up."""

from collections.abc import Mapping, Sequence
from typing import Any

import jax
import numpy as np

from identify.motion.trajectory import Motion, further_from_still, sample
from identify.signals.estimator_spec import EstimatorSpec
from uq.experiment.experiment import Experiment, ExperimentError, TrajectorySpec, samples
from uq.monte_carlo.gram_sums.cases import Estimator
from uq.monte_carlo.gram_sums.error_maps import Platform
from uq.monte_carlo.trials.chooser import engine_of
from uq.monte_carlo.trials.engine import Engine, TrialSetting
from uq.monte_carlo.trials.trial_loop import RUN_ONCE
from uq.sources.draws import BLOCK

_sampled = jax.jit(sample, compiler_options=RUN_ONCE)


def setting_of(
    experiment: Experiment, spec: TrajectorySpec, estimators: Sequence[EstimatorSpec], motion: Motion | None = None
) -> TrialSetting:
    """Return what the engines of an experiment on one trajectory are prepared from; its motion where it is known.

    Raises:
        ExperimentError: an estimator needs more samples than the trajectory has, or a higher rate.
    """
    motion = motion or true_motion(experiment, spec)
    return TrialSetting(
        motion=motion, trajectory=spec.trajectory, body=experiment.body, platform=platform_of(experiment, spec),
        sources=experiment.sources, mixing=experiment.mixing,
        estimators=fitted_estimators(estimators, spec, len(motion.t)),
    )  # fmt: skip


def prepare_engine(
    experiment: Experiment, spec: TrajectorySpec, estimators: Sequence[EstimatorSpec], **choice: Any
) -> tuple[Engine, dict[str, Any]]:
    """Return the engine of an experiment's trials on one trajectory, and how it was chosen; see :func:`setting_of`.

    Further arguments are those of :func:`uq.monte_carlo.trials.chooser.engine_of`.
    """
    return engine_of(setting_of(experiment, spec, estimators), **choice)


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
    return _sampled(
        spec.trajectory,
        jax.device_put(samples(spec)),  # jnp.asarray of a NumPy array compiles a program for every shape
        r_cg_from_still=platform.r_cg_from_still,
        gravity=platform.gravity,
    )


def true_motions(experiment: Experiment, specs: Mapping[str, TrajectorySpec]) -> dict[str, Motion]:
    """Return the true motions by name; rotations that differ only in the point that keeps still are computed once."""
    motions: dict[str, Motion] = {}
    for name, spec in specs.items():
        equal = next((other for other in motions if same_rotation(specs[other], spec)), None)
        if equal is None:
            motions[name] = true_motion(experiment, spec)
        else:
            still, still_of_equal = (platform_of(experiment, x).r_cg_from_still for x in (spec, specs[equal]))
            motions[name] = further_from_still(motions[equal], np.asarray(still) - np.asarray(still_of_equal))
    return motions


def same_rotation(first: TrajectorySpec, second: TrajectorySpec) -> bool:
    """Return whether two trajectories have one rotation, sampled at the same instants."""
    return first.trajectory == second.trajectory and (first.duration, first.rate) == (second.duration, second.rate)


def platform_of(experiment: Experiment, spec: TrajectorySpec) -> Platform:
    """Return what carries the body on a trajectory."""
    return Platform(np.array(experiment.gravity), experiment.r_cg_from_still(spec))


def _fitted(estimator: EstimatorSpec, rate: float) -> Estimator:
    if estimator.lowpass is not None:
        raise ExperimentError(
            f"estimator '{estimator.name}' has a low-pass, which is for recorded runs: leave it out here"
        )
    try:
        return Estimator(estimator.name, jax.device_put(estimator.taps(rate)))
    except ValueError as error:
        raise ExperimentError(f"estimator '{estimator.name}': {error}") from None
