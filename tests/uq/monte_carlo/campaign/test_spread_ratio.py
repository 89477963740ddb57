"""3σ over that of a reference from the same draws, against closed forms of correlated normal errors."""

import numpy as np
import pytest

from tests.helpers.small_campaign import campaign
from uq.monte_carlo.campaign.spread_ratio import FACTOR, spread_ratio

N = 4000


def correlated(rng, rho, scale=1.0, n=N):
    """Errors of two cases, six components each with this correlation between the cases."""
    common, a, b = rng.normal(size=(3, n, 6))
    root, rest = np.sqrt(np.abs(rho)), np.sqrt(1 - np.abs(rho))
    return scale * (root * common + rest * a), root * common + rest * b


@pytest.mark.parametrize("rho", [0.0, 0.9])
def test_ratio_and_standard_error_are_those_of_normal_errors(rho):
    """u of ln(s/s') is √((1 - ρ²)/n); its own spread among 6 components of 4,000 trials is 2 %: 5 of them allowed."""
    ratio = spread_ratio(*correlated(np.random.default_rng(0), rho, 1.1))
    expected = np.sqrt((1 - rho**2) / N)
    np.testing.assert_allclose(ratio.standard_error / ratio.value, expected, rtol=0.1)
    np.testing.assert_allclose(ratio.value, 1.1, atol=1.1 * 4 * expected)
    assert ratio.differs.all()


def test_equal_dispersions_are_called_different_in_one_campaign_of_twenty():
    """1,000 campaigns of 400 trials at ρ = 0.7: 50 expected, with a standard error of 7; three of them allowed."""
    rng = np.random.default_rng(1)
    false = sum(spread_ratio(*correlated(rng, 0.7, n=400)).differs.any() for _ in range(1000))
    assert 29 <= false <= 71
    assert pytest.approx(2.638, abs=1e-3) == FACTOR


def test_a_failed_trial_is_left_out_of_both_and_too_few_say_nothing():
    errors, reference = correlated(np.random.default_rng(2), 0.5, n=50)
    spoiled = errors.copy()
    spoiled[7] = np.nan
    kept = np.delete(np.arange(50), 7)
    np.testing.assert_allclose(
        spread_ratio(spoiled, reference).value, spread_ratio(errors[kept], reference[kept]).value
    )
    few = spread_ratio(errors[:3], reference[:3])
    assert np.isnan(few.value).all()
    assert not few.differs.any()


def test_a_campaign_is_compared_trial_by_trial():
    result = campaign()
    compared = result.against("T1")
    assert set(compared.ratios) == {(name, estimator) for name, estimator in result.pairs() if name != "T1"}
    ratio = compared.ratios["T4", "smoothed"]
    quotient = result["T4", "smoothed"].total.three_sigma / result["T1", "smoothed"].total.three_sigma
    np.testing.assert_allclose(ratio.value, quotient, rtol=1e-12)
    frame = compared.to_frame()
    assert frame.loc[("T4", "smoothed", "I33"), "ratio"] == ratio.value[5]
    assert {names[1] for names in result.against("T1", "central").ratios} == {"central", "smoothed"}
    with pytest.raises(KeyError, match="T9"):
        result.against("T9")
