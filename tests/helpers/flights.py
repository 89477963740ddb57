"""Flights of a thrown body in plain NumPy: a flywheel's moment turns it, a gyro that vibrates reads it, and the rig errs.

What recordings of thrown bodies have and plain noise has not: the recorded moment is low-passed at 20 Hz, the gyro
vibrates far above that, and the runs last half a second.
"""

from dataclasses import dataclass

import numpy as np
import scipy.signal
from scipy.spatial.transform import Rotation

from identify.signals.run import Run

RATE = 4000.0
MOMENTS = np.array([0.52, 0.22, 0.51])
"""Moments of inertia of the body about its axes [g·m²]."""
TURN = Rotation.from_rotvec([0.02, -0.05, 0.03])
TENSOR = 1e-3 * TURN.as_matrix() @ np.diag(MOMENTS) @ TURN.as_matrix().T
"""Tensor of the body, (3, 3) [kg·m²]."""
TRUTH = TENSOR[np.triu_indices(3)]
"""Its six components: I11, I12, I13, I22, I23, I33."""


@dataclass(frozen=True)
class Trouble:
    """What is wrong with a rig, the same in each of its flights."""

    turned: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Rotation vector from the gyro's axes to the body's [deg]."""
    gain: tuple[float, float, float] = (0.0, 0.0, 0.0)
    """Relative error of the recorded moment's gain on each axis."""
    corner: float = 20.0
    """Corner of the low-pass of the recorded moment [Hz]."""
    both_ways: bool = True
    """Whether the low-pass of the recorded moment runs both ways, so that it delays nothing."""


def flight(seed: int, trouble: Trouble = Trouble(), *, seconds: float = 0.5, vibration: float = 0.012) -> Run:
    """Return a flight.

    Args:
        seed: of spin, moment and noise.
        trouble: of the rig.
        seconds: of flight.
        vibration: of the gyro between 150 and 400 Hz, root mean square of each axis [rad/s].
    """
    draw = np.random.default_rng([seed, 41])
    count = round((seconds + 0.3) * RATE)
    slow = scipy.signal.butter(2, 6.0, fs=RATE, output="sos")
    moment = scipy.signal.sosfiltfilt(slow, draw.normal(size=(count, 3)), axis=0)
    moment *= draw.uniform(0.008, 0.014, 3) / moment.std(axis=0)
    omega = _turning(draw.normal(0, 6.0, 3), moment, 1 / RATE)
    sides = scipy.signal.butter(2, trouble.corner, fs=RATE, output="sos")
    filtered = (scipy.signal.sosfiltfilt if trouble.both_ways else scipy.signal.sosfilt)(sides, moment, axis=0)
    shaking = scipy.signal.butter(2, [150.0, 400.0], "bandpass", fs=RATE, output="sos")
    shake = scipy.signal.sosfilt(shaking, draw.normal(size=omega.shape), axis=0)
    gyro = omega @ Rotation.from_rotvec(trouble.turned, degrees=True).as_matrix()
    gyro = gyro + vibration / shake.std(axis=0) * shake + draw.normal(0, 0.004, omega.shape)
    recorded = filtered * (1 + np.array(trouble.gain)) + draw.normal(0, 2e-5, moment.shape)
    inner = slice(round(0.15 * RATE), round((0.15 + seconds) * RATE))
    t = np.arange(count)[inner] / RATE
    return Run.from_arrays(t, np.zeros_like(gyro[inner]), recorded[inner], gyro[inner], name=f"flight_{seed:02}")


def _turning(omega: np.ndarray, moment: np.ndarray, step: float) -> np.ndarray:
    """Angular velocity of the free body under a moment about its centre of gravity, by Runge and Kutta's method."""
    inverse, rates = np.linalg.inv(TENSOR), []

    def slope(w: np.ndarray, m: np.ndarray) -> np.ndarray:
        return inverse @ (m - np.cross(w, TENSOR @ w))

    for now, then in zip(moment, np.vstack([moment[1:], moment[-1:]]), strict=True):
        rates.append(omega)
        middle = (now + then) / 2
        a = slope(omega, now)
        b = slope(omega + step / 2 * a, middle)
        c = slope(omega + step / 2 * b, middle)
        d = slope(omega + step * c, then)
        omega = omega + step / 6 * (a + 2 * b + 2 * c + d)
    return np.array(rates)
