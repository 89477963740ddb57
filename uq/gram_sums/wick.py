"""What the gyro's noise adds to the Gram sums, as polynomials in that noise: the algebra, without any numbers.

A noisy feature is a polynomial in the noise of omega, ``e_i``, and in what a differentiator makes of it, ``b_i``; so
is every product that is summed. In Wick powers ``:e_i e_j …:`` (Hermite polynomials of several variables) terms of
different order are uncorrelated, and two of one order correlate as the sum over all pairings of the product of the
pairs' covariances (Isserlis; Janson, Gaussian Hilbert Spaces, 1997, chapter 3). That makes means and covariances of
the sums exact for normal noise, whatever its size.
"""

from collections import defaultdict
from collections.abc import Iterator
from functools import cache
from itertools import combinations_with_replacement, permutations
from typing import NamedTuple

Noise = tuple[int, int]
"""A noise variable of one sample: (axis, -1) is that of omega, (axis, e) that of estimator e's alpha."""
Monomial = tuple[int, ...]
"""A product of true signals: rows among omega, every estimator's alpha, force and moment; sorted."""
Power = tuple[Noise, ...]
"""A product of noise variables, sorted."""
Polynomial = dict[tuple[Monomial, Power], float]
Kernel = tuple[tuple[int, int], ...]
"""A product of covariances between samples t and s: (-1, -1) stands for equal instants, (-1, e), (e, -1), (e, f) for
omega's noise or alpha's of an estimator at t, then at s; sorted."""

WHITE: Kernel = ((-1, -1),)


class Weight(NamedTuple):
    """A coefficient: ``factor * Π variance_axis ** power * (covariance of the alphas' noise at one instant)``."""

    factor: float
    powers: tuple[int, int, int]
    alphas: tuple[int, int] | None


class Term(NamedTuple):
    """``weight * monomial * :power:`` in one of the summed products."""

    product: int
    monomial: Monomial
    power: Power
    weight: Weight


class Correlation(NamedTuple):
    """``<:row: at t, :column: at s>``: sum of ``multiplicity * kernel(t - s)``, times a covariance of alphas' noise."""

    row: Power
    column: Power
    kernel: Kernel
    alphas: tuple[int, int] | None
    multiplicity: int


def noisy_features(estimators: int) -> list[Polynomial]:
    """Return the features of the regressor, every estimator's alpha last, as polynomials in the noise."""
    omega = [_noisy(axis, (axis, -1)) for axis in range(3)]
    products = [(0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2)]
    alphas = [_noisy(3 + 3 * e + axis, (axis, e)) for e in range(estimators) for axis in range(3)]
    return [{((), ()): 1.0}, *omega, *(_multiply(omega[i], omega[j]) for i, j in products), *alphas]


def _noisy(signal: int, noise: Noise) -> Polynomial:
    return {((signal,), ()): 1.0, ((), (noise,)): 1.0}


def _multiply(first: Polynomial, second: Polynomial) -> Polynomial:
    product: Polynomial = defaultdict(float)
    for (true1, noise1), factor1 in first.items():
        for (true2, noise2), factor2 in second.items():
            product[tuple(sorted(true1 + true2)), tuple(sorted(noise1 + noise2))] += factor1 * factor2
    return dict(product)


def summed_products(estimators: int) -> list[Polynomial]:
    """Return the products whose sums are kept, in the order of ``gram_moments.pack``: pairs of features, wrench."""
    phi = noisy_features(estimators)
    wrench: list[Polynomial] = [{((3 + 3 * estimators + row,), ()): 1.0} for row in range(6)]
    pairs = [(phi[k], phi[m]) for k, m in combinations_with_replacement(range(len(phi)), 2)]
    return [_multiply(first, second) for first, second in [*pairs, *((p, y) for p in phi for y in wrench)]]


@cache
def terms(estimators: int) -> tuple[Term, ...]:
    """Return every summed product in Wick powers."""
    return tuple(
        Term(number, monomial, power, Weight(factor * weight.factor, weight.powers, weight.alphas))
        for number, product in enumerate(summed_products(estimators))
        for (monomial, noise), factor in product.items()
        for weight, power in _wick(noise)
    )


def _wick(noise: Power) -> Iterator[tuple[Weight, Power]]:
    """Write a product of noise variables of one instant in Wick powers: a sum over sets of contracted pairs."""
    if not noise:
        yield Weight(1.0, (0, 0, 0), None), ()
        return
    first, rest = noise[0], noise[1:]
    for weight, power in _wick(rest):
        yield weight, tuple(sorted((first, *power)))
    for k, other in enumerate(rest):
        if first[0] == other[0] and (first[1] < 0) == (other[1] < 0):  # omega's noise and alpha's are uncorrelated here
            for weight, power in _wick(rest[:k] + rest[k + 1 :]):
                yield _contracted(weight, first, other), power


def _contracted(weight: Weight, first: Noise, second: Noise) -> Weight:
    powers = [power + (axis == first[0]) for axis, power in enumerate(weight.powers)]
    alphas = weight.alphas if first[1] < 0 else (first[1], second[1])  # products hold two alphas at most
    return Weight(weight.factor, (powers[0], powers[1], powers[2]), alphas)


@cache
def correlations(estimators: int) -> tuple[Correlation, ...]:
    """Return how the Wick powers that occur correlate between two instants, rows not after columns; unit variances."""
    powers = sorted({term.power for term in terms(estimators) if term.power})
    multiplicities: dict[tuple, int] = defaultdict(int)
    for row, column in combinations_with_replacement(powers, 2):
        if [axis for axis, _ in row] == [axis for axis, _ in column]:
            for paired in permutations(column):
                if (kernel := _kernel(row, paired)) is not None:
                    multiplicities[row, column, *kernel] += 1
    return tuple(Correlation(*key, multiplicity) for key, multiplicity in multiplicities.items())  # type: ignore[call-arg]


def _kernel(row: Power, column: Power) -> tuple[Kernel, tuple[int, int] | None] | None:
    """The product of covariances of paired variables; None where it is zero."""
    if any(at_t[0] != at_s[0] for at_t, at_s in zip(row, column, strict=True)):
        return None
    pairs = sorted((at_t[1], at_s[1]) for at_t, at_s in zip(row, column, strict=True))
    if WHITE[0] not in pairs:
        return tuple(pairs), None
    others = [pair for pair in pairs if pair != WHITE[0]]
    if any(-1 in pair for pair in others):  # omega's noise and alpha's, at equal instants
        return None
    return WHITE, others[0] if others else None
