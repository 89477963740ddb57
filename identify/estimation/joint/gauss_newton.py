"""The joint estimate of one run: the most probable unknowns, given its samples and the prior.

Gauss–Newton on whitened residuals and priors (maximum a posteriori); the covariance is the inverse of the information
at the solution. Where noise has a spectrum, the rows' equations are weighted by it
(:mod:`identify.estimation.joint.noise_spectrum`).
"""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from identify.estimation.joint.error_columns import departure, derivative
from identify.estimation.joint.joint_model import SIZES, SLICES, Model
from identify.estimation.joint.predicted_wrench import PredictedWrench
from identify.estimation.joint.priors import Prior

TOLERANCE = 1e-6
"""Last step of the search in standard uncertainties of the unknowns, at which it ends."""
MOST_STEPS = 30
Transform = Callable[[Float[np.ndarray, "n rows p"]], Float[np.ndarray, "m rows p"]]
"""Function that transforms rows before they are weighed."""


Weights = Callable[[Float[np.ndarray, "m rows p"]], Float[np.ndarray, "p p"]]
"""Function from transformed columns to the weights of their equations."""


def unweighted(columns: Float[np.ndarray, "m rows p"]) -> Float[np.ndarray, "p p"]:
    """Return the weights of equations in white noise, 1."""
    return np.eye(columns.shape[2])


class RunSolution(NamedTuple):
    """The solution of one run."""

    z: Float[np.ndarray, " free"]
    """Most probable coordinates z; ``prior.theta(z)`` are the unknowns."""
    information: Float[np.ndarray, "free free"]
    """Information of the samples on z."""
    weights: Float[np.ndarray, "free free"]
    """Weights of the equations ``Xᵀ r = 0`` of least squares beside priors: 1 where the noise is white."""
    normal: Float[np.ndarray, "free free"]
    """Normal matrix ``XᵀX`` of these equations."""
    prediction: PredictedWrench
    """The prediction with these unknowns."""
    steps: int
    converged: bool


class Linearised(NamedTuple):
    """A run's rows about one value of the unknowns."""

    prediction: PredictedWrench
    residuals: Float[np.ndarray, "m rows"]
    """Measured less predicted [N], [N·m]."""
    columns: Float[np.ndarray, "m rows free"]
    """Change of the predicted rows by a unit of each coordinate z."""


def linearised(model: Model, prior: Prior, z: Float[np.ndarray, " free"], transform: Transform) -> Linearised:
    """Return rows and columns of a run about z."""
    prediction = PredictedWrench(model, prior.theta(z))
    counted, transformed = prediction.counted, []
    # chain rule ∂/∂z = ∂/∂θ root, unknown by unknown: what is exact has no root, and its derivative is never made
    for name in SIZES:
        root = prior.root[SLICES[name]]
        acting = root.any(axis=0)
        if acting.any():
            transformed.append((acting, transform(counted(derivative(prediction, name) @ root[:, acting]))))
    residuals = transform(counted(departure(prediction)[:, :, None]))[:, :, 0]
    columns = np.zeros((*residuals.shape, len(z)))
    for acting, block in transformed:
        columns[:, :, acting] += block
    return Linearised(prediction, residuals, columns)


def solve(
    model: Model,
    prior: Prior,
    start: Float[np.ndarray, " free"],
    transform: Transform,
    *,
    weights: Weights = unweighted,
) -> RunSolution:
    """Return the most probable unknowns.

    Args:
        model: the run.
        prior: of its unknowns.
        start: z to start from.
        transform: of rows, to units of their noise.
        weights: of the equations, given the transformed columns.
    """
    z, change, steps = start, np.full(len(start), np.inf), 0
    while True:
        # Gauss–Newton: second derivatives of the prediction are left out, as residuals are noise
        at = linearised(model, prior, z, transform)
        columns, weight = at.columns.reshape(-1, len(z)), weights(at.columns)
        normal = columns.T @ columns
        information = weight @ normal
        # maximum a posteriori in coordinates whose prior is standard normal: a ridge of 1 (Tikhonov), of 0 where
        # nothing is known
        with_prior = information + np.diag(prior.counted)
        change = np.linalg.solve(with_prior, weight @ (columns.T @ at.residuals.ravel()) - prior.counted * z)
        # a step in units of the posterior's standard uncertainties: scale-free, and small when nothing is left to gain
        converged = bool(change @ with_prior @ change < TOLERANCE**2 * len(z))
        if converged or steps == MOST_STEPS or not np.isfinite(change).all():
            return RunSolution(
                z=z, information=information, weights=weight, normal=normal, prediction=at.prediction, steps=steps,
                converged=converged,
            )  # fmt: skip
        z, steps = z + change, steps + 1


def information(
    model: Model, prior: Prior, whitener: Float[np.ndarray, "rows rows"], z: Float[np.ndarray, " free"]
) -> Float[np.ndarray, "free free"]:
    """Return the information of the samples on z."""
    columns = linearised(model, prior, z, lambda rows: np.asarray(whitener @ rows)).columns.reshape(-1, len(z))
    return columns.T @ columns


def posterior(information: Float[np.ndarray, "free free"], prior: Prior) -> tuple[np.ndarray, np.ndarray]:
    """Return the covariance of the unknowns given samples and prior, and the prior's part of it, (count, count)."""
    root, precision = prior.root, np.diag(prior.counted)
    # G = (I + P)⁻¹; z follows the prior's mean by G P, whose covariance is P⁻¹: hence G P P⁻¹ P G, the prior's part
    inverse = np.linalg.inv(information + precision)
    return root @ inverse @ root.T, root @ inverse @ precision @ inverse @ root.T
