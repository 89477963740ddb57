"""The joint estimate of one run: the most probable unknowns, given its samples and what was known before.

Gauss–Newton on whitened residuals and priors (maximum a posteriori); the covariance is the inverse of the information
at the solution. Every function takes one run; ``vmap`` it over runs of one length.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import lineax
import numpy as np
import optimistix
from jaxtyping import Array, Bool, Float

from identify.joint_model import Model, residuals
from identify.priors import Prior

TOLERANCE = 1e-7
"""Of the solution, in standard uncertainties known beforehand."""
MOST_STEPS = 30


class Fit(NamedTuple):
    """The solution of one run."""

    z: Float[Array, " free"]
    """The solution; ``prior.theta(z)`` are the unknowns."""
    of_data: Float[Array, "free free"]
    """Information of the samples on z."""
    residuals: Float[Array, "rows n"]
    """Measured less predicted [N], [N·m]."""
    steps: Float[Array, ""]
    converged: Bool[Array, ""]


@eqx.filter_jit
def solve(model: Model, prior: Prior, whitener: Float[Array, "rows rows"], start: Float[Array, " free"]) -> Fit:
    """Return the most probable unknowns.

    Args:
        model: the run.
        prior: what is known beforehand.
        whitener: W with ``W C Wᵀ = 1``, C the covariance of one instant's rows.
        start: z to start from.
    """

    def whitened(z, _=None):
        return (whitener @ residuals(model, prior.theta(z))).ravel(), prior.counted * z

    solver = optimistix.GaussNewton(TOLERANCE, TOLERANCE, linear_solver=lineax.Normal(lineax.Cholesky()))
    found = optimistix.least_squares(whitened, solver, start, max_steps=MOST_STEPS, throw=False)
    z = found.value
    jacobian = jax.jacfwd(lambda z: whitened(z)[0])(z)
    left = residuals(model, prior.theta(z))
    steps = jnp.asarray(found.stats["num_steps"]).astype(z.dtype)
    return Fit(z, jacobian.T @ jacobian, left, steps, found.result == optimistix.RESULTS.successful)


def information(model: Model, prior: Prior, whitener: Float[Array, "rows rows"], z: Float[Array, " free"]) -> Array:
    """Return the information of the samples on z, (free, free)."""
    jacobian = jax.jacfwd(lambda z: (whitener @ residuals(model, prior.theta(z))).ravel())(z)
    return jacobian.T @ jacobian


def in_band_level(left: Float[Array, "rows n"], used: Float[Array, " n"], share: float) -> Float[Array, " rows"]:
    """Return the standard deviation of white noise with the residuals' power below ``share`` of half their rate."""
    power = jnp.abs(jnp.fft.rfft(left, axis=1)) ** 2
    bins = max(int(share * (power.shape[1] - 1)), 1)
    return jnp.sqrt(power[:, 1 : bins + 1].mean(axis=1) / used.sum())


def posterior(fit: Fit, prior: Prior) -> tuple[np.ndarray, np.ndarray]:
    """Return the covariance of the unknowns, (count, count), and the part of it that the priors' errors cause."""
    of_data, counted, root = (np.asarray(x) for x in (fit.of_data, prior.counted, prior.root))
    inverse = np.linalg.inv(of_data + np.diag(counted))
    of_prior = inverse @ np.diag(counted) @ inverse
    return root @ inverse @ root.T, root @ of_prior @ root.T
