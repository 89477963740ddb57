"""Differentiators: against SciPy, exact polynomials, and their gain over the motion's band."""

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.signal import savgol_coeffs

from identify.signals.differentiate import (
    GAIN_TOLERANCE,
    central_difference,
    derivative,
    gain,
    matched,
    savitzky_golay,
    worst_gain,
)
from identify.signals.estimator_spec import EstimatorSpec


@pytest.mark.parametrize("window", [5, 39, 41, 101])
def test_savitzky_golay_is_scipys(window):
    theirs = savgol_coeffs(window, 4, deriv=1, delta=1 / 400, use="dot")
    ours = savitzky_golay(400.0, window)
    np.testing.assert_allclose(ours, theirs[window // 2 + 1 :], atol=1e-11 * abs(theirs).max())
    np.testing.assert_allclose(-ours[::-1], theirs[: window // 2], atol=1e-11 * abs(theirs).max())


@pytest.mark.parametrize("taps", [central_difference(50.0), savitzky_golay(50.0, 9), savitzky_golay(50.0, 21)])
def test_derivative_of_a_parabola_is_exact(taps):
    t = np.arange(60) / 50
    signal = jnp.asarray(np.stack([t**2, 3 * t, 5 + 0 * t]))
    h = len(taps)
    inner = t[h:-h]
    expected = np.stack([2 * inner, 3 + 0 * inner, 0 * inner])
    np.testing.assert_allclose(derivative(signal, jnp.asarray(taps)), expected, atol=1e-11)


def test_gain_of_the_central_difference_is_the_sinc():
    frequency = np.array([0.0, 0.5, 1.5, 10.0])
    expected = np.sinc(2 * frequency / 400)
    np.testing.assert_allclose(gain(central_difference(400.0), 400.0, frequency), expected, rtol=1e-14)


@pytest.mark.parametrize("rate", [100.0, 200.0, 300.0, 400.0, 500.0, 1000.0])
def test_the_matched_smoother_holds_its_gain_over_the_band_and_the_next_longer_does_not(rate):
    band = 1.55
    taps = matched(rate, band)
    frequency = np.linspace(0.001, band, 5000)
    assert np.abs(gain(taps, rate, frequency) - 1).max() <= GAIN_TOLERANCE
    assert worst_gain(savitzky_golay(rate, 2 * len(taps) + 3), rate, band) > GAIN_TOLERANCE


def test_noise_gain_is_measured_on_white_noise(generator):
    noise = jnp.asarray(generator.normal(size=(3, 200_000)))
    for spec in (EstimatorSpec("a", "central"), EstimatorSpec("b", "savitzky-golay", window=39)):
        measured = np.std(derivative(noise, jnp.asarray(spec.taps(400.0))))
        # 600,000 draws, correlated over up to 39 samples: relative standard error below 1 %
        np.testing.assert_allclose(measured, spec.alpha_noise_gain(400.0), rtol=0.04)


@pytest.mark.parametrize("window", [3, 6])
def test_a_window_that_cannot_be_is_refused(window):
    with pytest.raises(ValueError, match="must be odd and more than the order"):
        savitzky_golay(400.0, window)


def test_a_rate_too_low_for_the_band_is_refused():
    with pytest.raises(ValueError, match=r"must be high enough to differentiate a motion of 20 Hz"):
        matched(100.0, 20.0)


def test_too_few_samples_are_refused():
    with pytest.raises(ValueError, match="must have more than 2 samples"):
        derivative(jnp.ones((3, 2)), jnp.ones(1))
