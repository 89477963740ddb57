"""One run's joint estimate: its uncertainty where the noise is not white in the motion's band."""

import pytest

from tests.helpers.short_runs import Answers, Case, fitted, laboratory


@pytest.mark.parametrize(
    ("case", "count"),
    [
        pytest.param(Case(1.0, "thrown", "drift", 10.0, "none"), 2, marks=pytest.mark.slow),
        (Case(5.0, "swung", "drift", None, "none"), 1),
    ],
)
def test_noise_that_drifts_is_counted_where_the_motion_is(case, count):
    """Of 20 or 10 runs a ratio of some three independent components has a standard error of 10 or 14 %.

    Noise at its mean level over the band, five times as wide as the motion, gives 3 and 2.
    """
    runs = [laboratory(case, seed) for seed in range(count)]
    answers = Answers.of([[fitted(case, [run], "joint") for run in repeats] for repeats in runs])
    assert 0.65 < answers.mean_ratio < 1.35
