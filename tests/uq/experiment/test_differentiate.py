"""The preset's smoother has its gain."""

import jax.numpy as jnp
import numpy as np

from identify.signals.differentiate import (
    GAIN_TOLERANCE,
    derivative,
)


def test_the_presets_smoother_has_its_gain_measured_on_a_sine(preset):
    spec = preset.estimator("smoothed")
    taps = spec.taps(400.0)
    t, omega = np.arange(4000) / 400, 2 * np.pi * 1.5
    signal = jnp.asarray(np.stack([np.sin(omega * t)] * 3))
    alpha = np.asarray(derivative(signal, jnp.asarray(taps)))[0]
    expected = omega * np.cos(omega * t[len(taps) : -len(taps)])
    assert np.abs(alpha - expected).max() < GAIN_TOLERANCE * omega
