"""Mass, centre of gravity and tensor of point masses."""

import numpy as np

from identify.rigid_body.inertial_parameters import InertialParameters

PACKED = np.triu_indices(3)


def ten(masses, points):
    """Mass, centre of gravity and packed tensor about it of point masses."""
    mass, r_cg = masses.sum(), masses @ points / masses.sum()
    arms = points - r_cg
    tensor = sum(m * (p @ p * np.eye(3) - np.outer(p, p)) for m, p in zip(masses, arms, strict=True))
    return np.concatenate([[mass], r_cg, tensor[PACKED]])


def parameters(values, covariance=None):
    return InertialParameters(
        values[0], values[1:4], values[4:], np.zeros((10, 10)) if covariance is None else covariance
    )
