"""A tensor that was identified with the centre of gravity of static poses: their covariance in full."""

from dataclasses import replace

import numpy as np

from identify.results.identification_result import Identification, intervals_of
from identify.results.mass_and_centre import POSES
from identify.static.centre_result import Centre


def with_centre(result: Identification, centre: Centre) -> Identification:
    """Return a result whose centre of gravity and mass are those of static poses, with their joint covariance.

    With B = dI/dr of the least squares the tensor's covariance holds ``B V Bᵀ``, V the centre's (3, 3), in place of the
    same with V's diagonal. The tensor is correlated with the centre by ``B V`` and with the mass by ``B cov(r, m)``.

    Args:
        result: identified with ``r_cg`` and the diagonal of the covariance of this centre.
        centre: mass and centre of gravity with their covariance.
    """
    variance = np.square(result.sigma_r_cg)
    cg_inertia = result.parameters.covariance[1:4, 4:]
    jacobian = np.divide(cg_inertia, variance[:, None], out=np.zeros_like(cg_inertia), where=variance[:, None] > 0).T
    spread = centre.covariance[1:4, 1:4]
    covariance = result.covariance + jacobian @ (spread - np.diag(variance)) @ jacobian.T
    wider = np.sqrt(np.diag(covariance) / np.maximum(np.diag(result.covariance), 1e-300))
    half = np.diff(result.interval95, axis=1)[:, 0] / 2 * np.where(np.diag(result.covariance) > 0, wider, 1.0)
    by_centre = np.vstack([np.eye(4), np.hstack([np.zeros((6, 1)), jacobian])])
    covariance_of_ten = by_centre @ centre.covariance[:4, :4] @ by_centre.T
    covariance_of_ten[4:, 4:] = covariance
    parameters = replace(result.parameters, covariance=covariance_of_ten)
    ends = np.stack([result.inertia - half, result.inertia + half], axis=1)
    return replace(
        result,
        parameters=parameters,
        intervals95=intervals_of(parameters, ends, centre.coverage_factor[:4]),
        centre_from=POSES,
        lasting={
            name: np.concatenate([effect[:4], jacobian @ effect[1:4]]) for name, effect in centre.lasting_errors.items()
        },
    )
