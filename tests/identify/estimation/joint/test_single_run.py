"""One run's joint estimate: its uncertainty where the noise is not white in the motion's band."""

import pytest

from tests.helpers.short_runs import Answers, Case, fitted, laboratory


@pytest.mark.parametrize(
    "case", [Case(1.0, "thrown", "drift", 10.0, "none"), Case(5.0, "swung", "drift", None, "none")]
)
def test_noise_that_drifts_is_counted_where_the_motion_is(case):
    """20 runs: a ratio of some three independent components has 10 % standard error.

    Noise at its mean level over the band, five times as wide as the motion, gives 3 and 2.
    """
    runs = [laboratory(case, seed) for seed in range(2)]
    answers = Answers.of([[fitted(case, [run], "joint") for run in repeats] for repeats in runs])
    assert 0.65 < answers.mean_ratio < 1.35
