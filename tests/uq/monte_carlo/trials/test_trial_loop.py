"""The loop of trials: each is done once, and under its own number."""

import jax
import numpy as np

from uq.monte_carlo.trials.trial_loop import TrialLoop


def numbers(problem, key, indices):
    return indices


def test_a_result_beyond_all_bodies_is_a_failed_trial():
    loop = TrialLoop(lambda problem, key, indices: 1e40 ** indices.astype(float), (), 0, devices=jax.devices()[:1])
    loop.reach(3)
    np.testing.assert_array_equal(loop.results(3), [1, 1e40, np.nan])


def test_each_trial_is_done_once_whatever_is_asked_for():
    """A segment of a campaign of 1,000 trials is longer than that of one which may stop at 30."""
    for asked in (1000, None):
        loop = TrialLoop(numbers, (), 0, devices=jax.devices()[:1], segment=100)
        for trials in (30, 60, 250):
            loop.reach(trials, asked=asked)
            np.testing.assert_array_equal(loop.results(trials), np.arange(trials))
