"""A lower bound of a convex function of a motion's second moment, by duality: it holds wherever the search stops.

The second moment ``L`` of the legs' accelerations is unknown but for ``h_mᵀ L h_m ≤ b_m``. A function f of
``P = K L Kᵀ`` that is convex and homogeneous of degree -1/2, as a standard uncertainty is, lies above its tangent at
any ``P̂``; with weights ``λ ≥ 0`` this gives ``f ≥ f(P̂)^{3/2} / √(2 t λᵀb)``, t the largest eigenvalue of
``-f'(P̂) K (Σ λ_m h_m h_mᵀ)⁻¹ Kᵀ``. Weights and tangent point are sought; whatever is found is a bound.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import scipy
from jaxtyping import Array, Float

from identify.rigid_body.regressor import omega_r

SHARPNESS = 60
"""Power of the mean that stands for the largest eigenvalue in the search."""
TRIANGLE = np.tril_indices(3)

Uncertainty = Callable[[Float[Array, "3 3"]], Float[Array, ""]]


def tensor_covariance(
    samples: float, noise: Float[np.ndarray, "3 3"]
) -> Callable[[Float[Array, "3 3"]], Float[Array, "6 6"]]:
    """Return the tensor's least covariance [(kg·m²)²] as a function of the second moment of alpha [rad²/s⁴].

    ``(n mean(Ωᵀ S⁻¹ Ω))⁻¹`` with omega left out: what no unbiased linear estimate falls below when the moment has white
    noise alone (Gauss and Markov).

    Args:
        samples: n of the run.
        noise: covariance S of the moment about the centre of gravity at one sample [N²·m²].
    """
    rows = np.stack([np.asarray(omega_r(jnp.zeros(3), jnp.eye(3)[axis])) for axis in range(3)])
    each = jnp.asarray(samples * np.einsum("aij,ik,bkl->abjl", rows, np.linalg.inv(noise), rows))
    return lambda moment: jnp.linalg.inv(jnp.einsum("ab,abjl->jl", moment, each))


@dataclass(frozen=True, eq=False)
class Certified:
    """A lower bound and what proves it."""

    value: float
    weights: Float[np.ndarray, " m"]
    """λ, times b and normalised: how much each constraint forbids."""
    moment: Float[np.ndarray, "3 3"]
    """Second moment at which the tangent touches, up to a factor."""


def least(
    function: Uncertainty,
    rows: Float[np.ndarray, "m 6"],
    most: Float[np.ndarray, " m"],
    to_alpha: Float[np.ndarray, "3 6"],
) -> Certified:
    """Return a lower bound of a function over all second moments that obey the constraints.

    Args:
        function: convex, of degree -1/2, of the second moment of the angular acceleration [rad²/s⁴].
        rows: vectors h_m.
        most: b_m, the largest mean square of ``h_m · l``, above zero.
        to_alpha: K, from the legs' accelerations [m/s²] to the angular acceleration.
    """
    scaled = rows / np.sqrt(most)[:, None]  # then every b is one
    slope = jax.grad(function)

    def bounds(x: Array) -> tuple[Array, Array]:
        weights, lower = jnp.exp(x[: len(rows)]), jnp.zeros((3, 3)).at[TRIANGLE].set(x[len(rows) :])
        moment = lower @ lower.T + 1e-12 * jnp.eye(3)
        cheapest = jnp.linalg.inv(jnp.einsum("m,mi,mj->ij", weights, scaled, scaled))
        half = jnp.linalg.cholesky(to_alpha @ cheapest @ to_alpha.T)
        gradient = slope(moment)
        values = jnp.linalg.eigvalsh(-half.T @ (gradient + gradient.T) @ half / 2)
        largest = values[-1]
        soft = largest * ((values / largest) ** SHARPNESS).sum() ** (1 / SHARPNESS)
        common = function(moment) ** 1.5 / jnp.sqrt(2 * weights.sum())
        return common / jnp.sqrt(soft), common / jnp.sqrt(largest)

    negative: Any = jax.jit(jax.value_and_grad(lambda x: -jnp.log(bounds(x)[0])))
    first = np.concatenate([np.zeros(len(rows)), np.eye(3)[TRIANGLE]])
    optimum: Any = scipy.optimize.minimize(
        lambda x: tuple(np.asarray(array, float) for array in negative(x)),
        first, jac=True, method="L-BFGS-B", options={"maxiter": 2000, "maxfun": 4000},
    )  # fmt: skip
    weights = np.exp(optimum.x[: len(rows)])
    lower = np.zeros((3, 3))
    lower[TRIANGLE] = optimum.x[len(rows) :]
    return Certified(float(jax.jit(bounds)(optimum.x)[1]), weights / weights.sum(), lower @ lower.T)
