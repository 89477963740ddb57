"""The verdict on a rig's repeatability: its false alarms counted, and the paper's own scatter."""

import dataclasses

import numpy as np
import pytest

from uq import law
from uq.runs.identification.run_scatter import scatter_verdict

MEASURED = [0.22, 1.79, 0.15, 0.01, 0.21, 0.48]
"""The paper's Table 3: standard deviation of five runs of T1, in the order I11 I12 I13 I22 I23 I33 [g·m²]."""


@pytest.mark.parametrize("repeats", [2, 5])
def test_false_alarms_come_as_often_as_stated(generator, repeats):
    """4,000 true predictions, components independent: 1 − (1 − 0.05/6)⁶ = 4.90 %; ± 4 standard errors, 1 in 16,000."""
    sigma = np.array([1.0, 2, 3, 4, 5, 6])
    scatter = (sigma * generator.normal(size=(4_000, repeats, 6))).std(axis=1, ddof=1)
    alarms = np.mean([not scatter_verdict(s, sigma, repeats, level=0.05).describes for s in scatter])
    expected = 1 - (1 - 0.05 / 6) ** 6
    assert abs(alarms - expected) < 4 * np.sqrt(expected * (1 - expected) / 4_000)


def test_too_much_and_too_little_are_told_apart():
    verdict = scatter_verdict([1.0, 1, 1, 0.01, 1, 9], np.ones(6), 5)
    np.testing.assert_array_equal(verdict.sign, [0, 0, 0, -1, 0, 1])
    assert (
        "I22 (0.010 against 1.0) scatters less and I33 (9.0 against 1.0) scatters more than it predicts" in verdict.text
    )
    assert scatter_verdict(np.zeros(6), np.ones(6), 3).sign.tolist() == [-1] * 6


PREDICTED = [0.953, 0.582, 0.671, 0.771, 0.583, 0.945]
"""What Table 1 predicts for it by the law, of runs that share their centre of gravity [g·m²]; the study checks it."""


def test_table_1_does_not_describe_the_repeatability_of_the_sources_rig():
    verdict = scatter_verdict(MEASURED, PREDICTED, 5)
    assert not verdict.describes
    assert "I22 (0.010 against 0.77) scatters less" in verdict.text
    assert verdict.sign.tolist() == [0, 1, 0, -1, 0, 0]  # I12 more: no noise of Table 1 would have it


@pytest.mark.study
def test_what_table_1_predicts(preset):
    anew = dataclasses.replace(preset, sources=tuple(s for s in preset.sources if s.target != "r_cg"))
    covariance = law(anew, "T1", "smoothed")["T1", "smoothed"].groups["total"].covariance
    np.testing.assert_allclose(1e3 * np.sqrt(np.diag(covariance)), PREDICTED, rtol=2e-3)


@pytest.mark.parametrize(
    ("measured", "predicted", "repeats", "words"),
    [
        (np.ones(6), np.ones(6), 1, "`repeats` must be 2 or more"),
        (np.ones(5), np.ones(6), 5, "must have 6 values"),
        (-np.ones(6), np.ones(6), 5, "zero or more"),
        (np.ones(6), np.zeros(6), 5, "above zero"),
        (np.full(6, np.nan), np.ones(6), 5, "finite"),
    ],
)
def test_bad_input(measured, predicted, repeats, words):
    with pytest.raises(ValueError, match=words):
        scatter_verdict(measured, predicted, repeats)
