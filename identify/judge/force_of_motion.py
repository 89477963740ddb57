"""The force that the motion makes in place of the measured one, where only moments about r_CG are compared.

A cause's signals hold the force. The measured one has noise that the residuals ``M - r × F`` hold, too, so that they
would seem to follow the cause.
"""

from dataclasses import replace

import numpy as np

from identify.joint.joint_model import Model, unknowns
from identify.joint.motion_signals import MotionSignals
from identify.joint.priors import Alignment
from identify.joint.single_run import start_bias, start_up
from identify.rigid_body.rotation import exponential


def with_force_of_motion(model: Model, theta: np.ndarray, alignment: Alignment) -> Model:
    """Return a run whose force is weight along the upward direction and mass times acceleration, by least squares.

    The moment changes along, so that the moment about r_CG stays as it is.

    Args:
        model: the run; unchanged where there is no force.
        theta: unknowns, whose r_CG is that of the moment.
        alignment: prior of delay and rotation.
    """
    rows = model.rows
    if not np.linalg.norm(rows.force, axis=0).min() > 0:
        return model
    x, to_imu = unknowns(theta), exponential(np.asarray(alignment.rotation, float)).T
    bias = start_bias(model, to_imu, alignment)
    everywhere = replace(model, up=start_up(model, to_imu, bias), used=np.ones_like(rows.used))
    signals = MotionSignals(everywhere, {**x, "gyro_bias": bias})
    unit = np.broadcast_to(np.eye(3), (len(rows.t), 3, 3))
    columns = np.concatenate([signals.up[:, :, None], signals.levers, unit], axis=2)
    used = columns[rows.used].reshape(-1, 7)
    solution = np.linalg.lstsq(used, rows.force.T[rows.used].ravel(), rcond=1e-10)[0]
    force = (columns @ solution).T
    moment = rows.moment + np.cross(x["r_cg"], force - rows.force, axisb=0).T
    return replace(model, rows=replace(rows, force=force, moment=moment))
