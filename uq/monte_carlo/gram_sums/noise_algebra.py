"""The algebra of what the gyro's noise adds to the Gram sums, term by term, without any numbers of a run.

Each sum is over products of signals: omega, every estimator's alpha, force and moment. With noise e of omega, and what
a differentiator makes of it in alpha, a product is a polynomial in the noise. Its part linear in the noise and its part
quadratic in it, less the expectation, are all that a sum fluctuates by; higher orders are smaller by the square of
noise over signal and are left out, but their part of the expectation is not.

A *channel* is where noise enters: 0 is omega, 1 + e the alpha of estimator e. A *monomial* is a product of noise-free
signals.
"""

from collections import Counter
from collections.abc import Iterator
from functools import cache
from itertools import combinations_with_replacement
from typing import NamedTuple

import numpy as np

from identify.rigid_body.regressor import PAIRS

Monomial = tuple[int, ...]
"""Signals that are multiplied, sorted: 0 to 2 are omega, then come every estimator's alpha, force and moment."""


class NoiseAlgebra(NamedTuple):
    """Summed products and their coefficients of the noise, for a number of estimators."""

    products: tuple[Monomial, ...]
    """Distinct products whose sums a trial needs."""
    gram: np.ndarray
    """Number of the product of two features of an estimator, (estimators, 13, 13)."""
    wrench: np.ndarray
    """Number of the product of a feature of an estimator with a channel of the load cell, (estimators, 13, 6)."""
    linear: tuple[tuple[Monomial, int], ...]
    """Monomials, each with the channel whose noise it multiplies."""
    by_linear: np.ndarray
    """Coefficients of the linear terms by the axis of the noise, (3, products, linear)."""
    quadratic: tuple[tuple[Monomial, int, int], ...]
    """Monomials, each with the two channels whose noises it multiplies."""
    by_quadratic: np.ndarray
    """Coefficients of the quadratic terms by the axes of the two noises, (3, 3, products, quadratic)."""


@cache
def noise_algebra(estimators: int) -> NoiseAlgebra:
    """Return the algebra for this number of estimators."""
    products: dict[Monomial, int] = {}

    def number(*factors: Monomial) -> int:
        return products.setdefault(tuple(sorted(sum(factors, ()))), len(products))

    signals = 3 + 3 * estimators
    features = [_features(3 + 3 * e) for e in range(estimators)]
    gram = np.array([[[number(a, b) for b in factors] for a in factors] for factors in features])
    wrench = np.array([[[number(a, (signals + row,)) for row in range(6)] for a in factors] for factors in features])
    linear: dict[tuple[Monomial, int], int] = {}
    quadratic: dict[tuple[Monomial, int, int], int] = {}
    linear_terms, quadratic_terms = [], []
    for product, place in products.items():
        noisy = Counter(signal for signal in product if signal < signals)
        # the polynomial's first derivatives: a factor xⁿ gives n xⁿ⁻¹ e
        for signal, times in noisy.items():
            channel, axis = _channel(signal)
            term = linear.setdefault((_without(product, signal), channel), len(linear))
            linear_terms.append((axis, place, term, times))
        # its second, halved: n (n - 1)/2 of one factor, n m of two
        for first, second, times in _pairs(noisy):
            (c, i), (d, j) = _channel(first), _channel(second)
            term = quadratic.setdefault((_without(product, first, second), c, d), len(quadratic))
            quadratic_terms.append((i, j, place, term, times))
    by_linear = np.zeros((3, len(products), len(linear)))
    by_quadratic = np.zeros((3, 3, len(products), len(quadratic)))
    for *where, times in linear_terms:
        by_linear[tuple(where)] += times
    for *where, times in quadratic_terms:
        by_quadratic[tuple(where)] += times
    return NoiseAlgebra(
        products=tuple(products), gram=gram, wrench=wrench, linear=tuple(linear), by_linear=by_linear,
        quadratic=tuple(quadratic), by_quadratic=by_quadratic,
    )  # fmt: skip


def _features(alpha: int) -> list[Monomial]:
    """Return the features of the regressor; ``alpha`` is the number of the first axis of the estimator's alpha."""
    return [(), (0,), (1,), (2,), *PAIRS, *((alpha + axis,) for axis in range(3))]


def _channel(signal: int) -> tuple[int, int]:
    """Return channel and axis of a signal's noise."""
    return signal // 3, signal % 3


def _without(product: Monomial, *signals: int) -> Monomial:
    rest = list(product)
    for signal in signals:
        rest.remove(signal)
    return tuple(rest)


def _pairs(noisy: Counter[int]) -> Iterator[tuple[int, int, int]]:
    """Yield pairs of noisy factors of a product, and in how many ways each is chosen: half the second derivative."""
    for first, second in combinations_with_replacement(sorted(noisy), 2):
        times = noisy[first] * noisy[second] if first != second else noisy[first] * (noisy[first] - 1) // 2
        if times:
            yield first, second, times


@cache
def expectation_terms() -> np.ndarray:
    """Return what second-order noise adds to the expectation of the product of two features, as sums of features.

    Returns:
        Coefficients, (13, 13, 2, 3, 3, 13): features multiplied; noise of omega or of alpha, and the two axes of its
        covariance; feature whose sum the term is.
    """
    algebra, number = noise_algebra(1), {feature: k for k, feature in enumerate(_features(3))}
    terms = np.zeros((13, 13, 2, 3, 3, 13))
    for k, (monomial, first, second) in enumerate(algebra.quadratic):
        # at one instant the noises of omega and of alpha are uncorrelated: the taps are antisymmetric
        if first == second and monomial in number:  # else it is of a sum with the wrench
            by_axes = algebra.by_quadratic[..., algebra.gram[0], k]
            terms[:, :, first, :, :, number[monomial]] += np.moveaxis(by_axes, (0, 1), (2, 3))
    return terms
