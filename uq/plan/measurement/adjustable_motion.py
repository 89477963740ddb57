"""Effect of a motion's duration and amplitude on the law's numbers for a page."""

import dataclasses
from collections.abc import Sequence
from typing import Any

import numpy as np

from identify.motion.multisine import Multisine
from identify.motion.trajectory import SourceTrajectory
from uq.analysis.propagation.adjustable_law import adjustable, contributions_of
from uq.analysis.propagation.experiment_law import PreparedLaw, prepare_law
from uq.analysis.propagation.inputs import constants_of
from uq.experiment.experiment import TrajectorySpec
from uq.plan.measurement.required_duration import lasting, shortest

LARGEST = 2.0
"""Factor on duration and amplitude up to which they can be changed; the least is its inverse."""


def explorable(law: PreparedLaw) -> dict[str, Any]:
    """Return the law's numbers for a page, with what duration and amplitude do to each source's part."""
    content = adjustable(law.experiment, law.runs, law.estimators)
    motions = {name: _motion(law, name) for name in law.runs}
    for pair in content["pairs"]:
        number = law.estimators.index(pair["estimator"])
        pair["motion"] = {
            name: {"least": least, "variance": powers[0][number].tolist(), "mean": powers[1][number].tolist()}
            for name, (least, powers) in motions[pair["trajectory"]].items()
        }
    return content


def changed(spec: TrajectorySpec, duration: float, amplitude: float) -> TrajectorySpec:
    """Return a trajectory that lasts longer and swings further, each by a factor, its frequencies as they are."""
    trajectory: Any = spec.trajectory if duration == 1 else lasting(spec, duration * spec.duration).trajectory
    larger = trajectory if amplitude == 1 else trajectory.scaled(amplitude)
    return dataclasses.replace(spec, trajectory=larger, duration=float(duration * spec.duration))


def _motion(law: PreparedLaw, name: str) -> dict[str, tuple[float, list[np.ndarray]]]:
    """Return, by duration and amplitude, the least factor and parabolas of ln factor of variance and mean."""
    spec = law.experiment.trajectories[name]
    if not isinstance(spec.trajectory, (SourceTrajectory, Multisine)):
        return {}
    now = _parts(law, name, spec)
    least = min(max(1 / LARGEST, 1.001 * shortest(spec) / spec.duration), 1.0)
    effects = {}
    for key, lowest in (("duration", least), ("amplitude", 1 / LARGEST)):
        factors = [f for f in (lowest, LARGEST) if f != 1]
        parts = [_parts(law, name, changed(spec, **{"duration": 1.0, "amplitude": 1.0, key: f})) for f in factors]
        effects[key] = lowest, [_parabola(factors, [p[k] / _divisor(now[k]) for p in parts]) for k in range(2)]
    return effects


def _parts(law: PreparedLaw, name: str, spec: TrajectorySpec) -> tuple[np.ndarray, np.ndarray]:
    experiment = dataclasses.replace(law.experiment, trajectories={name: spec}, document={})
    run = prepare_law(experiment, name, law.estimators).runs[name]
    constants = constants_of(experiment.sources, experiment.mixing)
    return contributions_of(experiment, run, constants, spec.rate, np.ones(1)).by_noise()


def _divisor(values: np.ndarray) -> np.ndarray:
    return np.where(values == 0, np.inf, values)


def _parabola(factors: Sequence[float], ratios: Sequence[np.ndarray]) -> np.ndarray:
    """The two coefficients of a parabola through 0 at factor 1, in logarithms; zeros where a ratio is not positive."""
    good = np.min(ratios, axis=0) > 0
    logarithms = np.log(np.where(good, ratios, 1.0))
    x = np.log(factors)[:, None] ** np.arange(1, 1 + len(factors))
    solved = np.moveaxis(np.tensordot(np.linalg.inv(x), logarithms, 1), 0, -1)
    return np.round(np.concatenate([solved, np.zeros((*solved.shape[:-1], 2 - len(factors)))], axis=-1), 6)
