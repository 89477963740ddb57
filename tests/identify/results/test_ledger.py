"""The figures of a ledger against closed forms and against draws by SciPy."""

import numpy as np
import pytest
import scipy

from identify.least_squares.covariance_matrices import root_of
from identify.results.ledger import Ledger, Row, drawn_row, mass_row, taken_off, tensor_row

UNIT = np.eye(6)
TRIALS = 10_000


def even(distribution, scale=1.0, seed=0):
    """Draws of a distribution without sampling noise, in random order, the same in all components."""
    quantiles = distribution.ppf((np.arange(TRIALS) + 0.5) / TRIALS)
    return scale * np.random.default_rng(seed).permutation(quantiles)[:, None] * np.ones(6)


def test_covariances_of_rows_add_and_draws_add_trial_by_trial():
    matrix = np.random.default_rng(1).normal(size=(6, 6))
    linear, draws = tensor_row("a", matrix), even(scipy.stats.norm, seed=2)
    twice = Ledger((linear, drawn_row("b", draws), drawn_row("c", draws)))
    np.testing.assert_allclose(twice.covariance[4:, 4:], matrix @ matrix.T + 4 * np.cov(draws.T), rtol=1e-12)
    assert not twice.covariance[:4].any()
    np.testing.assert_allclose(twice.budget["b"][4:], draws.std(axis=0, ddof=1))


@pytest.mark.parametrize("freedom", [3, 12.5, np.inf])
def test_an_interval_of_linear_rows_is_students(freedom):
    rows = (
        tensor_row("a", 3 * UNIT, degrees_of_freedom=freedom),
        tensor_row("b", 4 * UNIT, degrees_of_freedom=freedom),
    )
    for probability in (0.95, 0.99):
        expected = 5 * scipy.stats.t(freedom).interval(probability)[1]
        np.testing.assert_allclose(Ledger(rows).arms(probability)[4:], expected, rtol=1e-9)


@pytest.mark.parametrize("drawn", [scipy.stats.norm, scipy.stats.uniform(-1.7, 3.4), scipy.stats.expon(-1)])
def test_an_interval_with_draws_is_that_of_the_sum(drawn):
    """The sum's distribution by numerical convolution; 10,000 quantiles tell its ends to 1 %."""
    ledger = Ledger((tensor_row("a", 0.8 * UNIT, degrees_of_freedom=4), drawn_row("b", even(drawn, seed=3))))
    x, step = np.linspace(-60, 60, 2**16, retstep=True)
    density = scipy.signal.fftconvolve(drawn.pdf(x), scipy.stats.t(4, scale=0.8).pdf(x), "same") * step
    low, high = np.interp([0.025, 0.975], np.cumsum(density) * step, x)
    np.testing.assert_allclose(ledger.arms()[4:], np.tile([high, -low], (6, 1)), rtol=0.03)


def test_what_runs_contradict_counts_with_k_2_and_typical_errors_only_in_the_bound():
    rows = [
        tensor_row("a", UNIT),
        tensor_row("b", 3 * UNIT, tier="contradicted"),
        tensor_row("c", 5 * UNIT, tier="typical"),
    ]
    ledger = Ledger(tuple(rows))
    arms = ledger.arms()
    np.testing.assert_allclose(arms[4:], np.hypot(1.959964, 6.0), rtol=1e-6)
    bounds = ledger.bounds(np.ones(10), 1 + arms * [-1, 1])
    np.testing.assert_allclose(bounds[4:, 1] - 1, np.sqrt(1.959964**2 + 36 + 100), rtol=1e-6)
    assert set(ledger.budget) == {"a", "b"}
    np.testing.assert_allclose(ledger.of_tiers("measured", "declared").standard_uncertainty[4:], 1.0)


def test_an_expected_error_reaches_out_on_its_side_and_a_mean_shifts_both_ends():
    sure = tensor_row("a", UNIT)
    expected = Ledger((sure,), np.concatenate([np.zeros(4), [2.0, -2.0, 0, 0, 0, np.nan]])).arms()[4:] - 1.959964
    np.testing.assert_allclose(expected, [[2, 0], [0, 2], *[[0, 0]] * 4], atol=1e-5)
    shifted = Ledger((sure, drawn_row("b", 3.0 + even(scipy.stats.norm, 1e-9))))
    np.testing.assert_allclose(shifted.arms()[4:], np.tile([3 + 1.96, 1.96 - 3], (6, 1)), atol=0.01)
    np.testing.assert_allclose(shifted.bias[4:], 3.0, rtol=1e-9)
    ends = 1.0 + shifted.arms() * [-1, 1]
    assert (ends[4:, 1] < 1.0).all()
    np.testing.assert_array_equal(shifted.bounds(np.ones(10), ends), ends)  # with nothing undeclared


def test_a_row_of_a_key_takes_the_place_of_that_keys():
    before = Ledger((tensor_row("gain", UNIT, key="gain"), tensor_row("noise", UNIT)))
    after = before.joined([tensor_row("gain", 3 * UNIT, key="gain")])
    assert [row.error for row in after.rows] == ["noise", "gain"]
    np.testing.assert_allclose(after.standard_uncertainty[4:], np.sqrt(10))


def test_the_error_of_both_results_cancels_where_a_fixture_is_taken_off():
    """A gain of 1 % of whole and fixture is 1 % of the body that is left; noise of both adds in squares."""
    whole, fixture = 7.0, 3.0
    rows = [
        (tensor_row("gain", 0.01 * of * UNIT, key="gain"), tensor_row("noise", 0.02 * UNIT)) for of in (whole, fixture)
    ]
    left = taken_off(*map(Ledger, rows), np.eye(10), -np.eye(10))
    np.testing.assert_allclose(left.budget["gain"][4:], 0.01 * (whole - fixture))
    np.testing.assert_allclose(left.standard_uncertainty[4:], np.sqrt(0.04**2 + 2 * 0.02**2))
    assert left.types == {"gain": "B", "noise": "B", "fixture taken off": "A, B"}
    assert left.joined([tensor_row("noise", UNIT, evaluation="A")]).types["noise"] == "A, B"
    assert left.joined([tensor_row("typical", UNIT, tier="typical")]).types == left.types


def test_draws_of_a_fixture_are_independent_of_the_bodys_unless_they_are_of_one_rig():
    draws = 3.0 + even(scipy.stats.norm, seed=5)
    for key, expected in (("gain", 0.0), ("", np.sqrt(2))):
        rows = [(drawn_row("gain", draws, key=key),), (drawn_row("gain", draws, key=key),)]
        left = taken_off(*map(Ledger, rows), np.eye(10), -np.eye(10))
        np.testing.assert_allclose(left.standard_uncertainty[4:], expected, atol=1e-3)
        assert not left.bias[4:].any()


def test_a_changed_row_has_the_degrees_of_freedom_of_what_it_is_made_of():
    freedom = np.where(np.arange(10) == 0, 2.0, np.inf)
    both = Row(error="a", changes=np.eye(10), degrees_of_freedom=freedom).changed(np.full((10, 10), 0.1))
    np.testing.assert_allclose(both.degrees_of_freedom, 20.0)  # a tenth of the variance has two
    np.testing.assert_allclose(mass_row(3.0).changed(2 * np.eye(10)).standard_uncertainty[0], 6.0)


def test_what_is_not_known_stays_so_and_spreads_to_nothing_that_does_not_depend_on_it():
    nothing = tensor_row("possible bodies", np.diag([np.nan, 0, 0, 0, 0, 0]))
    swapped = np.eye(10)[[0, 1, 2, 3, 5, 4, 6, 7, 8, 9]]
    for row, where in ((nothing, 4), (nothing.changed(swapped), 5)):
        variance = np.diag(Ledger((row, tensor_row("a", UNIT))).covariance)
        assert np.isnan(variance).tolist() == (np.arange(10) == where).tolist()


def test_a_root_leaves_out_what_is_negative_by_rounding_alone():
    root = root_of(np.diag([4.0, 0.0, -1e-20]), np.diag([4.0, 1.0, 1.0]))
    np.testing.assert_allclose(root @ root.T, np.diag([4.0, 0, 0]), atol=1e-18)
