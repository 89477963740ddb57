"""The comparison of trials by samples with those on sums reports what differs."""

import dataclasses

import pytest

from benchmarks.studies.sampled_paper import report
from uq.monte_carlo.campaign.campaign import montecarlo


@pytest.fixture(scope="module")
def campaigns(brief):
    options = {"trials": 4_000, "trajectories": ["T1", "T3"], "estimators": "smoothed"}
    return montecarlo(brief, **options), montecarlo(brief, seed=1, **options)


def largest(text):
    """The largest differences, in standard errors and in per cent of 3σ, and what they are of."""
    lines = [line.split(" differences: ")[1] for line in text.splitlines() if line.startswith("Largest")]
    return [(abs(float(line.split()[0])), line) for line in lines]


def test_two_seeds_agree(campaigns):
    """Some 240 differences: five standard errors, a false alarm in 7,000 seeds; of 3σ a standard error is 1.6 %."""
    text = report(*campaigns)
    assert len([line for line in text.splitlines() if line.startswith("| T")]) == 6
    (in_errors, _), (in_percent, _) = largest(text)
    assert 1 < in_errors < 5
    assert in_percent < 8


def test_a_mean_that_differs_is_named(campaigns):
    sampled, other = campaigns
    before = sampled["T3", "smoothed"]
    total = dataclasses.replace(before.total, mean_error=before.total.mean_error + before.total.three_sigma)
    breakdown = dataclasses.replace(before, groups={**before.groups, "total": total})
    changed = dataclasses.replace(sampled, breakdowns={**sampled.breakdowns, "T3": {"smoothed": breakdown}})
    for value, line in largest(report(changed, other)):
        assert "mean error of" in line
        assert line.endswith("T3, smoothed, total.")
        assert value > 90
