"""Mean and covariance of the Gram sums under the gyro's white noise: exact, for every estimator at once.

Each summed product is a polynomial in the noise (:mod:`uq.gram_sums.wick`) whose coefficients are products of the true
signals. The moments depend on a run only through how those products correlate with one another, at one instant and over
the few instants that a differentiator joins. These sums over samples are taken once
(:mod:`uq.gram_sums.sums_over_samples`); the moments for any size of the noise then follow in milliseconds.
"""

from collections.abc import Sequence
from functools import cache
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from identify.estimators.gram import Sums
from identify.pytree import Pytree
from uq.gram_sums.setup import SHARED
from uq.gram_sums.wick import Monomial, Term, summed_products, terms


class GramMoments(Pytree):
    """Sums over one run's samples from which the moments of its Gram sums follow."""

    sums: Float[Array, " products"]
    """Of the noise-free products, in the order of :func:`pack`."""
    totals: Float[Array, " monomials"]
    """Sums of the products of true signals that occur with noise."""
    correlated: Float[Array, "columns columns"]
    """Covariance of Wick powers, each with its coefficient's monomial, for noise of omega of unit variance."""
    alphas: Float[Array, "estimators estimators"]
    """Covariance of the estimators' noises of alpha at one instant, for the same."""


def pack(sums: Sums) -> Float[Array, " products"]:
    """Return the sums that differ from one another: the Gram matrix's upper triangle, then force and moment."""
    return jnp.concatenate([sums.gram[_upper(len(sums.gram))], jnp.hstack([sums.force, sums.moment]).ravel()])


def unpack(vector: Float[Array, " products"], features: int) -> Sums:
    """Return the sums from :func:`pack`."""
    row, column = _upper(features)
    gram = jnp.zeros((features, features)).at[row, column].set(vector[: len(row)])
    wrench = vector[len(row) :].reshape(features, 6)
    return Sums(gram + jnp.triu(gram, 1).T, wrench[:, :3], wrench[:, 3:])


def _upper(features: int) -> tuple[np.ndarray, np.ndarray]:
    return np.triu_indices(features)


def products_of_estimator(estimators: int, number: int) -> np.ndarray:
    """Return where the products of one estimator's thirteen features stand among those of all."""
    features = SHARED + 3 * estimators
    selected = np.r_[0:SHARED, SHARED + 3 * number : SHARED + 3 * number + 3]
    where = np.zeros((features, features), int)
    row, column = _upper(features)
    where[row, column] = np.arange(len(row))
    wrench = len(row) + np.arange(6 * features).reshape(features, 6)
    return np.concatenate([where[np.ix_(selected, selected)][_upper(len(selected))], wrench[selected].ravel()])


@cache
def distinct_products(estimators: int) -> dict[Monomial, int]:
    """Return where each product of signals stands first among those of :func:`pack`; some of these are the same."""
    places: dict[Monomial, int] = {}
    for place, product in enumerate(summed_products(estimators)):
        places.setdefault(next(signals for signals, noise in product if not noise), place)
    return places


class ProductLayout(NamedTuple):
    """The algebra as indices."""

    monomials: tuple[Monomial, ...]
    """Products of true signals that occur with noise."""
    plain: tuple[Term, ...]
    """Terms of the mean that noise adds."""
    noisy: tuple[Term, ...]
    noisy_columns: np.ndarray
    """The column of each of these."""
    columns: tuple[tuple[Monomial, tuple], ...]
    """Pairs of a monomial and the Wick power whose coefficient it is in some product, by the order of the power."""
    orders: tuple[slice, ...]
    """Where those of each order stand: different orders are uncorrelated."""


@cache
def product_layout(estimators: int) -> ProductLayout:
    """Return the algebra of the summed products for this number of estimators."""
    all_terms = terms(estimators)
    noisy = tuple(term for term in all_terms if term.power)
    plain = tuple(term for term in all_terms if not term.power and any(term.weight.powers))
    columns = tuple(sorted(dict.fromkeys((term.monomial, term.power) for term in noisy), key=lambda c: len(c[1])))
    ends = np.cumsum(np.bincount([len(power) for _, power in columns])).tolist()
    number = {column: k for k, column in enumerate(columns)}
    monomials = tuple(sorted({term.monomial for term in (*noisy, *plain)}, key=lambda m: (len(m), m)))
    noisy_columns = np.array([number[term.monomial, term.power] for term in noisy])
    return ProductLayout(monomials, plain, noisy, noisy_columns, columns, tuple(map(slice, ends[:-1], ends[1:])))


def mean(moments: GramMoments, variance: Float[Array, "3"]) -> Float[Array, " products"]:
    """Return the expected sums for white normal noise of omega of this variance [rad²/s²] on each axis."""
    return moments.sums + _changes(moments, variance, product_layout(len(moments.alphas)).plain)


def second_order_change(moments: GramMoments, variance: Float[Array, "3"]) -> Float[Array, " products"]:
    """Return what the mean's second order in the noise adds to the noise-free sums: the textbook's ``½ tr(H Σ)``."""
    plain = product_layout(len(moments.alphas)).plain
    return _changes(moments, variance, tuple(term for term in plain if sum(term.weight.powers) == 1))


def _changes(moments: GramMoments, variance: Array, plain: tuple[Term, ...]) -> Float[Array, " products"]:
    number = {monomial: k for k, monomial in enumerate(product_layout(len(moments.alphas)).monomials)}
    monomials = np.array([number[term.monomial] for term in plain])
    weights = _weights(plain, moments.alphas, variance)
    products = np.array([term.product for term in plain])
    return jnp.zeros_like(moments.sums).at[products].add(weights * moments.totals[monomials])


def covariance(
    moments: GramMoments, variance: Float[Array, "3"], rows: Float[Array, "*sets rows products"] | None = None
) -> Float[Array, "*sets rows rows"]:
    """Return the sums' covariance, or that of linear combinations of them, one a row, or of several sets of these.

    Args:
        moments: of the run.
        variance: of omega's white normal noise on each axis [rad²/s²].
        rows: the combinations; None for the sums themselves.
    """
    orders = product_layout(len(moments.alphas)).orders
    return _correlate(moments, _coefficients(moments, variance), rows, orders)


def first_order_covariance(
    moments: GramMoments, variance: Float[Array, "3"], rows: Float[Array, "*sets rows products"] | None = None
) -> Float[Array, "*sets rows rows"]:
    """Return the covariance that the terms linear in the noise alone would give: the textbook's (GUM 5.1.2)."""
    layout = product_layout(len(moments.alphas))
    linear = np.array([len(t.power) == 1 and not any(t.weight.powers) for t in layout.noisy], float)
    return _correlate(moments, _coefficients(moments, variance, linear), rows, layout.orders[:1])


def _correlate(moments: GramMoments, coefficients: Array, rows: Array | None, orders: Sequence[slice]) -> Array:
    of_orders = [coefficients[:, order] for order in orders]
    combined = of_orders if rows is None else [rows @ each for each in of_orders]
    blocks = [moments.correlated[order, order] for order in orders]
    return sum((c @ block @ c.swapaxes(-1, -2) for c, block in zip(combined, blocks, strict=True)), jnp.zeros(()))


def _coefficients(moments: GramMoments, variance: Array, mask: np.ndarray | float = 1.0) -> Array:
    """The products' coefficients of the columns, times the noise's standard deviations."""
    layout = product_layout(len(moments.alphas))
    products = np.array([term.product for term in layout.noisy])
    powers = np.array([np.bincount([axis for axis, _ in power], minlength=3) for _, power in layout.columns], float)
    sigma = jnp.prod(jnp.sqrt(variance)[None] ** powers, axis=1)
    weights = _weights(layout.noisy, moments.alphas, variance) * mask
    matrix = jnp.zeros((len(moments.sums), len(layout.columns)))
    return matrix.at[products, layout.noisy_columns].add(weights) * sigma[None]


def _weights(terms_of_sums: tuple[Term, ...], alphas: Array, variance: Array) -> Array:
    factor = np.array([term.weight.factor for term in terms_of_sums])
    powers = np.array([term.weight.powers for term in terms_of_sums], float)
    pair = np.array([-1 if (p := t.weight.alphas) is None else len(alphas) * p[0] + p[1] for t in terms_of_sums])
    return jnp.asarray(factor) * jnp.prod(variance[None] ** powers, axis=1) * jnp.append(alphas.ravel(), 1.0)[pair]
