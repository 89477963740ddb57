"""How a platform's legs are best driven against each other: the optimal mixture of sign patterns.

While every leg goes at most ``a_i``, the second moments ``L`` of the six accelerations are averages of ``l lᵀ`` over
points of a box, so within the hull of its corners ``l = A s``, ``s`` of signs: 32 patterns, since ``s`` and ``-s`` are
alike. Which shares of the time they are to have is a problem of optimal design: the least convex function of
``P = K L Kᵀ``. Its optimum is told by its directional derivatives: none points from P down to a pattern (Kiefer and
Wolfowitz 1960, doi:10.4153/CJM-1960-030-4); the multiplicative algorithm finds it (Silvey, Titterington and Torsney
1978, doi:10.1080/03610927808827719). It takes few patterns, since P has six numbers.
"""

import itertools
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from identify.information_bound import Uncertainty

PATTERNS = np.array([(1, *others) for others in itertools.product((1, -1), repeat=5)], float)
"""Of six legs, (32, 6)."""
STEPS = 20_000
"""Of the multiplicative algorithm."""
SMALL = 0.02
"""Share of the time below which a pattern is left out."""


class Mixture(NamedTuple):
    """Patterns and the shares of the time that they are to have, the largest first."""

    signs: Float[np.ndarray, "k 6"]
    share: Float[np.ndarray, " k"]
    """Above zero, together one."""


def mixture(function: Uncertainty, to_alpha: Float[np.ndarray, "3 6"], *, small: float = SMALL) -> Mixture:
    """Return the mixture of patterns whose second moment a function is least at.

    Args:
        function: convex, of degree -1/2, of the second moment of the angular acceleration [rad²/s⁴].
        to_alpha: K A, from what each leg does of its limit to the angular acceleration [rad/s²].
        small: share below which a pattern is left out.
    """
    share = optimal_shares(function, PATTERNS @ to_alpha.T)
    order = np.argsort(-share, kind="stable")
    kept = order[share[order] >= min(small, share.max())]
    return Mixture(PATTERNS[kept], share[kept] / share[kept].sum())


def optimal_shares(function: Uncertainty, points: Float[np.ndarray, "m 3"]) -> Float[np.ndarray, " m"]:
    """Return the weights λ on the simplex at which ``f(Σ λ_k r_k r_kᵀ)`` is least, r_k the rows of ``points``."""
    rows = jnp.asarray(points)

    def better(_, share: Array) -> Array:
        raised = share * jnp.sqrt(steepness(function, rows, share))
        return raised / raised.sum()

    found: Any = jax.jit(lambda first: jax.lax.fori_loop(0, STEPS, better, first))
    return np.asarray(found(jnp.full(len(rows), 1 / len(rows))))


def steepness(function: Uncertainty, points: Float[Array, "m 3"], share: Float[Array, " m"]) -> Float[Array, " m"]:
    """Return how fast each point makes a function less, ``-r_kᵀ f'(P) r_k``: at the optimum none exceeds the mean."""
    slope = jax.grad(function)(jnp.einsum("k,ki,kj->ij", share, points, points))
    return -jnp.einsum("ki,ij,kj->k", points, slope, points)
