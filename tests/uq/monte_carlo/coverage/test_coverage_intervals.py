"""Coverage intervals and regions against closed forms, their standard errors against repeats, the clause 8 verdict."""

import numpy as np
import pytest
from scipy import stats
from scipy.optimize import minimize_scalar

from uq.monte_carlo.coverage.adaptive_procedure import numerical_tolerance
from uq.monte_carlo.coverage.coverage_intervals import shortest_interval, symmetric_interval, validate
from uq.monte_carlo.coverage.coverage_regions import distance, ellipsoidal_region

MODELS = {
    "exponential": stats.expon(),
    "lognormal": stats.lognorm(0.5),
    "triangular": stats.triang(0.3, loc=-1, scale=3),
    "arc sine": stats.arcsine(loc=-1, scale=2),
}


def shortest_of(law, probability):
    """The shortest interval of a unimodal law, from its quantiles."""
    length = lambda a: law.ppf(a + probability) - law.ppf(a)  # noqa: E731
    found = minimize_scalar(length, bounds=(0, 1 - probability), method="bounded", options={"xatol": 1e-9})
    tail = 0.0 if length(0) <= found.fun else found.x
    return law.ppf(tail), law.ppf(tail + probability)


@pytest.mark.parametrize("name", MODELS)
@pytest.mark.parametrize("probability", [0.9, 0.99])
def test_symmetric_ends_are_the_quantiles(name, probability, generator):
    law = MODELS[name]
    found = symmetric_interval(law.rvs(50_000, random_state=generator), probability)
    low, high = law.ppf([(1 - probability) / 2, (1 + probability) / 2])
    # 16 comparisons of normal ends at 4 standard errors: 1e-3 false alarms
    assert abs(found.low - low) < 4 * found.low_standard_error
    assert abs(found.high - high) < 4 * found.high_standard_error


@pytest.mark.parametrize("name", ["exponential", "lognormal", "triangular"])
def test_shortest_ends_are_the_closed_form(name, generator):
    law = MODELS[name]
    found = shortest_interval(law.rvs(50_000, random_state=generator), 0.95)
    low, high = shortest_of(law, 0.95)
    assert abs(found.low - low) < 4 * found.low_standard_error
    assert abs(found.high - high) < 4 * found.high_standard_error
    assert found.length < symmetric_interval(law.rvs(50_000, random_state=generator), 0.95).length


@pytest.mark.parametrize(("of", "least", "most"), [(symmetric_interval, 0.85, 1.15), (shortest_interval, 0.7, 1.5)])
def test_standard_errors_are_the_scatter_over_repeats(of, least, most, generator):
    """400 repeats of 4,000 trials: the scatter is known to 3.5 %; the cube-root law of the shortest holds in the limit."""
    found = [of(MODELS["lognormal"].rvs(4000, random_state=generator), 0.9) for _ in range(400)]
    for end in ("low", "high"):
        scatter = np.std([getattr(interval, end) for interval in found])
        stated = np.sqrt(np.mean([getattr(interval, f"{end}_standard_error") ** 2 for interval in found]))
        assert least < stated / scatter < most, end


def test_the_ends_are_the_ones_that_the_supplement_counts():
    """M = 100, p = 0.95: q = 95, r = (100 - 95 + 1) // 2 = 3, so y_(3) and y_(98); M = 40: q = 38, r = 1."""
    found = symmetric_interval(np.arange(1.0, 101.0))
    assert (found.low, found.high) == (3, 98)
    assert (symmetric_interval(np.arange(1.0, 41.0)).low, symmetric_interval(np.arange(1.0, 41.0)).high) == (1, 39)
    found = shortest_interval(np.concatenate([np.arange(1.0, 100.0), [1000.0]]))
    assert found.high == found.low + 95
    assert found.high < 100


def test_several_outputs_and_failed_trials():
    draws = np.random.default_rng(1).normal(size=(1000, 2, 3))
    found = symmetric_interval(draws)
    assert found.low.shape == (2, 3)
    assert found.low[1, 2] == symmetric_interval(draws[:, 1, 2]).low
    broken = np.concatenate([draws[:, 0, 0], [np.nan, np.nan]])
    assert symmetric_interval(broken).low == found.low[0, 0]
    assert np.isnan(symmetric_interval(np.arange(10.0)).low)
    assert np.isnan(shortest_interval(np.zeros((0, 3))).high).all()


@pytest.mark.parametrize("probability", [0.0, 1.0, 95.0])
def test_a_probability_that_is_none(probability):
    with pytest.raises(ValueError, match="must lie between 0 and 1"):
        symmetric_interval(np.zeros(10), probability)


@pytest.mark.parametrize(
    ("uncertainty", "digits", "tolerance"),
    [(0.00035, 2, 5e-6), (0.00035, 1, 5e-5), (2.0, 1, 0.5), (9.97, 2, 0.5), (9.94, 2, 0.05), (0.0754, 1, 0.005), (0, 2, 0)],
)  # fmt: skip
def test_the_tolerance_is_half_of_the_last_digit(uncertainty, digits, tolerance):
    """The first and third are the examples of JCGM 101, 7.9.2; 9.97 is 10 with two digits."""
    assert numerical_tolerance(uncertainty, digits) == pytest.approx(tolerance, rel=1e-12)


# --- clause 8 ---


def test_a_law_that_holds_and_one_that_does_not(generator):
    interval = symmetric_interval(generator.normal(size=(400_000, 4)))
    half = np.array([1.96, 1.96, 1.70, 1.96])
    shift = np.array([0.0, 0.2, 0.0, 0.06])
    verdict = validate(shift - half, shift + half, interval, numerical_tolerance(np.ones(4), 2))
    assert verdict.holds.tolist() == [True, False, False, False]
    assert verdict.tolerance == pytest.approx(0.05)
    assert verdict.d_low == pytest.approx(shift - half + 1.96, abs=0.02)
    assert verdict.d_high == pytest.approx(shift + half - 1.96, abs=0.02)
    assert validate(-1.96, 1.96, symmetric_interval(generator.normal(size=400_000)), 0.1).holds


# --- regions ---


def test_the_ellipsoid_of_normal_outputs(generator):
    root = generator.normal(size=(6, 6))
    found = ellipsoidal_region(generator.normal(size=(20_000, 6)) @ root.T)
    assert found.normal_factor == pytest.approx(3.5485, abs=1e-4)
    assert abs(found.factor.value - found.normal_factor) < 4 * found.factor.standard_error
    others = generator.normal(size=(20_000, 6)) @ root.T
    inside = (distance(others, found.centre, found.covariance) <= found.factor.value).mean()
    assert abs(inside - 0.95) < 4 * np.sqrt(2 * 0.95 * 0.05 / 20_000)
    assert abs(found.coverage.value - 0.95) < 4 * np.sqrt(2) * found.coverage.standard_error


@pytest.mark.parametrize(
    ("draws", "words"),
    [
        (np.ones((30, 2)), "80 finite trials"),
        (np.ones((300, 2)), "one follows from the others"),
        (np.ones(300), r"shape \(trials, outputs\)"),
    ],
)
def test_regions_that_there_are_none(draws, words):
    with pytest.raises(ValueError, match=words):
        ellipsoidal_region(draws)
