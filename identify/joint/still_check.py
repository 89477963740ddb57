"""Check of a recorded accelerometer against a centre of gravity that is declared still."""

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from identify.compiled_program import CompiledProgram
from identify.exceptions import RunError
from identify.joint.joint_model import Model, kinematics, unknowns
from identify.joint.single_run import JointRun
from identify.rigid_body.rotation import exponential
from identify.signals.band_limited_run import evaluate

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
    run, model = fitted.run, fitted.model
    if run.specific_force is None or run.imu_position is None:
        return
    theta = jnp.asarray(fitted.theta)
    acceleration, omega, alpha = (np.asarray(array).T for array in _at_imu(model, theta))
    used = np.asarray(model.rows.used) > 0
    unit = np.eye(3)
    arms = [np.cross(alpha, e) + np.cross(omega, np.cross(omega, e)) for e in unit]
    columns = np.stack([*arms, *(np.broadcast_to(e, omega.shape) for e in unit)], axis=2)[used].reshape(-1, 6)
    measured = acceleration[used].reshape(-1)
    inverse = np.linalg.inv(columns.T @ columns)
    solution = inverse @ columns.T @ measured
    level = float(np.mean((measured - columns @ solution) ** 2))
    # the accelerometer from the point at rest, less the same from the centre of gravity: that of the latter from rest
    miss = solution[:3] - (run.imu_position - np.asarray(unknowns(theta).r_cg))
    spread = np.sqrt(level * np.diag(inverse)[:3])
    beyond = np.abs(miss) - PLACED_WITHIN - 5 * spread
    if (beyond > 3 * fitted.prior_sigma("cg_from_still")).any():
        raise RunError(
            f'the accelerometer in {run.name} contradicts cg_motion = "still": the centre of gravity moves as if '
            f"{1e3 * float(np.linalg.norm(miss)):.0f} mm from the point at rest; remove cg_motion, or correct "
            "imu_position"
        )


@CompiledProgram
def _at_imu(model: Model, theta: Float[Array, " count"]) -> tuple[Array, Array, Array]:
    """Acceleration of the accelerometer's place, angular velocity and acceleration, in B."""
    x = unknowns(theta)
    motion = kinematics(model, x._replace(cg_from_still=jnp.zeros(3)))
    assert motion.specific_force is not None  # noqa: S101 - gravity: the centre of gravity is declared still
    value, _, _ = evaluate(model.rows.motion, model.rows.step, model.rows.t + x.delay[0])
    return exponential(x.rotation) @ value[3:] - motion.specific_force, motion.omega, motion.alpha
