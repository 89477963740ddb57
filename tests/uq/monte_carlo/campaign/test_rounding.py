"""A simulated sample printed in both notations."""

import math

import pytest

from identify.display.rounding import (
    concise,
    with_uncertainty,
)


@pytest.mark.parametrize(
    ("value", "u", "plain", "short"),
    [
        (50000838.2, 31.7, "50000838 ± 32", "50000838(32)"),
        (5.02, 0.011, "5.020 ± 0.011", "5.020(11)"),
        (374.93, 4.94, "374.9 ± 4.9", "374.9(4.9)"),
        (4.8, 0.099, "4.800 ± 0.099", "4.800(99)"),
        (-0.00001, 0.5, "0.00 ± 0.50", "0.00(50)"),
        (1234567.0, 1234.0, "1234600 ± 1200", "1234600(1200)"),
        (7.0, 0.0, "7.000", "7.000"),
        (0.0, 0.0, "0", "0"),
        (3.7, 2e-16, "3.700", "3.700"),
        (381.0, 4e-8, "381.0", "381.0"),
        (-1.42e-9, 1.4e-9, "−1.4e−9 ± 1.4e−9", "−1.4e−9 ± 1.4e−9"),
        (2e-18, 1.1e-17, "0", "0"),
        (1e143, 0.0, "1.0e143", "1.0e143"),
        (1.0, math.nan, "1.000", "1.000"),
        (math.nan, 0.1, "–", "–"),
        (math.inf, 0.1, "∞", "∞"),
    ],
)
def test_both_notations(value, u, plain, short):
    assert with_uncertainty(value, u) == plain
    with concise():
        assert with_uncertainty(value, u) == short
