"""Normal equations from the sums of distinct products, in plain arithmetic: thousands of trials through vector units.

The thirteen features of :mod:`identify.rigid_body.regressor` are products of omega and alpha, so many entries of their
Gram matrix are the same sum. A sum is named by its sorted factors: 0 … 2 are omega, 3 … 5 alpha, 6 … 8 force, 9 … 11
moment about Q. What :mod:`identify.estimators.gram` does to one trial's matrices, this does to each sum, an array over
trials.

It exists for speed alone: with the matrices of :mod:`identify.estimators.gram` under ``vmap``, 10,000 collapsed
trials of the preset's T1 took 0.86 s of processor time instead of 0.074 s, 12 times as much (in batches of 100, the
best size), with the same estimates to 2e-15 kg·m². Compiling takes 24 s instead of 7 s, once: compiled code is cached.
"""

from collections import Counter
from collections.abc import Mapping
from itertools import combinations_with_replacement, product

import numpy as np
from jaxtyping import Array, Float

from identify.rigid_body.regressor import OMEGA_R_OF_FEATURES
from uq.gram_sums.plain_solve import LOWER, Lower, Trials, Vector, total

Factors = tuple[int, ...]
Sums = Mapping[Factors, Trials]

PHI: tuple[Factors, ...] = (
    (), (0,), (1,), (2,), (0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2), (3,), (4,), (5,),
)  # fmt: skip
"""The features, in the order of ``identify.rigid_body.regressor.FEATURES``."""
OF_OMEGA_R = tuple(k for k in range(len(PHI)) if OMEGA_R_OF_FEATURES[k].any())
"""Those in which Omega_R is linear."""
AXES = tuple(combinations_with_replacement(range(3), 2))
"""Pairs of axes of the moment."""
RESIDUAL = (12, 13, 14)
"""Factors that stand for ``M - r × F`` here."""


def _sorted(*factors: Factors) -> Factors:
    return tuple(sorted(sum(factors, ())))


TRIAL_SUMS: tuple[Factors, ...] = (
    *sorted({_sorted(first, second) for first in PHI for second in PHI}),
    *(_sorted(phi, (row,)) for phi in PHI for row in range(6, 12)),
)
"""Sums that a trial needs."""
MATRIX_SUMS: tuple[Factors, ...] = tuple(sorted({_sorted(PHI[k], PHI[m]) for k in OF_OMEGA_R for m in OF_OMEGA_R}))
"""Those among them that ``Σ Ωᵀ S Ω`` is made of."""


def _weights() -> np.ndarray:
    """From the needed sums to ``Σ Ω_aᵀ Ω_b + Ω_bᵀ Ω_a`` of two axes or ``Σ Ω_aᵀ Ω_a`` of one; (axes, places, sums)."""
    weights = np.zeros((len(AXES), len(LOWER), len(MATRIX_SUMS)))
    for k, m in product(OF_OMEGA_R, repeat=2):
        for pair, (a, b) in enumerate(AXES):
            product_of_rows = np.outer(OMEGA_R_OF_FEATURES[k, a], OMEGA_R_OF_FEATURES[m, b])
            product_of_rows = product_of_rows if a == b else product_of_rows + product_of_rows.T
            weights[pair, :, MATRIX_SUMS.index(_sorted(PHI[k], PHI[m]))] += [product_of_rows[place] for place in LOWER]
    return weights


WEIGHTS = _weights()


def shifted(sums: Sums, powers: Mapping[Factors, Trials], factors: Factors) -> Trials:
    """Return a sum as it would be with an offset added to omega: exact, a polynomial in the offset.

    Args:
        sums: of the products of lower order.
        powers: products of the offset's components, by their axes; see :func:`powers_of`.
        factors: of the sum.
    """
    of_omega = [factor for factor in factors if factor < 3]
    others = tuple(factor for factor in factors if factor >= 3)
    count: Counter[tuple[Factors, Factors]] = Counter()
    for replaced in product((False, True), repeat=len(of_omega)):
        choice = list(zip(of_omega, replaced, strict=True))
        by_offset = tuple(axis for axis, replace in choice if replace)
        count[by_offset, tuple(axis for axis, replace in choice if not replace)] += 1
    terms = []
    for (offset_axes, omega_axes), times in count.items():
        term = sums[omega_axes + others]
        term = powers[offset_axes] * term if offset_axes else term
        terms.append(term if times == 1 else float(times) * term)
    return total(terms)


def powers_of(offset: Vector) -> dict[Factors, Trials]:
    """Return the products of an offset's components up to the fourth order."""
    powers: dict[Factors, Trials] = {(axis,): offset[axis] for axis in range(3)}
    for order in range(2, 5):
        for axes in combinations_with_replacement(range(3), order):
            powers[axes] = powers[axes[:-1]] * offset[axes[-1]]
    return powers


def residual_sums(sums: Sums, r_cg: Vector, offset: Vector) -> dict[Factors, Trials]:
    """Return the features' sums with ``M - r × F``, force and moment with an offset (force first) added."""
    residuals: dict[Factors, Trials] = {}
    for phi in PHI:
        f1, f2, f3, m1, m2, m3 = (sums[(*phi, 6 + row)] + sums[phi] * offset[row] for row in range(6))
        r1, r2, r3 = r_cg
        crossed = (r2 * f3 - r3 * f2, r3 * f1 - r1 * f3, r1 * f2 - r2 * f1)
        for factor, moment, arm in zip(RESIDUAL, (m1, m2, m3), crossed, strict=True):
            residuals[(*phi, factor)] = moment - arm
    return residuals


def right_side(sums: Sums) -> list[Trials]:
    """Return ``Σ Ωᵀ(M - r × F)`` of (10) from the residual's sums."""
    return [
        total(
            float(weight) * sums[(*PHI[k], RESIDUAL[axis])]
            for k in OF_OMEGA_R
            for axis in range(3)
            if (weight := OMEGA_R_OF_FEATURES[k, axis, row])
        )
        for row in range(6)
    ]


def normal_matrix(sums: Sums) -> Lower:
    """Return ``Σ ΩᵀΩ`` of (10)."""
    weights = sum(WEIGHTS[AXES.index((axis, axis))] for axis in range(3))
    return {place: _combined(weights[k], sums) for k, place in enumerate(LOWER)}


def weighted_matrix(sums: Sums, weight: Vector) -> Lower:
    """Return ``Σ Ωᵀ S Ω`` for a symmetric S, its entries in the order of ``AXES``."""
    return {
        place: total(
            _combined(WEIGHTS[pair, k], sums) * weight[pair] for pair in range(len(AXES)) if WEIGHTS[pair, k].any()
        )
        for k, place in enumerate(LOWER)
    }


def _combined(weights: np.ndarray, sums: Sums) -> Trials:
    return total(
        sums[factors] if weight == 1 else float(weight) * sums[factors]
        for weight, factors in zip(weights, MATRIX_SUMS, strict=True)
        if weight
    )


def residual_covariance(cell: Float[Array, "6 6 *trials"], r_cg: Vector) -> list[Trials]:
    """Return the covariance of ``M - r × F`` at one sample, in the order of ``AXES``, for that of force and moment."""
    r1, r2, r3 = r_cg
    crossed: list[dict[int, Trials]] = [{1: r3, 2: -r2}, {0: -r3, 2: r1}, {0: r2, 1: -r1}]  # -r ×, row by row
    rows = [
        [total([cell[3 + a, m], *(x * cell[k, m] for k, x in crossed[a].items())]) for m in range(6)] for a in range(3)
    ]
    return [total([rows[a][3 + b], *(rows[a][k] * x for k, x in crossed[b].items())]) for a, b in AXES]
