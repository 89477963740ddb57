"""A lower bound of a convex function of a motion's second moment, by duality: it holds wherever the search stops.

The second moment ``L`` of the legs' accelerations is unknown but for ``L_mm ≤ b_m``. A function f of
``P = K L Kᵀ`` that is convex and homogeneous of degree -1/2, as a standard uncertainty is, lies above its tangent at
any ``P̂``; with weights ``λ ≥ 0`` this gives ``f ≥ f(P̂)^{3/2} / √(2 t λᵀb)``, t the largest eigenvalue of
``-f'(P̂) K diag(λ)⁻¹ Kᵀ``. Weights and tangent point are sought; whatever is found is a bound.
"""

from collections.abc import Callable
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


def tensor_information(
    precision: Float[np.ndarray, "3 3"], samples: float = 1.0
) -> Callable[[Float[Array, "3 3"]], Float[Array, "6 6"]]:
    """Return the information ``n mean(Ωᵀ W Ω)`` by the second moment of alpha [rad²/s⁴], omega left out.

    Args:
        precision: W, the inverse of the moment's covariance about the centre of gravity at one sample.
        samples: n.
    """
    rows = np.stack([np.asarray(omega_r(jnp.zeros(3), jnp.eye(3)[axis])) for axis in range(3)])
    squares = jnp.asarray(samples * np.einsum("aij,ik,bkl->abjl", rows, precision, rows))
    return lambda moment: jnp.einsum("ab,abjl->jl", moment, squares)


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
    information = tensor_information(np.linalg.inv(noise), samples)
    return lambda moment: jnp.linalg.inv(information(moment))


def least(function: Uncertainty, most: Float[np.ndarray, "6"], to_alpha: Float[np.ndarray, "3 6"]) -> float:
    """Return a lower bound of a function over all second moments that obey the constraints.

    Args:
        function: convex, of degree -1/2, of the second moment of the angular acceleration [rad²/s⁴].
        most: b_m, the largest mean square of each leg's acceleration l_m, above zero [m²/s⁴].
        to_alpha: K, from the legs' accelerations [m/s²] to the angular acceleration.
    """
    slope = jax.grad(function)

    def bounds(x: Array) -> tuple[Array, Array]:
        weights, lower = jnp.exp(x[:6]), jnp.zeros((3, 3)).at[TRIANGLE].set(x[6:])
        moment = lower @ lower.T + 1e-12 * jnp.eye(3)
        cheapest = jnp.diag(jnp.asarray(most) / weights)
        half = jnp.linalg.cholesky(to_alpha @ cheapest @ to_alpha.T)
        gradient = slope(moment)
        values = jnp.linalg.eigvalsh(-half.T @ (gradient + gradient.T) @ half / 2)
        largest = values[-1]
        soft = largest * ((values / largest) ** SHARPNESS).sum() ** (1 / SHARPNESS)
        common = function(moment) ** 1.5 / jnp.sqrt(2 * weights.sum())
        return common / jnp.sqrt(soft), common / jnp.sqrt(largest)

    negative: Any = jax.jit(jax.value_and_grad(lambda x: -jnp.log(bounds(x)[0])))
    first = np.concatenate([np.zeros(6), np.eye(3)[TRIANGLE]])
    optimum: Any = scipy.optimize.minimize(
        lambda x: tuple(np.asarray(array, float) for array in negative(x)),
        first, jac=True, method="L-BFGS-B", options={"maxiter": 2000, "maxfun": 4000},
    )  # fmt: skip
    return float(jax.jit(bounds)(optimum.x)[1])
