"""The body's weight in the body's frame, where a driver has removed it from the wrench: put back by attitude.

Gravity's direction in B follows the gyro, ``ḣ = -(omega - b) × h``. Over minutes the gyro's bias b would turn it by a
radian, so b and the first direction are fitted to the accelerometer, whose motion averages out; without one, b is the
gyro's mean at rest and the first direction is the level's.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from identify.rigid_body.regressor import cross_matrix
from identify.rigid_body.rotation import cumulative_product, exponential
from identify.signals.run import Run, RunError
from identify.signals.segments import Segment

ROUNDS = 3
"""Linear steps to the bias: it turns a run by a radian at most."""
UP = np.array([0.0, 0.0, 1.0])


def upward(run: Run, r_cg: np.ndarray, rests: Sequence[Segment]) -> Float[np.ndarray, "n 3"]:
    """Return the unit vector that points up, in B, at every instant of a run.

    Args:
        run: the whole run; level at its first instant where it has neither attitude nor accelerometer.
        r_cg: centre of gravity from Q, in B [m].
        rests: segments of rest, for the gyro's bias where there is no accelerometer.

    Raises:
        RunError: neither accelerometer nor rest.
    """
    if run.attitude is not None and run.gravity is not None:
        return -np.einsum("nji,j->ni", run.attitude, run.gravity / np.linalg.norm(run.gravity))
    if run.specific_force is not None:
        return _by_accelerometer(run, r_cg)
    if not rests:
        raise RunError(
            f"the attitude in {run.name} is unknown, without accelerometer and without rest: the removed weight "
            "cannot be put back; record a second of rest, level, before the motion"
        )
    still = np.concatenate([run.omega[(run.t - run.t[0] >= s.start) & (run.t - run.t[0] <= s.stop)] for s in rests])
    return _turned(run, still.mean(axis=0)) @ UP


def upward_by_force(run: Run, r_cg: Float[np.ndarray, "3"]) -> Float[np.ndarray, "n 3"]:
    """Return the upward direction in B from gyro and force together: the load cell as an accelerometer.

    The force's own noise is that of the residuals, which would seem to follow it; the gyro's integral is free of it.
    Zeros where there is no force.
    """
    if not np.abs(run.force).max() > 0:
        return np.zeros_like(run.force)
    as_imu = replace(run, specific_force=run.force, imu_position=np.asarray(r_cg, float), attitude=None)
    return upward(as_imu, r_cg, ())


def _by_accelerometer(run: Run, r_cg: np.ndarray) -> np.ndarray:
    """Least squares over direction and bias: ``f ≈ R_BA (u - u × C b)`` with ``C = ∫R_AB dt``."""
    reading, usable = run.specific_force_at(r_cg), run.usable
    bias, up = np.zeros(3), UP
    for _ in range(ROUNDS):
        to_body = _turned(run, bias)
        up = (to_body[usable].transpose(0, 2, 1) @ reading[usable, :, None]).mean(axis=0)[:, 0]
        turned = np.cumsum(to_body.transpose(0, 2, 1), axis=0) / run.rate
        columns = np.concatenate([to_body, -to_body @ cross_matrix(up) @ turned], axis=2)[usable].reshape(-1, 6)
        solution = np.linalg.lstsq(columns, reading[usable].reshape(-1), rcond=1e-8)[0]
        up, bias = solution[:3], bias + solution[3:]
    return _turned(run, bias) @ (up / np.linalg.norm(up))


def _turned(run: Run, bias: np.ndarray) -> np.ndarray:
    """Attitudes R_BA from the gyro less its bias, (n, 3, 3), the first one the identity."""
    w = run.omega - bias
    step = 1 / run.rate
    turns = step / 2 * (w[1:] + w[:-1]) + step**2 / 12 * np.cross(w[:-1], w[1:])
    return cumulative_product(exponential(np.concatenate([np.zeros((1, 3)), turns]))).transpose(0, 2, 1)
