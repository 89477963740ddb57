"""Check of a recorded accelerometer against a centre of gravity that is declared still."""

import numpy as np

from identify.exceptions import RunError
from identify.joint.single_run import JointRun

PLACED_WITHIN = 0.01
"""Distance of an accelerometer from its declared position [m] that does not count as a contradiction."""


def check_still(fitted: JointRun) -> None:
    """Refuse a run whose accelerometer shows that the centre of gravity is not still.

    What it reads, less gravity, is the acceleration of the point where it stands. If the centre of gravity is still,
    that is ``alpha × d + omega × (omega × d)`` with d the declared distance; least squares gives the true one.

    Args:
        fitted: a run with its joint estimate, its centre of gravity declared still.

    Raises:
        RunError: the two distances differ by more than the declared miss and the accelerometer's place explain.
    """
    run, at = fitted.run, fitted.fit.prediction
    if run.specific_force is None or run.imu_position is None:
        return
    levers = at.signals.levers
    columns = np.concatenate([levers, np.broadcast_to(np.eye(3), levers.shape)], axis=2).reshape(-1, 6)
    measured = (at.signals.accelerometer - at.at_known_point).reshape(-1)
    inverse = np.linalg.inv(columns.T @ columns)
    solution = inverse @ columns.T @ measured
    level = float(np.mean((measured - columns @ solution) ** 2))
    # the accelerometer from the point at rest, less the same from the centre of gravity: that of the latter from rest
    miss = solution[:3] - (run.imu_position - at.x["r_cg"])
    spread = np.sqrt(level * np.diag(inverse)[:3])
    beyond = np.abs(miss) - PLACED_WITHIN - 5 * spread
    if (beyond > 3 * fitted.prior_sigma("cg_from_still")).any():
        raise RunError(
            f'the accelerometer in {run.name} contradicts cg_motion = "still": the centre of gravity moves as if '
            f"{1e3 * float(np.linalg.norm(miss)):.0f} mm from the point at rest; remove cg_motion, or correct "
            "imu_position"
        )
