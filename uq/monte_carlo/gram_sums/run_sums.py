"""Sums over a run's samples as a polynomial in the delay of the gyro, for trials, the law and recorded runs.

A gyro that is late by τ reads ω(t - τ), so that every product with a feature of ω, summed over the samples, is a smooth
function S(τ). Visiting the samples again for every draw of τ would cost a trial the run's length; S(τ) as a polynomial
costs it a few products. Its coefficients come from either of two places:

- *Interpolation* (:meth:`RunSums.through`): exact sums at seven of Chebyshev's points. The error of degree 6 is
  ``S⁽⁷⁾(ξ)/7! Π (τ - τ_k)``, and these points keep the product small over the whole range: equally spaced ones would
  let it grow at the ends. A delay of ±4 ms leaves 8e-15, one of ±35 ms 3e-8 of the sums.
- *Taylor's series* about no delay, where derivatives are at hand and a range is not: the law of propagation, of second
  order itself, uses no more than S, S′ and S″/2.

The polynomial is in ``x = (τ - middle)/reach``, within ±1: powers of τ in seconds would lose the digits of the highest.
"""

from collections.abc import Sequence
from functools import reduce
from operator import add
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from identify.rigid_body.regressor import Array, library_of

NODES = 7
"""Delays at which exact sums are taken; six powers of the delay beyond the constant."""


class FeatureSums(NamedTuple):
    """Sums of one estimator at one delay, before errors map them; trials stand last."""

    gram: Float[Array, "elements elements *#trials"]
    """Sums of products of the elements of :func:`uq.monte_carlo.gram_sums.case_equations.feature_map`."""
    wrench: Float[Array, "elements functions *#trials"]
    """Sums of the elements' products with the functions of :class:`uq.monte_carlo.gram_sums.error_maps.WrenchBasis`."""


class RunSums(NamedTuple):
    """Sums over one run, coefficients of ``Σ_k S_k x^k`` with ``x = (delay - middle)/reach``."""

    gram: Float[Array, "powers *estimators rows elements"]
    """Sums of products of the elements, or of other rows with the elements."""
    wrench: Float[Array, "powers *estimators rows functions"]
    """Sums of the same rows' products with the functions of the wrench's basis."""
    middle: Float[Array, ""] | float = 0.0
    """Delay about which the polynomial is [s]."""
    reach: Float[Array, ""] | float = 1.0
    """Delay, from the middle, that counts as 1 [s]."""

    @classmethod
    def through(
        cls,
        nodes: Float[np.ndarray, " nodes"],
        gram: Float[np.ndarray, "nodes *estimators rows elements"],
        wrench: Float[np.ndarray, "nodes *estimators rows functions"],
    ) -> "RunSums":
        """Return the polynomial through exact sums at the delays of :func:`delay_nodes` [s], in NumPy."""
        middle, reach = (nodes[0] + nodes[-1]) / 2, (nodes[0] - nodes[-1]) / 2 or 1.0
        # the inverse takes values at the nodes to coefficients; of seven such nodes its condition number is 91
        to_powers = np.linalg.inv(np.vander((nodes - middle) / reach, increasing=True))
        return cls(
            np.tensordot(to_powers, gram, 1), np.tensordot(to_powers, wrench, 1), np.array(middle), np.array(reach)
        )

    @classmethod
    def total(cls, parts: Sequence["RunSums"]) -> "RunSums":
        """Return the sums over several runs, or over the pieces of one, which are polynomials in the same variable."""
        gram, wrench = (reduce(add, x) for x in zip(*((part.gram, part.wrench) for part in parts), strict=True))
        return parts[0]._replace(gram=gram, wrench=wrench)

    def of_estimator(self, number: int | Array) -> "RunSums":
        """Return the sums of one estimator of several."""
        return self._replace(gram=self.gram[:, number], wrench=self.wrench[:, number])

    def at(self, delay: Float[Array, "*#trials"] | float) -> FeatureSums:
        """Return the sums at a delay of the gyro [s]; the trials stand last."""
        xp = library_of(*self, delay)
        x = (xp.asarray(delay) - self.middle) / self.reach
        powers = xp.stack([x**k for k in range(len(self.gram))])
        return FeatureSums(*(xp.tensordot(xp.moveaxis(c, 0, -1), powers, 1) for c in (self.gram, self.wrench)))

    def derivative(self) -> "RunSums":
        """Return the derivative by the delay [1/s], a polynomial of one degree less; zero of a constant."""
        # d/dτ Σ_k S_k x^k = Σ_k k S_k x^(k-1) / reach
        order = np.arange(1, len(self.gram)) if len(self.gram) > 1 else np.zeros(1)

        def differentiated(c: Array) -> Array:
            return c[-len(order) :] * (order / self.reach).reshape(-1, *[1] * (c.ndim - 1))

        return self._replace(gram=differentiated(self.gram), wrench=differentiated(self.wrench))

    def nearest(self, delay: Float[Array, ""] | float) -> Float[Array, ""]:
        """Return the delay itself, or that end of the range to which it is nearest: no sample stands for any beyond."""
        return library_of(delay, self.middle).clip(delay, self.middle - self.reach, self.middle + self.reach)


def delay_nodes(low: float, high: float, count: int = NODES) -> Float[np.ndarray, " nodes"]:
    """Return Chebyshev's points of a range of delays, the latest first [s]; one point where the range has no width.

    The ends are among them, so that nothing is extrapolated, and so is the middle.
    """
    if low == high:
        return np.array([low])
    return (low + high) / 2 + (high - low) / 2 * np.cos(np.pi * np.arange(count) / (count - 1))
