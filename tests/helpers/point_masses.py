"""Mass, centre of gravity and tensor of point masses."""

import numpy as np
from jaxtyping import Float

from identify.rigid_body.fixture import check, left_over
from identify.rigid_body.inertial_parameters import InertialParameters
from identify.rigid_body.principal_axes import propagated

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


def subtract(
    whole: InertialParameters, fixture: InertialParameters, cross: Float[np.ndarray, "10 10"] | None = None
) -> InertialParameters:
    """Return the body that is left when a part is taken off, with its covariance (JCGM 102, 6.2.1.3).

    Args:
        whole: body and fixture together.
        fixture: the fixture, with the load cell's own moving plate.
        cross: covariance of the whole's ten parameters (rows) with the part's (columns); None: nothing in common.

    Raises:
        RunError: a mass is not known, or the part is not lighter than the whole.
    """
    check(whole, fixture)
    between = np.zeros((10, 10)) if cross is None else cross
    spread = np.block([[whole.covariance, between], [between.T, fixture.covariance]])
    values, covariance = propagated(left_over, np.concatenate([whole.values, fixture.values]), spread)
    return InertialParameters(float(values[0]), values[1:4], values[4:], covariance)
