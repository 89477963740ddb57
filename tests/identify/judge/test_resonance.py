"""Peaks above the motion's band: of noise that is filtered here by SciPy, and none where noise is only coloured."""

import numpy as np
import pytest
import scipy

from identify.judge.run_findings.resonance import resonance
from identify.signals.run import Run

RATE, SECONDS, BAND = 400.0, 30.0, 3.0


def run_with(moment, seed=0):
    t = np.arange(int(RATE * SECONDS)) / RATE
    noise = np.random.default_rng(seed).standard_normal((2, len(t), 3))
    motion = 0.3 * np.sin(2 * np.pi * np.multiply.outer(t, [0.8, 1.1, 1.7]))
    return Run(t, 50 * motion + 0.5 * noise[0], 2 * motion + 0.03 * noise[1] + moment, motion, name="run")


def ringing(frequency, damping, rms, seed=1):
    """Noise through a resonance, about the third axis."""
    b, a = scipy.signal.iirpeak(frequency, 1 / (2 * damping), RATE)
    signal = scipy.signal.lfilter(b, a, np.random.default_rng(seed).standard_normal(int(RATE * SECONDS)))
    return np.multiply.outer(rms / signal.std() * signal, [0.0, 0.0, 1.0])


@pytest.mark.parametrize("frequency", [12.0, 25.0, 80.0])
@pytest.mark.parametrize("damping", [0.003, 0.03])
def test_it_is_found_with_its_frequency_and_size(frequency, damping):
    peak = resonance(run_with(ringing(frequency, damping, 0.1)), BAND)
    assert (peak.quantity, peak.axis) == ("moment", 2)
    assert peak.frequency == pytest.approx(frequency, rel=0.05, abs=0.5)
    assert peak.rms == pytest.approx(0.1, rel=0.1)
    assert f"about {peak.frequency:.1f} Hz" in peak.verdict(run_with(0.0), np.zeros(6)).text


def test_noise_is_none_be_it_white_or_coloured():
    for seed in range(20):
        white = np.random.default_rng([1, seed]).standard_normal((int(RATE * SECONDS), 3))
        low = scipy.signal.sosfilt(scipy.signal.butter(4, 40.0, fs=RATE, output="sos"), white, axis=0)
        brown = np.cumsum(white, axis=0) / RATE
        for moment in (0.0, 0.3 * white, low, brown):
            assert resonance(run_with(moment, seed), BAND) is None


def test_the_slope_of_the_motions_own_line_is_none():
    """Of a run without noise the window spreads a line below the lowest frequency over those above it."""
    t = np.arange(int(RATE * SECONDS)) / RATE
    motion = np.sin(2 * np.pi * np.multiply.outer(t, [0.8, 1.1, 4.2]))
    assert resonance(Run(t, np.zeros_like(motion), motion, motion, name="run"), BAND) is None


def test_a_short_run_is_not_judged():
    run = run_with(ringing(25.0, 0.03, 0.3))
    assert resonance(run.between(0.0, 6.0), BAND) is None
