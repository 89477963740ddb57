"""Correlation of errors across axes and in time: their spectrum, from the cosine transform of residuals.

The cosine transform (DCT-II, orthonormal) of each segment without a gap turns n samples into n lines at the frequencies
``j rate / 2n``. It is orthogonal, so the regression stays the same regression; and the lines of a stationary error are
nearly uncorrelated, also of one that drifts, since the transform knows no jump from a segment's end to its beginning
(Ahmed, Natarajan and Rao 1974, doi:10.1109/T-C.1974.223784). What is left is a covariance across the axes at each line,
``S``, that varies slowly along frequency: an average of the residuals' products over neighbouring lines, divided by
the degrees of freedom that the fit left there. Errors of one axis that follow those of another with a delay are taken
as if there were none.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import scipy
from jaxtyping import Float

LEAST_LINES = 8
"""Lines on either side of one over which a spectrum is averaged, at least."""
SLOPE_LINES = 64
"""Lines, the first ones, that tell how the spectrum falls."""
LEAST_GAIN = 1e-4
"""Least power gain of a filter that counts: below it, a signal cannot be distinguished from leakage."""


class Lines(NamedTuple):
    """Positions of the lines of a run's segments, in the order of frequency."""

    frequency: Float[np.ndarray, " m"]
    """Frequency of each line [Hz]."""
    constant: Float[np.ndarray, " m"]
    """Cosine transform of a constant 1."""
    order: np.ndarray
    """Permutation from the lines of one segment after another to the order of frequency."""
    segments: tuple[slice, ...]

    @classmethod
    def of(cls, segments: Sequence[slice], rate: float) -> "Lines":
        """Return the lines of segments of samples at a rate [Hz]."""
        sizes = [segment.stop - segment.start for segment in segments]
        frequency = np.concatenate([np.arange(n) * rate / (2 * n) for n in sizes])
        constant = np.concatenate([np.sqrt(n) * (np.arange(n) == 0) for n in sizes])
        order = np.argsort(frequency, kind="stable")
        return cls(frequency[order], constant[order], order, tuple(segments))

    @property
    def constants(self) -> int:
        """Number of lines, the first ones, that are those of constants."""
        return len(self.segments)

    def transform(self, signal: Float[np.ndarray, "n *k"]) -> Float[np.ndarray, "m *k"]:
        """Return the cosine transform of samples, each segment by itself."""
        transformed = [scipy.fft.dct(signal[segment], axis=0, norm="ortho") for segment in self.segments]
        return np.concatenate(transformed)[self.order]

    def samples(self, transformed: Float[np.ndarray, "k *p"]) -> Float[np.ndarray, "n *p"]:
        """Return the samples of the first k lines, the others zero: the inverse of :meth:`transform`."""
        lines = np.zeros((len(self.order), *transformed.shape[1:]))
        lines[self.order[: len(transformed)]] = transformed
        ends = np.cumsum([segment.stop - segment.start for segment in self.segments])[:-1]
        return np.concatenate([scipy.fft.idct(part, axis=0, norm="ortho") for part in np.split(lines, ends)])


class Spectrum(NamedTuple):
    """Covariance of the errors across the axes at each line, and the windows that it was averaged over."""

    values: Float[np.ndarray, "m 3 3"]
    """Covariance ``S`` across the axes at each line [(N·m)²]; white noise of covariance C has S = C."""
    first: np.ndarray
    """Index of the first line in each line's window."""
    last: np.ndarray
    """Index behind the last line in each line's window."""
    free: Float[np.ndarray, "m 3"]
    """Degrees of freedom that the fit left at each line and axis."""

    def scores(self, rows: Float[np.ndarray, "k 3 p"]) -> Float[np.ndarray, "p p"]:
        """Return the covariance of ``Σ rowsᵀ u`` over the first lines, for errors ``u`` of this spectrum."""
        weighed = np.einsum("mab,mbp->map", self.values[: len(rows)], rows)
        return np.tensordot(rows, weighed, axes=((0, 1), (0, 1)))

    def degrees_of_freedom(self, combinations: Float[np.ndarray, "k 3 p"]) -> Float[np.ndarray, " p"]:
        """Return the effective degrees of freedom of the variances of ``Σ cᵀ u`` over the first lines, for each ``c``.

        Each variance is a sum of squares of the residuals; Satterthwaite's formula (GUM G.4) on its terms.
        """
        inside = max(int((self._share(combinations) < 0.999).sum()), 1)
        reach = int(self.last[:inside].max())
        count = np.maximum(_sums(self.free, self.first, self.last)[:inside].mean(axis=1), 1.0)
        c = (
            np.einsum("mab,mbp->pma", _root(self.values[:inside]), combinations[:inside])
            / np.sqrt(count)[None, :, None]
        )
        terms = np.pad(np.einsum("pma,pmb->pmab", c, c), ((0, 0), (1, 0), (0, 0), (0, 0)))
        total = np.cumsum(terms, axis=1)
        begun, ended = (np.searchsorted(ends[:inside], np.arange(reach), "right") for ends in (self.first, self.last))
        root = np.sqrt(self.free[:reach])
        taken = (total[:, begun] - total[:, ended]) * root[:, :, None] * root[:, None, :]
        mean = np.trace(taken, axis1=2, axis2=3).sum(axis=1)
        return np.maximum(mean**2 / np.maximum((taken**2).sum(axis=(1, 2, 3)), 1e-300), 1.0)

    def _share(self, combinations: Float[np.ndarray, "k 3 p"]) -> Float[np.ndarray, " k"]:
        """Up to each line, the part of the variance of the combination that reaches highest."""
        values = self.values[: len(combinations)]
        power = np.cumsum(np.einsum("map,mab,mbp->mp", combinations, values, combinations, optimize=True), axis=0)
        return np.where(power[-1] > 0, power / np.maximum(power[-1], 1e-300), 1.0).min(axis=1)


def spectrum(
    residuals: Float[np.ndarray, "m rows"],
    free: Float[np.ndarray, "m rows"],
    constants: int,
    gain: Float[np.ndarray, " m"] | float = 1.0,
    *,
    wider: int = 1,
) -> Spectrum:
    """Return the errors' spectrum from the transformed residuals of a fit.

    A fit takes most from the residuals where its rows are strong, which in a brief run is where it matters: the
    products in a window are divided by the degrees of freedom left in it, not by its lines. The window of line j is
    ``2 j^0.6`` lines to either side, ``LEAST_LINES`` at least; a known filter's gain and a fitted power of the
    frequency are divided out first. Lines of constants stand apart from their neighbours, and are never
    smaller than their own residual.

    Args:
        residuals: of the lines, in the order of frequency [N·m].
        free: degrees of freedom left at each, 1 minus its leverage.
        constants: how many lines, the first ones, are those of constants.
        gain: power gain of a known filter that errors have passed, at each line.
        wider: by how much to widen the windows.
    """
    m = len(residuals)
    passed = np.broadcast_to(np.maximum(gain, LEAST_GAIN), m)
    shape = passed * _colour(residuals[constants:], free[constants:], passed[constants:], constants)
    position = np.arange(m)
    half = wider * np.maximum(np.ceil(2 * position**0.6), LEAST_LINES).astype(int)
    begin = min(constants, m - 1)
    first = np.clip(position - half, begin, m - 1)
    last = np.clip(position + half + 1, begin + 1, m)
    products = np.einsum("ma,mb->mab", residuals, residuals) / shape[:, None, None]
    total = _sums(products, first, last)
    root_freedom = np.sqrt(np.maximum(_sums(free, first, last), 1.0))
    values = total / (root_freedom[:, :, None] * root_freedom[:, None, :])
    values[:begin] += products[:begin]
    floor = 1e-12 * np.trace(values, axis1=1, axis2=2)[:, None, None] * np.eye(residuals.shape[1])
    return Spectrum((values + floor) * shape[:, None, None], first, last, free)


def leverage(rows: Float[np.ndarray, "m 3 p"], inverse: Float[np.ndarray, "p p"]) -> Float[np.ndarray, "m 3"]:
    """Return how much of each value its own fit takes up: the diagonal of ``X (XᵀX)⁻¹ Xᵀ``."""
    weighed = (rows.reshape(-1, rows.shape[2]) @ inverse).reshape(rows.shape)
    return np.clip(np.einsum("map,map->ma", weighed, rows), 0, 1)


def _colour(residuals: np.ndarray, free: np.ndarray, gain: np.ndarray, constants: int) -> np.ndarray:
    """A power of the frequency, 0 to -2, where the first lines' residuals show one."""
    n = len(residuals)
    number = np.arange(1, min(n, SLOPE_LINES) + 1)
    power = (residuals[: len(number)] ** 2 / np.maximum(free[: len(number)], 0.1)).sum(axis=1) / gain[: len(number)]
    usable = power > 0
    if usable.sum() < LEAST_LINES:
        return np.ones(n + constants)
    (slope, _), spread = np.polyfit(np.log(number[usable]), np.log(power[usable]), 1, cov=True)
    shape = np.arange(1, n + 1) ** np.clip(slope, -2.0, 0.0) if slope < -2 * np.sqrt(spread[0, 0]) else np.ones(n)
    return np.concatenate([np.ones(constants), shape])


def _sums(values: np.ndarray, first: np.ndarray, last: np.ndarray) -> np.ndarray:
    """Sums over each window."""
    total = np.cumsum(np.concatenate([np.zeros_like(values[:1]), values]), axis=0)
    return total[last] - total[first]


def _root(matrices: np.ndarray) -> np.ndarray:
    """``Lᵀ`` of each ``L Lᵀ``."""
    scale = np.trace(matrices, axis1=1, axis2=2)[:, None, None] * np.eye(3)
    return np.swapaxes(np.linalg.cholesky(matrices + 1e-9 * scale + 1e-300 * np.eye(3)), 1, 2)
