"""Welch's spectra, straight lines taken off and Kaiser's low-pass, each against SciPy's."""

import numpy as np
import pytest
import scipy

from identify.signals.filters import apply, kaiser, thinned
from identify.signals.power_spectrum import WINDOWS, motion_band, noise_level, welch, without_line

RATE = 400.0


def drift(samples: int) -> np.ndarray:
    """A signal of three components that wanders, about a constant."""
    return np.random.default_rng(0).normal(size=(samples, 3)).cumsum(axis=0) + 5


@pytest.mark.parametrize("window", WINDOWS)
@pytest.mark.parametrize("straight", [False, True])
@pytest.mark.parametrize(
    ("samples", "size", "fast"),
    [(1000, 8, 8), (1000, 245, 245), (1000, 251, 250), (777, 250, 250), (777, 777, 770), (40, 64, 40)],
)
def test_spectra_are_those_of_scipy(samples, size, fast, straight, window) -> None:
    signal = drift(samples)
    expected = scipy.signal.welch(
        signal, RATE, nperseg=fast, axis=0, window=window, detrend="linear" if straight else "constant"
    )
    for ours, theirs in zip(welch(signal, RATE, size, window=window, straight=straight), expected, strict=True):
        np.testing.assert_allclose(ours, theirs, rtol=1e-10, atol=1e-13 * theirs.max())  # rounding


def test_a_straight_line_is_taken_off_as_scipy_does() -> None:
    np.testing.assert_allclose(without_line(drift(500).T).T, scipy.signal.detrend(drift(500), axis=0), atol=1e-11)
    assert without_line(np.ones((3, 1))).tolist() == [[0.0]] * 3


@pytest.mark.parametrize("count", [5, 101])
def test_taps_are_those_of_scipy(count) -> None:
    window = ("kaiser", scipy.signal.kaiser_beta(100.0))
    expected = scipy.signal.firwin(count, 0.15 * RATE, window=window, fs=RATE)
    np.testing.assert_allclose(kaiser(count, 0.3, window[1]), expected, rtol=1e-12, atol=1e-16)


def test_filtered_samples_are_those_of_scipy() -> None:
    signal, taps = drift(1000).T, kaiser(51, 0.3, 8.0)
    expected = scipy.signal.oaconvolve(signal, taps[None], mode="valid", axes=1)
    np.testing.assert_allclose(apply(signal, taps), expected, atol=1e-13 * np.abs(signal).max())


@pytest.mark.parametrize("step", [1, 2, 7])
def test_thinned_samples_are_those_of_scipy(step) -> None:
    signal = drift(1001)
    expected = scipy.signal.resample_poly(signal, 1, step, axis=0, padtype="line")
    np.testing.assert_allclose(thinned(signal, step), expected, rtol=1e-12)


@pytest.mark.parametrize("noise", [0.0, 1e-3])
def test_the_band_of_a_sine_in_noise(generator, noise):
    t = np.arange(60_000) / 400
    omega = 0.4 * np.sin(2 * np.pi * 1.5 * t)[:, None] + noise * generator.normal(size=(60_000, 3))
    assert 1.5 <= motion_band(omega, 400.0) < 2.0


def test_noise_level_sees_through_the_motion(generator):
    t, sigma = np.arange(72_000) / 400, np.array([4e-4, 2e-3, 1e-3])
    omega = 0.4 * np.sin(2 * np.pi * 1.5 * t)[:, None] + sigma * generator.normal(size=(72_000, 3))
    np.testing.assert_allclose(noise_level(omega), sigma, rtol=0.03)  # five times its relative standard error
    assert noise_level(omega[:5]).tolist() == [0, 0, 0]
