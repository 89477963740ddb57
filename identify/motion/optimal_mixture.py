"""The best phases of a platform's legs against each other: the optimal mixture of phase patterns.

While the legs follow one wave, each at its own phase, their accelerations' second moment L is the real part of
``A p pᴴ A`` but for the wave's mean square: A is the diagonal of what each may do, p one complex number of modulus one
for each leg. Which patterns p are to have which shares of the time is a problem of optimal design: the least convex
function of ``P = K L Kᵀ``. Its optimum is known by its directional derivatives: none points from P down to a pattern
(Kiefer and Wolfowitz 1960, doi:10.4153/CJM-1960-030-4); the multiplicative algorithm finds it (Silvey, Titterington and
Torsney 1978, doi:10.1080/03610927808827719). It takes few patterns, since P has six numbers. Phases of sixths of a turn
are tried, the first leg's nought: 7,776 patterns, and half of them suffice, since a pattern and its conjugate, which
runs the other way round, have the same moment.
"""

import itertools
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from identify.motion.information_bound import Uncertainty

PHASES = 6
"""Phases in a turn that a leg may have."""
STEPS = 2_000
"""Steps of the multiplicative algorithm, each time that patterns are left out."""
NEGLIGIBLE = 0.01
"""Share of the time, of the largest one, below which a pattern is left out at first."""
SMALL = 0.1
"""Share below which a pattern is left out in the end: it would take a stage of its own, and ramps."""
MOST = 4
"""Patterns that are kept at most."""
LITTLE = 1e-3
"""Weight with which the moment of all patterns in equal shares is added: a single pattern's moment is singular."""


class Mixture(NamedTuple):
    """Patterns and the shares of the time that they are to have, the largest first."""

    phasors: Complex[np.ndarray, "k 6"]
    """Patterns of the legs' motion ``Re p exp(iωt)``, in parts of what each leg may do."""
    share: Float[np.ndarray, " k"]
    """Share of the time of each pattern, positive; the shares add up to one."""

    def both_ways(self) -> "Mixture":
        """Return the same with its conjugate beside each pattern that is another, each for half of the time."""
        phasors, share = [], []
        for pattern, share_of_time in zip(self.phasors, self.share, strict=True):
            turned = np.abs(pattern.imag).max() > 1e-9
            phasors += [pattern, pattern.conj()] if turned else [pattern]
            share += [share_of_time / 2, share_of_time / 2] if turned else [share_of_time]
        return Mixture(np.array(phasors), np.array(share))


def patterns() -> Complex[np.ndarray, "m 6"]:
    """Return the patterns of six legs, one of each pair of conjugates."""
    turns = [(0, *others) for others in itertools.product(range(PHASES), repeat=5)]
    unique = [pattern for pattern in turns if pattern <= tuple(-turn % PHASES for turn in pattern)]
    return np.exp(2j * np.pi * np.array(unique) / PHASES)


def mixture(function: Uncertainty, to_alpha: Float[np.ndarray, "3 6"]) -> Mixture:
    """Return the mixture of patterns whose second moment a function is least at.

    Args:
        function: convex, of degree -1/2, of the second moment of the angular acceleration [rad²/s⁴].
        to_alpha: K A, from what each leg does of its limit to the angular acceleration [rad/s²].
    """
    tried = patterns()
    every = np.full(len(tried), 1 / len(tried))
    little = LITTLE * np.asarray(mixed(tried @ to_alpha.T, jnp.asarray(every)))
    regular = lambda moment: function(moment + little)  # noqa: E731
    share = optimal_shares(regular, tried @ to_alpha.T)
    for least, most in ((NEGLIGIBLE, 2 * MOST), (SMALL, MOST)):
        order = np.argsort(-share, kind="stable")[:most]
        tried = tried[order[share[order] >= least * share.max()]]
        share = optimal_shares(regular, tried @ to_alpha.T)
    order = np.argsort(-share, kind="stable")
    return Mixture(tried[order], share[order])


def optimal_shares(function: Uncertainty, points: Complex[np.ndarray, "m 3"]) -> Float[np.ndarray, " m"]:
    """Return the weights λ on the simplex at which ``f(Re Σ λ_k r_k r_kᴴ)`` is least, r_k the rows of ``points``."""

    def better(_, share: Array) -> Array:
        raised = share * jnp.sqrt(jnp.maximum(steepness(function, points, share), 0))
        return raised / raised.sum()

    iterate: Any = jax.jit(lambda first: jax.lax.fori_loop(0, STEPS, better, first))
    return np.asarray(iterate(jnp.full(len(points), 1 / len(points))))


def steepness(
    function: Uncertainty, points: Complex[np.ndarray, "m 3"], share: Float[Array, " m"]
) -> Float[Array, " m"]:
    """Return how fast each point makes a function less, ``-Re r_kᴴ f'(P) r_k``: none above the mean at its optimum."""
    slope = jax.grad(function)(mixed(points, share))
    real_and_imaginary = jnp.asarray(np.stack([points.real, points.imag]))
    return -jnp.einsum("cki,ij,ckj->k", real_and_imaginary, slope, real_and_imaginary)


def mixed(points: Complex[np.ndarray, "m 3"], share: Float[Array, " m"]) -> Float[Array, "3 3"]:
    """Return ``Re Σ λ_k r_k r_kᴴ``."""
    real_and_imaginary = jnp.asarray(np.stack([points.real, points.imag]))
    return jnp.einsum("k,cki,ckj->ij", share, real_and_imaginary, real_and_imaginary)
