"""The comparison of trials by samples with those on sums reports what differs."""

import dataclasses

import pytest

from benchmarks.studies.sampled_paper import report
from tests.helpers.small_campaign import TRIALS
from uq.monte_carlo.campaign.campaign import montecarlo


def campaigns(experiment, trials):
    """Two, of other seeds."""
    return [montecarlo(experiment, trials=trials, seed=seed, trajectories=["T1", "T3"]) for seed in (0, 1)]


def largest(text):
    """The largest differences, in standard errors and in per cent of 3σ, and what they are of."""
    lines = [line.split(" differences: ")[1] for line in text.splitlines() if line.startswith("Largest")]
    return [(abs(float(line.split()[0])), line) for line in lines]


@pytest.mark.slow
def test_two_seeds_agree(brief):
    """Some 480 differences: five standard errors, a false alarm in 3,500 seeds; of 3σ a standard error is 1.6 %."""
    text = report(*campaigns(brief, 4000))
    (in_errors, _), (in_percent, _) = largest(text)
    assert 1 < in_errors < 5
    assert in_percent < 8


def test_a_mean_that_differs_is_named(brief):
    """By 3σ: of 200 trials 30 standard errors of the difference of two means."""
    sampled, other = campaigns(brief, TRIALS)
    before = sampled["T3", "smoothed"]
    total = dataclasses.replace(before.total, mean_error=before.total.mean_error + before.total.three_sigma)
    breakdown = dataclasses.replace(before, groups={**before.groups, "total": total})
    changed = dataclasses.replace(
        sampled, breakdowns={**sampled.breakdowns, "T3": {**sampled.breakdowns["T3"], "smoothed": breakdown}}
    )
    text = report(changed, other)
    assert len([line for line in text.splitlines() if line.startswith("| T")]) == 12
    for value, line in largest(text):
        assert "mean error of" in line
        assert line.endswith("T3, smoothed, total.")
        assert value > 20
