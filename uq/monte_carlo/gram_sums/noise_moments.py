"""One pass over a run's samples gives the moments of its Gram sums under the gyro's noise, for noise of any size.

The noise is ``e = Σ filters, each driven by white noise from rest``. A sum's fluctuation linear in it is
``Σ J e = Σ (Lᵀ J) w`` with a filter L and white w, so that the covariance of these is a Gram matrix of filtered
monomials of the noise-free signals (:mod:`uq.monte_carlo.gram_sums.noise_algebra`). The quadratic fluctuations'
covariance is ``Σ_t Σ_s H(t) H(s) C(t - s) C(t - s)`` (Isserlis), a convolution with products of autocovariances. Noise
that is not normal has third and fourth cumulants; they enter through the coefficient of ``e²``.

None of these depends on the size of the noise: :meth:`RunMoments.covariance` follows for any size in milliseconds.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations_with_replacement, product

import numpy as np
import scipy
from jaxtyping import Float
from numpy import fft

from uq.monte_carlo.gram_sums.case_equations import NoiseExpectation, noise_expectation
from uq.monte_carlo.gram_sums.noise_algebra import NoiseAlgebra, noise_algebra
from uq.sources.noise_filters import WHITE, GyroNoise, NoiseFilter

PIECE = 8192
"""Samples in a step of the pass where all noise is white: what a step works on stays in a processor's cache."""
FEW = 16
"""Lags of a kernel up to which its terms are added one by one, which is then faster than by Fourier transforms."""


@dataclass(frozen=True)
class RunMoments:
    """Sums over a run, from which the covariance of its Gram sums follows for noise of any size."""

    algebra: NoiseAlgebra
    linear: Mapping[NoiseFilter, Float[np.ndarray, "linear linear"]]
    """Gram matrix of the monomials behind each filter."""
    quadratic: Mapping[tuple[NoiseFilter, NoiseFilter], Float[np.ndarray, "2 quadratic quadratic"]]
    """Sums of pairs of monomials with products of two noises' autocovariances; second, the two noises exchanged."""
    squares: Float[np.ndarray, "squares linear+squares"]
    """Sums of the coefficients of white noise's squares with those of the noise itself and with one another."""
    by_square: Float[np.ndarray, "3 products squares"]
    """Products as linear functions of the coefficients of the squares, by axis."""
    alpha: Mapping[NoiseFilter, Float[np.ndarray, " estimators"]]
    """Variance of the noise of each estimator's alpha for unit noise."""
    omega: Mapping[NoiseFilter, float]
    """Variance of the noise of omega for unit noise, on the average over the run."""

    def __add__(self, other: "RunMoments") -> "RunMoments":
        """Return the moments over the samples of both, which are parts of one run."""
        linear = {f: sums + other.linear[f] for f, sums in self.linear.items()}
        quadratic = {pair: sums + other.quadratic[pair] for pair, sums in self.quadratic.items()}
        return replace(self, linear=linear, quadratic=quadratic, squares=self.squares + other.squares)

    def expectation(self, noise: GyroNoise, estimator: int, *, fourth_order: bool = True) -> NoiseExpectation:
        """Return what noise adds to an estimator's expected sums; see :func:`noise_expectation`."""
        omega = sum((size * self.omega[f] for f, size in noise.parts.items()), np.zeros((3, 3)))
        alpha = sum((size * self.alpha[f][estimator] for f, size in noise.parts.items()), np.zeros((3, 3)))
        return noise_expectation(omega, alpha, fourth_order=fourth_order)

    def covariance(self, noise: GyroNoise) -> Float[np.ndarray, "products products"]:
        """Return the covariance of the sums of ``algebra.products`` under noise of omega."""
        algebra, axes, total = self.algebra, range(3), self.linear_covariance(noise)
        used = [pair for pair in product(axes, repeat=2) if algebra.by_quadratic[pair].any()]
        # Isserlis (1918, doi:10.1093/biomet/12.1-2.134): Cov(e_i e_j, e_k e_m) = C_ik C_jm + C_im C_jk. Sums over the
        # samples are done before, for unit noise; here come the covariances of the axes, so that any size of noise is
        # a matrix product
        for (f, cov_f), (g, cov_g) in product(noise.parts.items(), repeat=2):
            plain, exchanged = self.quadratic[f, g]
            for (i, j), (k, m) in product(used, repeat=2):
                matrix = cov_f[i, k] * cov_g[j, m] * plain + cov_f[i, m] * cov_g[j, k] * exchanged
                if matrix.any():
                    total += algebra.by_quadratic[i, j] @ matrix @ algebra.by_quadratic[k, m].T
        # what Isserlis lacks where white noise is not normal: Cov(e, e²) = κ₃, and κ₄ in Var(e²) = 2σ⁴ + κ₄
        for axis in axes:
            third, fourth = noise.third_cumulant[axis], noise.fourth_cumulant[axis]
            if third or fourth:
                by_linear, by_square = algebra.by_linear[axis], self.by_square[axis]
                linear_sums, square_sums = np.split(self.squares, [by_linear.shape[1]], axis=1)
                crossed = third * by_square @ linear_sums @ by_linear.T
                total += crossed + crossed.T + fourth * by_square @ square_sums @ by_square.T
        return total

    def linear_covariance(self, noise: GyroNoise) -> Float[np.ndarray, "products products"]:
        """Return the covariance that the terms linear in the noise alone would give."""
        by_linear = self.algebra.by_linear
        total = np.zeros((len(self.algebra.products),) * 2)
        for filter_, size in noise.parts.items():
            for i, j in zip(*np.nonzero(size), strict=True):
                total += size[i, j] * (by_linear[i] @ self.linear[filter_] @ by_linear[j].T)
        return total


def run_moments(
    signals: Float[np.ndarray, "signals n"],
    valid: Float[np.ndarray, " n"],
    taps: Sequence[Float[np.ndarray, " _"]],
    filters: Sequence[NoiseFilter] = (WHITE,),
    *,
    margin: int = 0,
) -> RunMoments:
    """Sum over the samples of a run, or of a part of it.

    Args:
        signals: noise-free omega, every estimator's alpha, force and moment.
        valid: 1 for samples that count, else 0; none of those within the longest differentiator's reach of the ends.
        taps: every estimator's differentiator.
        filters: of the gyro's noise; of a part's, white alone.
        margin: samples at either end that are not summed, since other parts do; twice the longest differentiator's
            reach then.
    """
    algebra, n = noise_algebra(len(taps)), len(valid)
    responses = [np.concatenate([-h[::-1], [0.0], h]) for h in map(np.asarray, taps)]
    covariances, reach = {f: f.autocovariance(n) for f in filters}, max(map(len, responses)) - 1
    longest = max(map(len, covariances.values())) + 2 * reach  # so that kernels of two filters can be multiplied
    kernels = {f: _kernels(covariance, responses, longest) for f, covariance in covariances.items()}
    in_steps = not margin and all(f == WHITE for f in filters)
    size, halo = PIECE if in_steps else n - 2 * margin, reach
    filled = halo - margin + (2 * margin - n) % size  # up to a whole number of steps
    rows = np.pad(np.concatenate([valid[None], signals * valid]), ((0, 0), (halo - margin, filled)))
    count, layout = len(algebra.linear), _squares_layout(algebra)
    white = np.zeros((count + len(layout),) * 2)
    linear = {f: np.zeros((count, count)) for f in filters}
    size_of_quadratic = (2, *(len(algebra.quadratic),) * 2)
    quadratic = {(f, g): np.zeros(size_of_quadratic) for f in filters for g in filters}
    inner = slice(halo, halo + size)
    for start in range(0, n - 2 * margin, size):
        piece = rows[:, start : start + size + 2 * halo]
        values = _monomials(piece, [*algebra.linear, *algebra.quadratic])
        terms = _terms(algebra, values, responses, inner)
        # Σ_t J_t e_t = Σ_s c_s w_s with white w: the covariance is σ² Σ_s c_s c_sᵀ, a Gram matrix of the coefficients
        white += terms @ terms.T
        for f in linear.keys() - {WHITE}:
            filtered = filtered_backwards(terms[:count, :n], f)
            linear[f] += filtered @ filtered.T
        for f, g in quadratic:
            quadratic[f, g] += _quadratic_sums(algebra, values, kernels[f], kernels[g], inner)
    if WHITE in linear:
        linear[WHITE] = white[:count, :count]
    by_square = np.stack([algebra.by_quadratic[axis, axis][:, layout] for axis in range(3)])
    at_once = {f: [k[c, c][longest // 2] for c in range(1 + len(taps))] for f, k in kernels.items()}
    omega = {f: float(variances[0]) for f, variances in at_once.items()}
    alpha = {f: np.array(variances[1:]) for f, variances in at_once.items()}
    return RunMoments(
        algebra=algebra, linear=linear, quadratic=quadratic, squares=white[count:], by_square=by_square, alpha=alpha,
        omega=omega,
    )  # fmt: skip


def _kernels(
    autocovariance: Float[np.ndarray, " lags"], responses: Sequence[np.ndarray], length: int
) -> dict[tuple[int, int], Float[np.ndarray, " more_lags"]]:
    """Return the cross-covariance of the noises of each two channels, the second later by a lag; over centred lags."""
    kernels = {}
    for (c, first), (d, second) in product(enumerate([np.ones(1), *responses]), repeat=2):
        # cross-covariance of two filters' outputs: one response with the other's reversed, and with the input's
        # autocovariance
        kernel = np.convolve(np.convolve(first, second[::-1]), autocovariance)
        kernels[c, d] = np.pad(kernel, (length - len(kernel)) // 2)
    return kernels


def _monomials(piece: Float[np.ndarray, "rows wide"], wanted: Sequence[tuple]) -> dict[tuple, np.ndarray]:
    """Return products of signals; rows are what is valid, then the signals, zero where they do not count."""
    products = {(): piece[0]}
    for monomial in sorted({monomial for monomial, *_ in wanted if monomial}, key=len):
        *before, last = monomial
        known = products.get(tuple(before))
        shorter = np.prod(piece[1 + np.array(before)], axis=0) if known is None else known
        products[monomial] = shorter * piece[1 + last]
    return products


def _terms(
    algebra: NoiseAlgebra, values: Mapping[tuple, np.ndarray], responses: Sequence[np.ndarray], inner: slice
) -> Float[np.ndarray, "terms n"]:
    """Return the coefficients of each sample's noise of omega, monomial by monomial, then those of its square."""
    groups: dict[tuple[int, int], list[int]] = {}
    squares = [algebra.quadratic[k][:2] for k in _squares_layout(algebra)]
    factors = [*((*term, 1) for term in algebra.linear), *((*term, 2) for term in squares)]
    terms = np.empty((len(factors), inner.stop - inner.start))
    for k, (monomial, channel, power) in enumerate(factors):
        if channel:
            groups.setdefault((channel, power), []).append(k)
        else:
            terms[k] = values[monomial][inner]
    for (channel, power), places in groups.items():
        rows = np.stack([values[factors[k][0]] for k in places])
        terms[places] = _convolved(rows, responses[channel - 1] ** power, inner)
    return terms


def _convolved(rows: np.ndarray, kernel: np.ndarray, inner: slice) -> np.ndarray:
    """Return rows convolved with a centred kernel, at the inner samples."""
    half, lags = len(kernel) // 2, np.flatnonzero(kernel)
    if len(lags) > FEW:
        size = scipy.fft.next_fast_len(rows.shape[1] + len(kernel), real=True)
        # convolution theorem, padded so that the ends do not reach round
        convolution = fft.irfft(fft.rfft(rows, size) * fft.rfft(kernel, size), size)
        return convolution[:, inner.start + half : inner.stop + half]
    total = np.zeros((len(rows), inner.stop - inner.start))
    for lag in lags:
        shift = lag - half
        total += kernel[lag] * rows[:, inner.start - shift : inner.stop - shift]
    return total


def filtered_backwards(terms: Float[np.ndarray, "rows n"], filter_: NoiseFilter) -> Float[np.ndarray, "rows n"]:
    """Return ``Lᵀ J``: the coefficients, sample by sample, of the white noise that drives the filter.

    ``Σ_t J_t Σ_s l_(t-s) w_s = Σ_s w_s Σ_t l_(t-s) J_t``: a correlation, hence the conjugate spectrum; padded to twice
    the length, so that the run's end does not reach round to its start.
    """
    n = terms.shape[1]
    size = scipy.fft.next_fast_len(2 * n, real=True)
    spectrum = np.conj(fft.rfft(filter_.response(n), size))
    return np.stack([fft.irfft(fft.rfft(row, size) * spectrum, size)[:n] for row in terms])


def _quadratic_sums(
    algebra: NoiseAlgebra, values: Mapping[tuple, np.ndarray], first: Mapping, second: Mapping, inner: slice
) -> Float[np.ndarray, "2 quadratic quadratic"]:
    """Return the sums of pairs of monomials with the product of a kernel of the first noise and one of the second.

    By Isserlis, ``Cov(a b, c d) = E[a c] E[b d] + E[a d] E[b c]`` for normal noises: the plain pairing, then the
    exchanged one. They are kept apart, since the axes of the noises' covariance, which come in later, pair differently.
    """
    groups: dict[tuple[int, int], list[int]] = {}
    for k, (_, c, d) in enumerate(algebra.quadratic):
        groups.setdefault((c, d), []).append(k)
    rows = {group: np.stack([values[algebra.quadratic[k][0]] for k in members]) for group, members in groups.items()}
    sums, one_noise = np.zeros((2, *(len(algebra.quadratic),) * 2)), first is second
    pairs = combinations_with_replacement(groups.items(), 2) if one_noise else product(groups.items(), repeat=2)
    for ((c, d), members), ((e, f), others) in pairs:
        block = _lagged_sums(rows[c, d], rows[e, f], first[c, e] * second[d, f], inner)
        symmetric = one_noise and (c == d or e == f)
        exchanged = block if symmetric else _lagged_sums(rows[c, d], rows[e, f], first[c, f] * second[d, e], inner)
        sums[:, np.array(members)[:, None], others] = block, exchanged
        if one_noise:  # both are symmetric
            sums[:, np.array(others)[:, None], members] = block.T, exchanged.T
    return sums


def _lagged_sums(
    first_rows: Float[np.ndarray, "rows wide"],
    second_rows: Float[np.ndarray, "columns wide"],
    kernel: np.ndarray,
    inner: slice,
) -> Float[np.ndarray, "rows columns"]:
    """Return the sums of pairs of rows, one at an inner sample, with a centred kernel of the samples between them."""
    if len(second_rows) > len(first_rows):  # the shorter side is convolved
        return _convolved(first_rows, kernel, inner) @ second_rows[:, inner].T
    return first_rows[:, inner] @ _convolved(second_rows, kernel[::-1], inner).T


def _squares_layout(algebra: NoiseAlgebra) -> list[int]:
    """Return the quadratic terms that hold squares of one sample's noise: those of one channel twice."""
    return [k for k, (_, c, d) in enumerate(algebra.quadratic) if c == d]
