"""Thrown bodies in plain NumPy: free flight, an IMU on a lever, a flywheel's moment about the centre of gravity."""

import numpy as np

from identify.judge.conventions.convention_fit import ImuSignal


def throw(seed: int, *, rate: float = 500.0, seconds: tuple[float, float] = (0.3, 1.5)) -> ImuSignal:
    """Return what an IMU of a thrown body records: no gravity, only its lever, a zero and noise.

    Rods, plates and lumps, spinning at 4 to 40 rad/s near a principal axis or tumbling, by Runge and Kutta's method.
    """
    draw = np.random.default_rng(seed)
    second = np.exp(draw.uniform(np.log(0.05), 0.0, 3))
    moments = second.sum() - second
    spin = draw.normal(size=3) if seed % 2 else np.eye(3)[draw.integers(3)] + 0.2 * draw.normal(size=3)
    omega = spin / np.linalg.norm(spin) * np.exp(draw.uniform(np.log(4.0), np.log(40.0)))
    step, rates = 1 / rate, []
    torque, axis = draw.uniform(0, 10), draw.normal(size=3)  # the flywheel's, over the moments of inertia [rad/s²]

    def slope(w: np.ndarray, t: float) -> np.ndarray:
        turn = torque * np.sin(40 * t) * axis
        return turn - np.cross(w, moments * w) / moments

    count = round(np.exp(draw.uniform(*np.log(seconds))) * rate)
    for t in np.arange(count) * step:
        rates.append(omega)
        a = slope(omega, t)
        b = slope(omega + step / 2 * a, t + step / 2)
        c = slope(omega + step / 2 * b, t + step / 2)
        omega = omega + step / 6 * (a + 2 * b + 2 * c + slope(omega + step * c, t + step))
    rotating = np.array(rates)
    alpha = np.gradient(rotating, step, axis=0)
    lever = np.exp(draw.uniform(np.log(2e-3), np.log(0.1))) * draw.normal(size=3)
    force = np.cross(alpha, lever) + np.cross(rotating, np.cross(rotating, lever))
    force += draw.uniform(0, 0.3) * draw.normal(size=3) + 0.05 * draw.normal(size=force.shape)
    gyro = rotating + 0.01 * draw.normal(size=3) + 0.005 * draw.normal(size=force.shape)
    return ImuSignal(np.arange(count) * step, gyro, force)
