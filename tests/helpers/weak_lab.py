"""Runs in closed form, with noise of any colour: what brief and poor recordings look like."""

import numpy as np
from scipy.signal import lfilter

from identify.rigid_body.pseudo_inertia import UNITS
from identify.signals.estimator_spec import EstimatorSpec
from identify.signals.run import Run

RATE = 100.0
ROD = np.array([0.381, 0.0, 0.0, 0.019, 0.0, 0.379])
"""A rod about b2 [kg·m²]: I22 is a twentieth of the others."""
R_CG = np.array([0.03, -0.02, 0.053])
NOISE = {"force": 5.0, "moment": 0.4, "omega": 4e-4}
SMOOTH = EstimatorSpec("smooth", "savitzky-golay", window=15)
LOWPASSED = EstimatorSpec("lowpassed", "central", lowpass=5.0)


def swing(seconds, axes=(1, 1, 1), rate=RATE):
    """Instants, angular velocity and acceleration of harmonic motions about the axes, from an arbitrary instant on."""
    t = np.arange(round(seconds * rate)) / rate
    frequency, phase = 2 * np.pi * np.array([1.3, 1.6, 1.1]), np.array([0.4, 1.9, 3.1])
    angle = np.multiply.outer(t, frequency) + phase
    size = 0.45 * np.asarray(axes)
    return t, size * np.sin(angle), size * frequency * np.cos(angle)


def coloured(rng, n, memory):
    """Unit noise (n, 3) with a correlation of ``memory`` from sample to sample."""
    white = rng.standard_normal((n + round(8 / (1 - memory)), 3))
    return lfilter([np.sqrt(1 - memory**2)], [1, -memory], white, axis=0)[-n:]


def run(inertia, motion, rng, *, memory=0.0, mixing=None, level=1.0):
    """A run with the noise of a load cell and a gyro; the moment's has a memory, and axes mixed."""
    t, omega, alpha = motion
    tensor = np.tensordot(inertia, UNITS, axes=1)
    force = np.tile([3.0, -2.0, 190.0], (len(t), 1)) + level * NOISE["force"] * rng.standard_normal((len(t), 3))
    moment = alpha @ tensor + np.cross(omega, omega @ tensor) + np.cross(R_CG, [3.0, -2.0, 190.0]) + [0.3, -0.2, 0.1]
    noise = NOISE["moment"] * coloured(rng, len(t), memory) @ (np.eye(3) if mixing is None else np.asarray(mixing).T)
    return Run(t, force, moment + level * noise, omega + level * NOISE["omega"] * rng.standard_normal((len(t), 3)))


def covered(result, inertia):
    """Which components' intervals hold the truth."""
    low, high = result.interval95.T
    return (low <= inertia) & (inertia <= high)
