"""Sharper bounds of a design than reports state: ``python -m benchmarks.studies.design_bounds [EXPERIMENT]``.

Printed are the largest mean squares of a leg's acceleration, over the square of the largest acceleration, and the least
average 3σ of moments and products that follow (docs/explanation/design.md): by single excursions, which is the bound in
a design's report; by sums of squares (:mod:`benchmarks.studies.sums_of_squares`); and for motions that repeat
(:mod:`benchmarks.studies.repeating_signals`).
"""

import sys

import jax
import numpy as np

from benchmarks.studies.repeating_signals import ramp_mean_square, repeating_mean_square
from benchmarks.studies.sums_of_squares import mean_square_bound
from identify.motion.largest_mean_square import largest_mean_square
from identify.motion.leg_limits import Limits
from identify.motion.multisine import Multisine
from identify.motion.stages import rising
from uq.experiment.experiment import Experiment, TrajectorySpec
from uq.plan.motion_design.hexapod.design_bound import DesignBound, design_bound, largest_accelerations, largest_strokes
from uq.plan.motion_design.hexapod.rig_limits import resolved_limits

HARMONICS = 4
"""Most that a motion has which repeats: it does so within less than one more period of the bandwidth."""


def largest_ratio(experiment: Experiment, limits: Limits) -> float:
    """Return the largest ratio of a leg's speed limit to the speed of its largest acceleration at the band's edge."""
    return float((2 * np.pi * limits.bandwidth * limits.speed / largest_accelerations(experiment, limits)).max())


def bound_by_squares(experiment: Experiment, spec: TrajectorySpec, limits: Limits) -> DesignBound | None:
    """Return what no motion can beat, by sums of squares; the ratio of the least limited leg counts for all of them."""
    ratio, accelerations = largest_ratio(experiment, limits), largest_accelerations(experiment, limits)
    factor = min(mean_square_bound(ratio), excursion_mean_square(ratio)) if np.isfinite(ratio) else 1.0
    return design_bound(experiment, spec, limits, factor * accelerations**2)


def excursion_mean_square(ratio: float) -> float:
    """Return the largest mean square by single excursions, for a modulus of one: the bound that reports state."""
    return largest_mean_square(1.0, ratio, 1 / (2 * np.pi))


def repeating_bound(experiment: Experiment, spec: TrajectorySpec, limits: Limits) -> DesignBound | None:
    """Return what no motion can beat that repeats soon, or whose stages do, if this one does.

    Soon is within less than ``(HARMONICS + 1) / bandwidth``. Motions start and stop as this one does, and repeat for as
    long: its whole periods at full size. What is left counts as if the legs could be at their limits all the time.

    Args:
        experiment: body, platform and sources.
        spec: how long and how often is sampled; how stages start and stop.
        limits: in figures.

    Returns:
        The bound; None if this motion is of another kind, or where a leg's speed is free, or :func:`design_bound` None.
    """
    trajectory, accelerations = spec.trajectory, largest_accelerations(experiment, limits)
    ratio = largest_ratio(experiment, limits)
    if not (isinstance(trajectory, Multisine) and trajectory.period < longest_period(limits) and np.isfinite(ratio)):
        return None
    ramp, ends = float(trajectory.ramp), np.unique(np.asarray(trajectory.end))
    full = np.diff(ends, prepend=0.0) - 2 * ramp
    repeating = (np.floor(full / trajectory.period + 1e-6) * trajectory.period).sum()
    ramps = 2 * ramp * len(ends)
    window = np.asarray(rising(np.arange(1, 4001) / 4000 * ramp, ramp)) if ramp > 0 else np.zeros((4, 1))
    strokes = (largest_strokes(experiment, limits) / accelerations).max()
    in_ramps = ramp_mean_square(window[:3], ratio / (2 * np.pi * limits.bandwidth), strokes)
    remainder = spec.duration - repeating - ramps
    factor = (repeating * repeating_mean_square(ratio, HARMONICS) + ramps * in_ramps + remainder) / spec.duration
    return design_bound(experiment, spec, limits, factor * accelerations**2)


def longest_period(limits: Limits) -> float:
    """Return the period below which a motion has at most ``HARMONICS`` harmonics [s]."""
    return (HARMONICS + 1) / limits.bandwidth


def main(path: str = "uq/examples/designed.toml") -> None:
    """Print mean squares and bounds for an experiment's design and T1."""
    experiment = Experiment.load(path)
    limits = resolved_limits(experiment, 160)
    ratio = largest_ratio(experiment, limits)
    repeating = repeating_mean_square(ratio, HARMONICS)
    print(f"2πB v/a of the legs, at most                {ratio:.3f}")
    print("largest mean square over a², by excursions  " + f"{excursion_mean_square(ratio):.3f}")
    print(f"  by sums of squares                        {mean_square_bound(ratio):.3f}")
    print(f"  if it repeats within {longest_period(limits):.3g} s                 {repeating:.3f}")
    designed, reference = experiment.trajectories["designed"], experiment.trajectories["T1"]
    bounds = {
        "by excursions": design_bound(experiment, reference, limits),
        "by sums of squares": bound_by_squares(experiment, reference, limits),
        "of motions that repeat": repeating_bound(experiment, designed, limits),
    }
    for name, bound in bounds.items():
        figures = "–" if bound is None else f"{1e3 * bound.moments:.3f} / {1e3 * bound.products:.3f} g·m²"
        print(f"bound {name:<38}{figures}")


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    main(*sys.argv[1:])
