"""Declared noise against what a run's channels show."""

import dataclasses

import numpy as np
import pytest

from uq.monte_carlo.campaign.simulation import simulate
from uq.runs.recorded.measured_noise import noise_warnings, white_level


@pytest.fixture(scope="module")
def run(short):
    return simulate(short, "T1").run


def test_the_level_of_white_noise_is_found_beside_a_motion_and_a_line(generator):
    """A median over some 1,000 frequencies of eight segments: 3 % is more than three standard errors."""
    t = np.arange(16_000) / 400
    noise = generator.normal(0, [0.1, 1.0, 3.0], (len(t), 3))
    tones = np.sin(2 * np.pi * np.multiply.outer(t, [1.5, 1.5, 40.0])) * [30, 30, 3]
    np.testing.assert_allclose(white_level(noise + tones, 400.0, 5.0), [0.1, 1.0, 3.0], rtol=0.06)
    assert white_level(noise[:100], 400.0, 5.0) is None


def test_noise_as_declared_is_no_warning(run, short):
    assert noise_warnings(run, short.sources) == []
    assert noise_warnings(run, ()) == []


@pytest.mark.parametrize("factor", [3.0, 1 / 3])
def test_noise_far_from_what_is_declared_is_named(run, short, factor):
    sources = tuple(
        dataclasses.replace(s, sigma=s.sigma / factor) if s.name == "M_precision" else s for s in short.sources
    )
    (said,) = noise_warnings(run, sources)
    assert said.startswith("simulated T1: M has noise of 0.")
    assert "check the figure, or what vibrates the rig" in said
