"""The sharper bounds of a design: those that docs/explanation/design.md states, and how that of repeating motions depends on ramps."""

import dataclasses

import numpy as np
import pytest

from benchmarks.studies.design_bounds import bound_by_squares, excursion_mean_square, repeating_bound
from identify.motion.multisine import Multisine
from tests.helpers.platform_experiment import on_a_platform
from uq.experiment.experiment import Experiment
from uq.plan.motion_design.hexapod.design_bound import design_bound
from uq.plan.motion_design.hexapod.rig_limits import resolved_limits


@pytest.mark.study
def test_the_bounds_in_the_docs():
    """uq/examples/designed.toml: sums of squares for any motion, corners of polytopes for those that repeat."""
    experiment = Experiment.load("uq/examples/designed.toml")
    limits = resolved_limits(experiment, 160)
    least = bound_by_squares(experiment, experiment.trajectories["T1"], limits)
    np.testing.assert_allclose([1e3 * least.moments, 1e3 * least.products], [1.531, 1.057], atol=6e-4)
    least = repeating_bound(experiment, experiment.trajectories["designed"], limits)
    np.testing.assert_allclose([1e3 * least.moments, 1e3 * least.products], [1.700, 1.174], atol=6e-4)


def test_the_largest_mean_square_by_excursions():
    assert excursion_mean_square(3.307) == pytest.approx(0.797, abs=1e-3)


@pytest.mark.study
def test_motions_that_repeat_have_a_bound_of_their_own(preset):
    """Above the general one, and the nearer to it the more of the run is ramps; T1 does not repeat, nor does a slow motion."""
    given = on_a_platform(preset, {"needs_of": "T1", "bandwidth": "3 Hz"})
    limits, base = resolved_limits(given, 20), given.trajectories["T1"]
    general = design_bound(given, base, limits)

    def of(frequency, ramp, start=None):
        amplitudes = np.full((6, np.size(frequency)), 0.01)
        motion = Multisine(np.atleast_1d(frequency), amplitudes, amplitudes, np.array(20.0), np.array(ramp), start)
        return repeating_bound(given, dataclasses.replace(base, trajectory=motion), limits)

    soon, longer, parts = of(1.0, 0.5), of(1.0, 2.0), of(1.0, 0.7)
    assert general.moments < longer.moments < soon.moments
    assert general.products < longer.products < soon.products
    assert parts.moments < soon.moments  # 0.6 s are left of whole periods
    for slow in (0.6, [0.6, 2.4], [1.0, 2.1], [1.0, 1.0, 0.5]):
        assert of(slow, 0.5, np.array([0, 0, 10.0]) if np.size(slow) == 3 else None) is None
    assert of([1.0, 3.0, 1.5], 0.5, np.array([0, 0, 10.0])) is not None
    assert repeating_bound(given, base, limits) is None
