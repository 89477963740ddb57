"""A payload on a wrist that turns all ways about the sensor, in closed form: gravity has hardly a mean in the body."""

import numpy as np
from scipy.spatial.transform import Rotation

from identify.signals.run import Run

G = 9.81
MASS, R_CG = 2.0, np.array([-0.035, 0.02, 0.045])
TENSOR = 1e-3 * np.array([[8, -1, 0.7], [-1, 4, 1.1], [0.7, 1.1, 6.5]])
STEP = 1e-4
OFFSET = np.array([1.5, -2.0, 0.8, 0.08, -0.05, 0.03])


def attitude(t):
    """From the body's axes to those whose z is up."""
    angles = [1.6 * np.sin(1.9 * t), 1.2 * np.sin(2.6 * t + 1), 2.2 * np.sin(1.3 * t + 2)]
    return Rotation.from_euler("ZYX", np.transpose(angles))


def turning(t):
    return (attitude(t - STEP).inv() * attitude(t + STEP)).as_rotvec() / (2 * STEP)


def signals(seconds=10.0, rate=100.0):
    """Time, force and moment on the body at Q, angular velocity, specific force at Q; without errors."""
    t = np.arange(0, seconds, 1 / rate)
    omega, alpha = turning(t), (turning(t + STEP) - turning(t - STEP)) / (2 * STEP)
    specific = attitude(t).inv().apply([0, 0, G])
    force = MASS * (specific + np.cross(alpha, R_CG) + np.cross(omega, np.cross(omega, R_CG)))
    moment = alpha @ TENSOR + np.cross(omega, omega @ TENSOR) + np.cross(R_CG, force)
    return t, force, moment, omega, specific


def run(change=lambda force, moment, specific: (force, moment), seed=0, **of_signals):
    """A run as a wrist logs it, with offsets of the sensor and noise; ``change``: what was done to the wrench."""
    draw = np.random.default_rng(seed).normal
    t, force, moment, omega, specific = signals(**of_signals)
    force, moment = change(force, moment, specific)
    force, moment = force + OFFSET[:3], moment + OFFSET[3:]
    noisy = [
        values + sigma * draw(size=values.shape)
        for values, sigma in ((force, 0.1), (moment, 5e-3), (omega, 1e-3), (specific, 0.02))
    ]
    return Run.from_channels(t, *noisy[:2], t, noisy[2], specific_force=noisy[3], name="wrist")
