"""What the moment alone tells: each cause, put alone into a simulated run, is named and it alone; clean runs say nothing."""

import numpy as np
import pytest

from identify.judge.run_findings.resonance import line


def test_a_line_has_its_power_and_noise_has_none(generator):
    t = np.arange(20_000) / 1000
    noise = generator.normal(0, 1, (len(t), 3))
    coloured = np.cumsum(noise, axis=0) / 30
    assert line(noise, 1000.0) is None
    assert line(coloured, 1000.0, above=2.0) is None
    tone = line(noise + np.outer(np.sin(2 * np.pi * 111.7 * t), [0, 0.5, 0]), 1000.0)
    assert (tone.axis, round(tone.frequency, 1)) == (1, 111.7)
    assert tone.rms == pytest.approx(0.5 / np.sqrt(2), rel=0.1)
