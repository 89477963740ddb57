"""Is there weight on the load cell? In free flight nothing tells the attitude, and no cause can be judged."""

import numpy as np
from jaxtyping import Float

from identify.judge.conventions.convention_fit import ImuSignal
from identify.judge.conventions.imu_conventions import in_free_fall
from identify.judge.conventions.removed_weight import LEAST_WEIGHT
from identify.methods.base import Problem
from identify.results.identification_result import Identification
from identify.rigid_body.rotation import cumulative_product, exponentials
from identify.signals.run import Run

WITHIN = 10.0
"""Seconds over which a gyro keeps axes, whatever its bias.

Choice: a bias of 0.02 rad/s turns them by 0.2 rad, which leaves 98 % of a mean.
"""


def falls(run: Run, result: Identification, problem: Problem) -> bool:
    """Return whether a run shows no weight, or no force at all.

    An accelerometer tells it by itself: a force without the weight that it shows is an error, to be judged.
    """
    if not np.abs(run.force).max() > 0:
        return True
    read = run.specific_force
    if read is not None and lasting(run, read) < LEAST_WEIGHT * problem.gravity:
        return in_free_fall(ImuSignal(run.t, run.omega, read))  # or the gyro is wrong
    mass = problem.mass or result.mass
    needed = read is None or problem.cg_motion == "still"
    return bool(needed and mass is not None and lasting(run, run.force) < LEAST_WEIGHT * mass * problem.gravity)


def lasting(run: Run, vectors: Float[np.ndarray, "n 3"]) -> float:
    """Return the size of what stays of a vector: of its mean in B, or in axes that the gyro keeps, if that is larger.

    On a robot arm, which turns the body all ways, gravity has hardly a mean in B.
    """
    count, squares, samples = max(round(WITHIN * run.rate), 1), 0.0, 0
    for segment in run.used():
        omega, values = run.omega[segment], vectors[segment]
        for first in range(0, len(values), count):
            part = slice(first, first + count)
            attitude = cumulative_product(exponentials(omega[part] / run.rate))
            mean = np.einsum("nij,nj->i", attitude, values[part]) / len(attitude)
            squares, samples = squares + len(attitude) * float(mean @ mean), samples + len(attitude)
    in_body = float(np.linalg.norm(vectors.mean(axis=0)))
    return max(in_body, float(np.sqrt(squares / samples)) if samples else 0.0)
