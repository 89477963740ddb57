"""Multisines of random amplitudes: one over a whole run, one in three stages."""

import numpy as np

from identify.motion.multisine import Multisine

DURATION, RAMP = 12.0, 1.0
STARTS = (0.0, 3.0, 7.0)
"""Of the staged motion [s]."""


def unstaged_multisine():
    """Three sines over 20 s."""
    generator = np.random.default_rng(5)
    scale = np.repeat([0.002, 0.02], 3)[:, None]
    amplitudes = scale * generator.normal(size=(2, 6, 3))
    return Multisine(np.array([0.4, 0.9, 1.4]), *amplitudes, np.array(20.0), np.array(3.0))


def staged_multisine():
    """Three stages of two sines each."""
    generator = np.random.default_rng(5)
    size = np.repeat([0.001, 0.02], 3)[:, None]
    amplitudes = generator.normal(size=(2, 6, 6)) * size
    frequency = np.array([0.5, 1.0, 0.5, 1.0, 0.7, 1.4])
    return Multisine(frequency, *amplitudes, np.array(DURATION), np.array(RAMP), np.repeat(STARTS, 2))
