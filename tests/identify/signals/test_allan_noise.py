"""Noise of a channel at rest: Allan deviation against allantools, parameters against a simulator of its own."""

import warnings

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.signal import butter, sosfilt

from identify.signals.allan_noise import FLICKER_SLOPE, MISFIT, allan_deviation, allan_noise, quantisation_step
from tests.helpers.noise_study import Truth, simulated

RATE, SAMPLES = 100.0, 30_000
TRUTH = Truth(np.array([1e-3, 2e-3, 4e-4]), 1e-4)


def channel(seed, truth=TRUTH):
    return simulated(truth, RATE, SAMPLES, np.random.default_rng(seed))


def test_the_allan_deviation_is_that_of_allantools():
    signal = channel(0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        import allantools
    tau, deviation = allan_deviation(signal, RATE)
    taus, expected, *_ = allantools.oadev(signal, rate=RATE, data_type="freq", taus=tau)
    np.testing.assert_allclose(taus, tau, rtol=1e-12)
    np.testing.assert_allclose(deviation, expected, rtol=1e-8)


def test_intervals_hold_what_was_put_in():
    """Fixed seeds; four of 36 outside would have a chance of 3 %. How many in the long run: the study."""
    inside = []
    for seed in range(12):
        noise = allan_noise(channel(seed), RATE)
        low, high = noise.interval95.T
        inside += list((low <= TRUTH.values) & (TRUTH.values <= high))
        assert abs(noise.drift - TRUTH.drift) < 4 * noise.drift_uncertainty
        assert noise.misfit < MISFIT
        assert not noise.lines
    assert sum(inside) >= 33
    assert high[0] - low[0] < 0.05 * TRUTH.values[0]


def test_mains_are_lines_and_no_noise():
    time = np.arange(SAMPLES) / RATE
    clean = allan_noise(channel(3), RATE)
    hum = 0.01 * np.sin(2 * np.pi * 23.001 * time)
    noise = allan_noise(channel(3) + hum, RATE)
    (line,) = noise.lines
    assert line.frequency == pytest.approx(23.001, abs=1e-3)
    assert abs(line.amplitude - 0.01) < 4 * line.standard_uncertainty < 0.002
    np.testing.assert_allclose(noise.values, clean.values, rtol=0.02)


def test_above_a_sensors_filter_nothing_is_fitted():
    truth = Truth(np.array([1e-3, 0.0, 0.0]), 0.0)
    noise = allan_noise(sosfilt(butter(2, 15.0, fs=RATE, output="sos"), channel(4, truth)), RATE)
    assert noise.band[1] < 12
    low, high = noise.interval95[0]
    assert low <= 1e-3 <= high


def test_a_line_that_noise_does_not_explain_widens_the_intervals():
    """A temperature that swings: neither of the three."""
    time = np.arange(SAMPLES) / RATE
    swing = sum(0.05 * np.cos(2 * np.pi * 0.02 * k * time + k) for k in (1, 2))
    noise = allan_noise(channel(5) + swing, RATE)
    assert noise.misfit > MISFIT
    assert noise.band[1] == pytest.approx(45.0)


def test_the_step_is_the_least_that_all_samples_share():
    signal = channel(6)
    assert quantisation_step(signal) == 0
    assert quantisation_step(np.round(signal / 0.004) * 0.004 * 9.80665) == pytest.approx(0.004 * 9.80665)
    assert quantisation_step(np.ones(100)) == 0


def test_the_slope_through_flicker():
    """The spectrum 1/(2π f) times the squared transform of the least-squares slope over a unit of time."""

    def density(f):
        w = np.pi * f
        return 2 * (6 * (np.sin(w) - w * np.cos(w)) / w**2) ** 2 / (2 * np.pi * f)

    whole = sum(quad(density, a, a + 1)[0] for a in range(200))
    assert whole == pytest.approx(FLICKER_SLOPE, rel=1e-4)


@pytest.mark.parametrize("signal", [np.ones(1000), np.arange(20.0) % 3, np.arange(40.0) % 3, np.zeros(2)])
def test_what_shows_no_noise_is_refused(signal):
    with pytest.raises(ValueError, match=r"does not vary|record for longer"):
        allan_noise(signal, RATE)
