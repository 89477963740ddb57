"""Figures of a certificate that need no result: rounding, coverage, visited axes, traces, the decision rule."""

import numpy as np
import pytest

from identify.display.rounding import decimals, fixed
from identify.least_squares.pooling import student_freedom
from identify.least_squares.residual_spectrum import thinned, trace
from identify.results import measured_directions
from identify.results.ledger import Ledger, Row
from uq.experiment.conformity import Conformity, decide


@pytest.mark.parametrize(
    ("uncertainty", "value", "texts"),
    [
        (5.26, 380.74, ("5.3", "380.7")),
        (11.5, 380.74, ("12", "381")),
        (0.0996, -2.0, ("0.10", "−2.00")),
        (0.0994, -2.0, ("0.099", "−2.000")),
        (99.6, 1234.0, ("100", "1230")),
        (1234.0, -98765.0, ("1200", "−98800")),
        (0.2, -0.04, ("0.20", "−0.04")),
        (2.0, -0.04, ("2.0", "0.0")),
    ],
)
def test_two_digits_of_the_uncertainty(uncertainty, value, texts):
    assert (fixed(uncertainty, decimals(uncertainty)), fixed(value, decimals(uncertainty))) == texts


def test_coverage_factors_are_those_of_the_guide():
    """GUM, table G.2 (Student's t) and table G.1 (normal)."""
    for freedom, factor in ((2, 4.30), (4, 2.78), (10, 2.23), (50, 2.01), (np.inf, 1.96)):
        (effective,) = student_freedom(np.array([factor]))
        assert effective == pytest.approx(freedom, rel=0.1)
        arms = Ledger((Row(error="a", changes=np.eye(10), degrees_of_freedom=freedom),)).arms()
        np.testing.assert_allclose(arms, factor, atol=0.005)
    normal = Ledger((Row(error="a", changes=np.eye(10)),))
    np.testing.assert_allclose(normal.arms(0.99), 2.576, atol=1e-3)


def test_rows_of_two_evaluations_have_the_degrees_of_freedom_of_the_guide():
    """GUM H.1.6: contributions with their degrees of freedom to u(l) = 32 nm, whose effective number is 16."""
    parts = ((25.0, 18), (9.7, 25.6), (2.9, 50), (16.6, 2))
    rows = tuple(Row(error=f"{k}", changes=u * np.eye(10), degrees_of_freedom=v) for k, (u, v) in enumerate(parts))
    ledger = Ledger(rows)
    np.testing.assert_allclose(ledger.standard_uncertainty, 31.7, atol=0.1)
    np.testing.assert_allclose(ledger.degrees_of_freedom, 16.7, atol=0.2)


def test_shares_of_visited_axes_are_those_of_caps_and_belts():
    """Within 15° of an axis lie 1 - cos 15° of all axes, within 15° of a plane sin 15°; 2,000 directions tell 0.5 %."""
    turn = np.linspace(0, 2 * np.pi, 400)
    belt = np.stack([np.cos(turn), np.sin(turn), 0 * turn], axis=1)
    assert measured_directions.visited(np.array([[0.0, 0.0, 2.0]])) == pytest.approx(1 - np.cos(np.pi / 12), abs=5e-3)
    assert measured_directions.visited(belt) == pytest.approx(np.sin(np.pi / 12), abs=1e-2)
    assert measured_directions.visited(np.vstack([belt, [[0.0, 0.0, 0.4]]])) == measured_directions.visited(belt)
    assert measured_directions.visited(np.zeros((3, 3))) == 0
    weak, rms = measured_directions.rms_about(belt).least
    np.testing.assert_allclose(abs(weak), [0, 0, 1], atol=0.05)
    assert rms < 0.05
    assert measured_directions.rms_about(belt).largest[1] == pytest.approx(np.sqrt(0.5), rel=1e-2)


def test_a_trace_keeps_every_extreme_the_noise_level_and_a_line():
    rate, rng = 400.0, np.random.default_rng(1)
    t = np.arange(20_000) / rate
    t = np.concatenate([t[:12_000], t[14_000:]])
    noise = rng.normal(size=(len(t), 3))
    noise[7_777, 1] = 9.0
    line = noise + 0.5 * np.sin(2 * np.pi * 50 * t)[:, None] * [1, 0, 0]
    found = trace(t, line, 10 * noise[:12_000], thinned(np.hstack([noise, 2 * noise])))
    assert found.high[:, 1].max() == 9.0
    assert found.low.min() == line.min()
    assert len(found.t) <= 300
    density = np.median(found.residual_density[:, 2])
    assert density == pytest.approx(np.sqrt(2 / rate), rel=0.1)  # one-sided density of unit white noise
    assert np.median(found.moment_density) == pytest.approx(10 * np.sqrt(2 / rate), rel=0.1)
    assert found.frequency[np.argmax(found.residual_density[:, 0])] == pytest.approx(50, abs=0.5)
    assert (np.diff(found.frequency) > 0).all()
    assert found.stretch.t[0] == pytest.approx((12_000 - 5 * rate) / 2 / rate)  # the middle of the longest segment
    assert found.stretch.t[-1] - found.stretch.t[0] == pytest.approx(5, abs=0.01)
    at = np.round(found.stretch.t * rate).astype(int)
    np.testing.assert_array_equal(found.stretch.measured, 10 * noise[at])
    np.testing.assert_allclose(found.stretch.predicted, (10 * noise - line)[at], atol=1e-12)
    np.testing.assert_array_equal(found.alpha, 2 * found.omega)


def test_a_trace_of_a_few_samples_is_small_but_there():
    found = trace(np.arange(3.0), np.ones((3, 3)), np.ones((3, 3)), np.ones((3, 6)))
    assert len(found.t) == 3
    assert np.isfinite(found.residual_density).all()


@pytest.mark.parametrize(
    ("value", "simple", "guarded"),
    [
        (10.0, "conforms", "conforms"),
        (10.9, "conforms", "undecided"),
        (11.1, "does not conform", "undecided"),
        (11.3, "does not conform", "does not conform"),
        (9.1, "conforms", "undecided"),
        (8.5, "does not conform", "does not conform"),
    ],
)
def test_the_decision_rule_decides(value, simple, guarded):
    inertia, u = np.full(6, value), np.full(6, 0.1)
    for rule, outcome in (("simple", simple), ("guarded", guarded)):
        (verdict,) = decide(Conformity(specification="a", rule=rule, limits={"I22": (9.0, 11.0)}), inertia, u, 2 * u)
        assert (verdict.component, verdict.outcome) == ("I22", outcome)
    assert verdict.probability == pytest.approx(
        {10.0: 1, 10.9: 0.8413, 9.1: 0.8413, 11.1: 0.1587}.get(value, 0), abs=2e-3
    )
