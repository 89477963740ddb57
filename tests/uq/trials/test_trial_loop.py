"""The loop of trials: each is done once, and under its own number."""

import jax
import numpy as np

from uq.trials.trial_loop import TrialLoop


def numbers(problem, key, indices):
    return indices


def test_each_trial_is_done_once_whatever_was_begun():
    """What is begun for a campaign of 1,000 trials is a longer segment than that of one which may stop at 30."""
    for begun in (1000, 30):
        loop = TrialLoop(numbers, (), 0, devices=jax.devices()[:1], segment=100)
        loop.begin(begun)
        for trials in (30, 60, 250):
            loop.reach(trials)
            np.testing.assert_array_equal(loop.results(trials), np.arange(trials))
