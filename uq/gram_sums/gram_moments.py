"""Mean and covariance of the Gram sums under the gyro's white noise: exact, for every estimator at once.

Each summed product is a polynomial in the noise (:mod:`uq.gram_sums.wick`) whose coefficients are products of the true
signals. All that the moments need of a run is how those products correlate with one another, at one instant and over
the few instants that a differentiator joins. These sums over samples are taken once; the moments for any size of the
noise then follow in milliseconds.
"""

from collections.abc import Sequence
from functools import cache, partial
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.signal import fftconvolve
from jaxtyping import Array, Float

from identify.estimators.gram import Sums, sums_of
from identify.rigid_body.regressor import features
from identify.signals.differentiate import derivative
from uq.gram_sums.setup import SHARED, Setup
from uq.gram_sums.wick import WHITE, Kernel, Monomial, Term, correlations, summed_products, terms

SHORT = 16
"""Length of a kernel up to which its terms are summed one by one, which is then faster than by Fourier transforms."""


class GramMoments(eqx.Module):
    """What a run leaves behind for the moments of its Gram sums."""

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


def own_products(estimators: int, number: int) -> np.ndarray:
    """Return where the products of one estimator's thirteen features stand among those of all."""
    everything = SHARED + 3 * estimators
    own = np.r_[0:SHARED, SHARED + 3 * number : SHARED + 3 * number + 3]
    where = np.zeros((everything, everything), int)
    row, column = _upper(everything)
    where[row, column] = np.arange(len(row))
    wrench = len(row) + np.arange(6 * everything).reshape(everything, 6)
    return np.concatenate([where[np.ix_(own, own)][_upper(len(own))], wrench[own].ravel()])


@cache
def distinct_products(estimators: int) -> dict[Monomial, int]:
    """Return where each product of signals stands first among those of :func:`pack`; some of these are the same."""
    found: dict[Monomial, int] = {}
    for number, product in enumerate(summed_products(estimators)):
        found.setdefault(next(signals for signals, noise in product if not noise), number)
    return found


class _Layout(NamedTuple):
    """The algebra as indices."""

    monomials: tuple[Monomial, ...]
    """That occur with noise."""
    plain: tuple[Term, ...]
    """Terms of the mean that noise adds."""
    noisy: tuple[Term, ...]
    noisy_columns: np.ndarray
    """In which column each of these stands."""
    columns: tuple[tuple[Monomial, tuple], ...]
    """Each Wick power with each monomial that is its coefficient somewhere."""


@cache
def _layout(estimators: int) -> _Layout:
    everything = terms(estimators)
    noisy = tuple(term for term in everything if term.power)
    plain = tuple(term for term in everything if not term.power and any(term.weight.powers))
    columns = tuple(dict.fromkeys((term.monomial, term.power) for term in noisy))
    number = {column: k for k, column in enumerate(columns)}
    monomials = tuple(sorted({term.monomial for term in (*noisy, *plain)}, key=lambda m: (len(m), m)))
    return _Layout(monomials, plain, noisy, np.array([number[t.monomial, t.power] for t in noisy]), columns)


# --- set-up: sums over samples ---


def gram_moments(setup: Setup, *, chunk: int = 4000) -> GramMoments:
    """Visit the samples of a prepared run once, for the moments of its Gram sums under any white noise of omega.

    Args:
        setup: the run as the Monte Carlo has it (:func:`uq.trials.trial.prepare`), in float64.
        chunk: samples that are visited at a time.
    """
    known, elements = setup.signals.known.swapaxes(0, 1), len(setup.sums.gram)
    signals = jnp.concatenate([known[1:4], known[elements - 3 * len(setup.estimators) : elements + 6]]).astype(float)
    taps = [estimator.taps for estimator in setup.estimators]
    valid = setup.signals.valid.ravel().astype(float)
    return moments_of_signals(signals.reshape(len(signals), -1), valid, taps, chunk=chunk)


def moments_of_signals(
    signals: Float[Array, "signals n"],
    valid: Float[Array, " n"],
    taps: Sequence[Array],
    *,
    chunk: int = 4000,
) -> GramMoments:
    """Visit samples once; see :func:`gram_moments`.

    Args:
        signals: noise-free omega, every estimator's alpha, force and moment.
        valid: 1 for samples that count, else 0; none of those within the longest differentiator's reach of the ends.
        taps: every estimator's differentiator.
        chunk: samples that are visited at a time.
    """
    return _visit(signals, valid, _responses(taps), chunk)


@jax.jit
def alphas_of(omega: Float[Array, "3 n"], taps: Sequence[Array]) -> Float[Array, "alphas n"]:
    """Return every differentiator's alpha of omega [rad/s²], three rows each; zero where it has none."""
    return jnp.concatenate([jnp.pad(derivative(omega, one), ((0, 0), (len(one),) * 2)) for one in taps])


def _responses(taps: Sequence[Array]) -> Float[Array, "estimators lags"]:
    """Each differentiator's antisymmetric response over lags -2h … 2h, h the longest's reach."""
    reach = max(map(len, taps))
    halves = jnp.stack([jnp.pad(jnp.asarray(one), (0, 2 * reach - len(one))) for one in taps])
    return jnp.concatenate([-halves[:, ::-1], jnp.zeros((len(halves), 1)), halves], axis=1)


@partial(jax.jit, static_argnames="chunk")
def _visit(signals: Array, valid: Array, responses: Array, chunk: int) -> GramMoments:
    estimators = len(responses)
    layout, halo = _layout(estimators), responses.shape[1] // 2
    kernels = _kernels(responses)
    needed = _needed(estimators)
    size = min(chunk, signals.shape[1])
    count = -(-signals.shape[1] // size)
    padding = (halo, halo + count * size - signals.shape[1])
    rows = jnp.pad(jnp.concatenate([valid[None], signals * valid[None]]), ((0, 0), padding))

    def visit(carry, start):
        wide = _monomials(jax.lax.dynamic_slice_in_dim(rows, start, size + 2 * halo, axis=1), layout.monomials)
        inner = wide[:, halo : halo + size]
        found = [jnp.sum(inner, axis=1)]
        for kernel, (of_rows, of_columns) in needed.items():
            other = inner[of_columns]
            if kernel != WHITE:
                other = _convolved(wide[of_columns], kernels[kernel])
            found.append(inner[of_rows] @ other.T)
        return jax.tree.map(jnp.add, carry, found), None

    shapes = [(len(layout.monomials),), *((len(r), len(c)) for r, c in needed.values())]
    (totals, *products), _ = jax.lax.scan(visit, [jnp.zeros(s) for s in shapes], size * jnp.arange(count))
    alphas = responses @ responses.T
    correlated = _assemble(estimators, dict(zip(needed, products, strict=True)), alphas)
    omega, of_estimators, wrench = jnp.split(signals * valid[None], [3, 3 + 3 * estimators])
    phi = jnp.concatenate([features(omega, omega)[:SHARED] * valid[None], of_estimators])
    return GramMoments(pack(sums_of(phi, wrench[:3], wrench[3:])), totals, correlated, alphas)


def _convolved(rows: Float[Array, "rows n"], kernel: Float[Array, " lags"]) -> Float[Array, "rows inner"]:
    """Convolve rows with a kernel of odd length, where it fits: term by term if it is short."""
    lags = len(kernel)
    if lags > SHORT:
        return jax.vmap(fftconvolve, (0, None, None))(rows, kernel, "valid")
    size = rows.shape[1] - lags + 1
    return sum(kernel[lags - 1 - k] * rows[:, k : k + size] for k in range(lags))  # type: ignore[return-value]


def _monomials(rows: Array, monomials: tuple[Monomial, ...]) -> Array:
    """Products of signals; rows are what is valid, then the signals, zero where they do not count."""
    made: dict[Monomial, Array] = {(): rows[0]}
    for monomial in monomials:
        if monomial not in made:
            made[monomial] = made.get(monomial[:-1], rows[0]) * rows[1 + monomial[-1]]
    return jnp.stack([made[monomial] for monomial in monomials])


def _kernels(responses: Array) -> dict[Kernel, Array]:
    """Each product of covariances between two instants, over their lags."""
    estimators, lags = responses.shape
    covariances = {}
    for e in range(estimators):
        covariances[-1, e], covariances[e, -1] = responses[e], responses[e, ::-1]
        for f in range(estimators):
            both = jnp.convolve(responses[f], responses[e, ::-1])  # Σ_k h_e(k) h_f(k + lag)
            covariances[e, f] = both[lags // 2 : lags // 2 + lags]
    wanted = {correlation.kernel for correlation in correlations(estimators)} - {WHITE}
    return {kernel: jnp.prod(jnp.stack([covariances[pair] for pair in kernel]), axis=0) for kernel in wanted}


class _Block(NamedTuple):
    """Where one kernel's sums go in the matrix of correlated columns: entry by entry."""

    row: np.ndarray
    column: np.ndarray
    row_monomial: np.ndarray
    column_monomial: np.ndarray
    multiplicity: np.ndarray
    alphas: np.ndarray
    """Index among the covariances of the alphas' noise, flattened; -1 for none."""


@cache
def _blocks(estimators: int) -> dict[Kernel, _Block]:
    layout = _layout(estimators)
    number = {monomial: k for k, monomial in enumerate(layout.monomials)}
    members: dict[tuple, list[tuple[int, int]]] = {}
    for k, (monomial, power) in enumerate(layout.columns):
        members.setdefault(power, []).append((k, number[monomial]))
    entries: dict[Kernel, list[tuple]] = {}
    for c in correlations(estimators):
        alphas = -1 if c.alphas is None else estimators * c.alphas[0] + c.alphas[1]
        entries.setdefault(c.kernel, []).extend(
            (row, column, m, n, c.multiplicity, alphas) for row, m in members[c.row] for column, n in members[c.column]
        )
    return {kernel: _Block(*np.array(found).T) for kernel, found in entries.items()}


@cache
def _needed(estimators: int) -> dict[Kernel, tuple[np.ndarray, np.ndarray]]:
    """Which monomials each kernel joins."""
    blocks = _blocks(estimators).items()
    return {kernel: (np.unique(b.row_monomial), np.unique(b.column_monomial)) for kernel, b in blocks}


def _assemble(estimators: int, products: dict[Kernel, Array], alphas: Array) -> Array:
    size = len(_layout(estimators).columns)
    matrix = jnp.zeros((size, size))
    scale = jnp.append(alphas.ravel(), 1.0)
    for kernel, block in _blocks(estimators).items():
        of_rows, of_columns = _needed(estimators)[kernel]
        at = np.searchsorted(of_rows, block.row_monomial), np.searchsorted(of_columns, block.column_monomial)
        matrix = matrix.at[block.row, block.column].add(
            products[kernel][at] * block.multiplicity.astype(float) * scale[block.alphas]
        )
    return jnp.where(_mirrored(estimators), matrix.T, matrix)


@cache
def _mirrored(estimators: int) -> np.ndarray:
    """Entries whose row's Wick power comes after the column's."""
    powers = [power for _, power in _layout(estimators).columns]
    rank = np.array([sorted(set(powers)).index(power) for power in powers])
    return rank[:, None] > rank[None]


# --- moments for noise of any size ---


def mean(moments: GramMoments, variance: Float[Array, "3"]) -> Float[Array, " products"]:
    """Return the expected sums for white normal noise of omega of this variance [rad²/s²] on each axis."""
    return moments.sums + _changes(moments, variance, _layout(len(moments.alphas)).plain)


def second_order_change(moments: GramMoments, variance: Float[Array, "3"]) -> Float[Array, " products"]:
    """Return what the mean's second order in the noise adds to the noise-free sums: the textbook's ``½ tr(H Σ)``."""
    plain = _layout(len(moments.alphas)).plain
    return _changes(moments, variance, tuple(term for term in plain if sum(term.weight.powers) == 1))


def _changes(moments: GramMoments, variance: Array, plain: tuple[Term, ...]) -> Float[Array, " products"]:
    number = {monomial: k for k, monomial in enumerate(_layout(len(moments.alphas)).monomials)}
    monomials = np.array([number[term.monomial] for term in plain])
    weights = _weights(plain, moments.alphas, variance)
    products = np.array([term.product for term in plain])
    return jnp.zeros_like(moments.sums).at[products].add(weights * moments.totals[monomials])


def covariance(
    moments: GramMoments, variance: Float[Array, "3"], rows: Float[Array, "rows products"] | None = None
) -> Float[Array, "rows rows"]:
    """Return the sums' covariance, or that of linear combinations of them, one a row.

    Args:
        moments: of the run.
        variance: of omega's white normal noise on each axis [rad²/s²].
        rows: the combinations; None for the sums themselves.
    """
    return _correlate(moments, _coefficients(moments, variance), rows)


def first_order_covariance(
    moments: GramMoments, variance: Float[Array, "3"], rows: Float[Array, "rows products"] | None = None
) -> Float[Array, "rows rows"]:
    """Return the covariance that the terms linear in the noise alone would give: the textbook's (GUM 5.1.2)."""
    layout = _layout(len(moments.alphas))
    linear = np.array([len(t.power) == 1 and not any(t.weight.powers) for t in layout.noisy], float)
    return _correlate(moments, _coefficients(moments, variance, linear), rows)


def _correlate(moments: GramMoments, coefficients: Array, rows: Array | None) -> Array:
    combined = coefficients if rows is None else rows @ coefficients
    return combined @ moments.correlated @ combined.T


def _coefficients(moments: GramMoments, variance: Array, kept: np.ndarray | float = 1.0) -> Array:
    """The products' coefficients of the columns, times the noise's standard deviations."""
    layout = _layout(len(moments.alphas))
    products = np.array([term.product for term in layout.noisy])
    powers = np.array([np.bincount([axis for axis, _ in power], minlength=3) for _, power in layout.columns], float)
    sigma = jnp.prod(jnp.sqrt(variance)[None] ** powers, axis=1)
    weights = _weights(layout.noisy, moments.alphas, variance) * kept
    matrix = jnp.zeros((len(moments.sums), len(layout.columns)))
    return matrix.at[products, layout.noisy_columns].add(weights) * sigma[None]


def _weights(found: tuple[Term, ...], alphas: Array, variance: Array) -> Array:
    factor = np.array([term.weight.factor for term in found])
    powers = np.array([term.weight.powers for term in found], float)
    pair = np.array([-1 if (p := t.weight.alphas) is None else len(alphas) * p[0] + p[1] for t in found])
    return jnp.asarray(factor) * jnp.prod(variance[None] ** powers, axis=1) * jnp.append(alphas.ravel(), 1.0)[pair]
