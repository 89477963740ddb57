"""One pass over a run's samples, for the moments of its Gram sums (:mod:`uq.gram_sums.gram_moments`).

What is summed are products of the true signals with one another, at one instant and over the few instants that a
differentiator joins.
"""

from collections.abc import Sequence
from functools import cache, partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax.scipy.signal import fftconvolve
from jaxtyping import Array, Float

from identify.estimators.gram import sums_of
from identify.rigid_body.regressor import features
from identify.signals.differentiate import derivative
from uq.gram_sums.gram_moments import GramMoments, pack, product_layout
from uq.gram_sums.setup import SHARED, Setup
from uq.gram_sums.wick import WHITE, Kernel, Monomial, correlations

SHORT = 16
"""Length of a kernel up to which its terms are summed one by one, which is then faster than by Fourier transforms."""


def gram_moments(setup: Setup, *, chunk: int = 4000) -> GramMoments:
    """Sum over a prepared run's samples, for the moments of its Gram sums under any white noise of omega.

    Args:
        setup: the run as the Monte Carlo has it (:func:`uq.trials.trial.prepare`), in float64.
        chunk: samples in one step of the pass.
    """
    noise_free, elements = setup.signals.noise_free.swapaxes(0, 1), len(setup.sums.gram)
    alphas_and_wrench = slice(elements - 3 * len(setup.estimators), elements + 6)
    signals = jnp.concatenate([noise_free[1:4], noise_free[alphas_and_wrench]]).astype(float)
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
    """Sum over samples in one pass; see :func:`gram_moments`.

    Args:
        signals: noise-free omega, every estimator's alpha, force and moment.
        valid: 1 for samples that count, else 0; none of those within the longest differentiator's reach of the ends.
        taps: every estimator's differentiator.
        chunk: samples in one step of the pass.
    """
    return _visit(signals, valid, responses_of(taps), chunk)


@jax.jit
def alphas_of(omega: Float[Array, "3 n"], taps: Sequence[Array]) -> Float[Array, "alphas n"]:
    """Return every differentiator's alpha of omega [rad/s²], three rows each; zero where it has none."""
    return jnp.concatenate([jnp.pad(derivative(omega, h), ((0, 0), (len(h),) * 2)) for h in taps])


def responses_of(taps: Sequence[Array]) -> Float[Array, "estimators lags"]:
    """Return each differentiator's antisymmetric response [1/s] over lags -2h … 2h, h the longest's reach."""
    reach = max(map(len, taps))
    halves = jnp.stack([jnp.pad(jnp.asarray(h), (0, 2 * reach - len(h))) for h in taps])
    return jnp.concatenate([-halves[:, ::-1], jnp.zeros((len(halves), 1)), halves], axis=1)


class PieceSums(NamedTuple):
    """Sums over some of a run's samples; those of all pieces add up to what :func:`moments_of_sums` takes."""

    products: Float[Array, " products"]
    """Of the noise-free products, as :class:`GramMoments` has them."""
    totals: Float[Array, " monomials"]
    joined: tuple[Float[Array, "rows columns"], ...]
    """Each kernel's products of monomials."""


@partial(jax.jit, static_argnames="chunk")
def _visit(signals: Array, valid: Array, responses: Array, chunk: int) -> GramMoments:
    halo = responses.shape[1] // 2
    size = min(chunk, signals.shape[1])
    count = -(-signals.shape[1] // size)
    padding = (halo, halo + count * size - signals.shape[1])
    rows = jnp.pad(jnp.concatenate([valid[None], signals * valid[None]]), ((0, 0), padding))

    def visit(carry, start):
        piece = sums_of_piece(jax.lax.dynamic_slice_in_dim(rows, start, size + 2 * halo, axis=1), responses)
        return jax.tree.map(jnp.add, carry, piece), None

    empty = jax.eval_shape(sums_of_piece, rows[:, : size + 2 * halo], responses)
    zeros = jax.tree.map(lambda leaf: jnp.zeros(leaf.shape, leaf.dtype), empty)
    return moments_of_sums(jax.lax.scan(visit, zeros, size * jnp.arange(count))[0], responses)


def sums_of_piece(rows: Float[Array, "rows wide"], responses: Float[Array, "estimators lags"]) -> PieceSums:
    """Sum over the samples of a piece.

    Args:
        rows: 1 for samples that count, else 0, then the signals of :func:`moments_of_signals` times this; at either end
            as many samples more than are summed as the longest lag.
        responses: of the differentiators (:func:`responses_of`).
    """
    estimators, halo = len(responses), responses.shape[1] // 2
    kernels, size = _kernels(responses), rows.shape[1] - 2 * halo
    wide, count = _monomials(rows, product_layout(estimators).monomials), rows[0, halo : halo + size]
    inner, products = wide[:, halo : halo + size], []
    for kernel, (of_rows, of_columns) in _needed(estimators).items():
        other = inner[of_columns] if kernel == WHITE else _convolved(wide[of_columns], kernels[kernel])
        products.append(inner[of_rows] @ other.T)
    omega, alphas, wrench = jnp.split(rows[1:, halo : halo + size], [3, 3 + 3 * estimators])
    phi = jnp.concatenate([features(omega, omega)[:SHARED] * count[None], alphas])
    return PieceSums(pack(sums_of(phi, wrench[:3], wrench[3:])), jnp.sum(inner, axis=1), tuple(products))


def moments_of_sums(sums: PieceSums, responses: Float[Array, "estimators lags"]) -> GramMoments:
    """Return the moments from the sums over all pieces."""
    estimators, alphas = len(responses), responses @ responses.T
    correlated = _assemble(estimators, dict(zip(_needed(estimators), sums.joined, strict=True)), alphas)
    return GramMoments(sums.products, sums.totals, correlated, alphas)


def _convolved(rows: Float[Array, "rows n"], kernel: Float[Array, " lags"]) -> Float[Array, "rows inner"]:
    """Convolve rows with a kernel of odd length, where it fits: term by term if it is short."""
    lags = len(kernel)
    if lags > SHORT:
        return jax.vmap(fftconvolve, (0, None, None))(rows, kernel, "valid")
    size = rows.shape[1] - lags + 1
    return sum(kernel[lags - 1 - k] * rows[:, k : k + size] for k in range(lags))  # type: ignore[return-value]


def _monomials(rows: Array, monomials: tuple[Monomial, ...]) -> Array:
    """Products of signals; rows are what is valid, then the signals, zero where they do not count."""
    products: dict[Monomial, Array] = {(): rows[0]}
    for monomial in monomials:
        if monomial not in products:
            products[monomial] = products.get(monomial[:-1], rows[0]) * rows[1 + monomial[-1]]
    return jnp.stack([products[monomial] for monomial in monomials])


def _kernels(responses: Array) -> dict[Kernel, Array]:
    """Each product of covariances between two instants, over their lags."""
    estimators, lags = responses.shape
    covariances = {}
    for e in range(estimators):
        covariances[-1, e], covariances[e, -1] = responses[e], responses[e, ::-1]
        for f in range(estimators):
            correlation = jnp.convolve(responses[f], responses[e, ::-1])  # Σ_k h_e(k) h_f(k + lag)
            covariances[e, f] = correlation[lags // 2 : lags // 2 + lags]
    kernels = {correlation.kernel for correlation in correlations(estimators)} - {WHITE}
    return {kernel: jnp.prod(jnp.stack([covariances[pair] for pair in kernel]), axis=0) for kernel in kernels}


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
    layout = product_layout(estimators)
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
    return {kernel: _Block(*np.array(indices).T) for kernel, indices in entries.items()}


@cache
def _needed(estimators: int) -> dict[Kernel, tuple[np.ndarray, np.ndarray]]:
    """Which monomials each kernel joins."""
    blocks = _blocks(estimators).items()
    return {kernel: (np.unique(b.row_monomial), np.unique(b.column_monomial)) for kernel, b in blocks}


def _assemble(estimators: int, products: dict[Kernel, Array], alphas: Array) -> Array:
    size = len(product_layout(estimators).columns)
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
    powers = [power for _, power in product_layout(estimators).columns]
    rank = np.array([sorted(set(powers)).index(power) for power in powers])
    return rank[:, None] > rank[None]
