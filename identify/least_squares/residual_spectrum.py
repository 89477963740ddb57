"""Correlation of errors across axes and in time: their spectrum, from the cosine transform of residuals.

The cosine transform (DCT-II, orthonormal) of each segment without a gap turns n samples into n lines at the frequencies
``j rate / 2n``. It is orthogonal, so the regression stays the same regression; and the lines of a stationary error are
nearly uncorrelated, also of one that drifts, since the transform knows no jump from a segment's end to its beginning
(Ahmed, Natarajan and Rao 1974, doi:10.1109/T-C.1974.223784). What is left is a covariance across the axes at each line,
``S``, that varies slowly along frequency: an average of the residuals' products over neighbouring lines, divided by
the degrees of freedom that the fit left there. Errors of one axis that follow those of another with a delay are taken
as if there were none. For figures, residuals and motion are kept thinned (:class:`Trace`).
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple, Protocol, runtime_checkable

import numpy as np
import scipy
from jaxtyping import Float, Int

from identify.signals.power_spectrum import welch

LEAST_LINES = 8
"""Lines on either side of one over which a spectrum is averaged, at least."""
SLOPE_LINES = 64
"""Lines, the first ones, that tell how the spectrum falls."""
LEAST_GAIN = 1e-4
"""Least power gain of a filter that counts: below it, a signal cannot be distinguished from leakage."""
OPEN = 0.1
"""Power gain of a filter down to which lines tell how the spectrum falls: beyond, they hold what leaked from others."""
SLOPES = np.linspace(-2, 1, 61)
"""Powers of the frequency that a spectrum may follow: of drift, white noise, vibration above the motion."""
TOGETHER = 2**18
"""Samples of several signals that are transformed at once, in a third of the time of one signal after another."""
BLOCK = 2**15
"""Lines whose rows of the regression are made at a time: what bounds the memory of a long run."""


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
        return transformed[0] if len(transformed) == 1 else np.concatenate(transformed)[self.order]

    def transform_rows(self, signals: Float[np.ndarray, "k n"]) -> None:
        """Put the cosine transform of the samples in each row in their place."""
        together = max(TOGETHER // signals.shape[1], 1)
        for start in range(0, len(signals), together):
            rows = signals[start : start + together]
            rows[:] = self.transform(rows.T).T

    def samples(self, transformed: Float[np.ndarray, "k *p"]) -> Float[np.ndarray, "n *p"]:
        """Return the samples of the first k lines, the others zero: the inverse of :meth:`transform`."""
        samples = np.zeros((len(self.order), *transformed.shape[1:]))
        if len(self.segments) == 1:  # in the order of frequency as they are
            samples[: len(transformed)] = transformed
            return np.asarray(scipy.fft.idct(samples, axis=0, norm="ortho", overwrite_x=True))
        samples[self.order[: len(transformed)]] = transformed
        start = 0
        for segment in self.segments:
            part = slice(start, start := start + segment.stop - segment.start)
            samples[part] = scipy.fft.idct(samples[part], axis=0, norm="ortho")
        return samples


@runtime_checkable
class LineRows(Protocol):
    """Rows of the regression on lines of the cosine transform: an array (k, 3, p), or what gives slices of one."""

    def __len__(self) -> int: ...

    def __getitem__(self, part: slice, /) -> Float[np.ndarray, "k rows p"]: ...


def blocks(count: int) -> Iterator[slice]:
    """Yield slices of a bounded size that cover so many lines."""
    return (slice(start, min(start + BLOCK, count)) for start in range(0, count, BLOCK))


@dataclass(frozen=True, eq=False)
class Spectrum:
    """Covariance of the errors across the axes at each line, an average over a window of lines."""

    residuals: Float[np.ndarray, "m rows"]
    """Residuals, the spectrum's shape divided out."""
    shape: Float[np.ndarray, "m rows"]
    """Root of the spectrum's shape on each axis: a filter's gain, and a power of the frequency."""
    constants: int
    """Number of lines, the first ones, that are those of constants."""
    free: Float[np.ndarray, "m rows"]
    """Degrees of freedom that the fit left at each line and axis."""
    wider: int
    """Factor by which the windows are widened."""

    def windows(self, lines: slice) -> tuple[Int[np.ndarray, " k"], Int[np.ndarray, " k"]]:
        """Return the first line in the window of each of some lines, and the one behind its last."""
        m = len(self.shape)
        begin = min(self.constants, m - 1)
        position = np.arange(*lines.indices(m))
        half = _half_window(position, self.wider)
        return np.clip(position - half, begin, m - 1), np.clip(position + half + 1, begin + 1, m)

    def freedom(self, lines: slice) -> Float[np.ndarray, "k rows"]:
        """Return the degrees of freedom in the windows of some lines; 1 or more."""
        return np.maximum(np.stack([_sums(free, *self.windows(lines)) for free in self.free.T], axis=1), 1.0)

    def at(self, lines: slice) -> Float[np.ndarray, "k rows rows"]:
        """Return the covariance ``S`` across the axes at some lines [(N·m)²]; white noise of covariance C has S = C."""
        first, last = self.windows(lines)
        size = self.free.shape[1]
        root = np.sqrt(self.freedom(lines))
        values = np.empty((len(first), size, size))
        start, constants = lines.indices(len(self.shape))[0], min(self.constants, len(self.shape) - 1)
        apart, reached = max(constants - start, 0), slice(int(first.min()), int(last.max()))
        for a, b in _pairs(size):
            products = self.residuals[reached, a] * self.residuals[reached, b]
            value = _sums(products, first - reached.start, last - reached.start) / (root[:, a] * root[:, b])
            value[:apart] += np.prod(self.residuals[start : start + apart, [a, b]], axis=1)[: len(value)]
            values[:, a, b] = values[:, b, a] = value
        floor = 1e-12 * np.trace(values, axis1=1, axis2=2)[:, None, None] * np.eye(size)
        return (values + floor) * self.shape[lines, :, None] * self.shape[lines, None, :]

    @property
    def values(self) -> Float[np.ndarray, "m rows rows"]:
        """Covariance at all lines, of few lines."""
        return self.at(slice(0, len(self.shape)))

    def scores(self, rows: LineRows) -> Float[np.ndarray, "p p"]:
        """Return the covariance of ``Σ rowsᵀ u`` over the first lines, for errors ``u`` of this spectrum."""
        terms = ((rows[part], self.at(part)) for part in blocks(len(rows)))
        return np.sum([np.tensordot(x, covariance @ x, axes=((0, 1), (0, 1))) for x, covariance in terms], axis=0)

    def degrees_of_freedom(
        self, rows: LineRows, gain: Float[np.ndarray, "p k"], scores: Float[np.ndarray, "p p"]
    ) -> Float[np.ndarray, " k"]:
        """Return the effective degrees of freedom of the variances of ``gainᵀ Σ rowsᵀ u`` over the first lines.

        Each variance is a sum of squares of the residuals; Satterthwaite's formula (GUM G.4) on its terms.

        Args:
            rows: of the lines.
            gain: combinations of the sums.
            scores: covariance of the sums, :meth:`scores`.
        """
        inside = self._inside(rows, gain, ((scores @ gain) * gain).sum(axis=0))
        first, last = self.windows(slice(0, inside))
        reach = int(last.max())
        begun, ended = (np.searchsorted(ends, np.arange(reach), "right") for ends in (first, last))
        c = np.concatenate([self._root_of(rows[part] @ gain, part) for part in blocks(inside)])
        return np.array([self._freedom_of(column, begun, ended) for column in np.moveaxis(c, 2, 0)])

    def _inside(self, rows: LineRows, gain: Float[np.ndarray, "p k"], totals: Float[np.ndarray, " k"]) -> int:
        """Number of the first lines that hold all but a thousandth of each variance, whose totals are given."""
        before, inside = np.zeros(len(totals)), 1
        for part in blocks(len(rows)):
            combinations = rows[part] @ gain
            variances = np.einsum("map,map->pm", combinations, self.at(part) @ combinations)
            sums = before[:, None] + np.cumsum(variances, axis=1)
            reached = (sums < 0.999 * totals[:, None]).sum(axis=1)
            inside, before = max(inside, part.start + int(reached.max())), sums[:, -1]
            if (before >= 0.999 * totals).all():
                break
        return inside

    def _freedom_of(self, c: Float[np.ndarray, "m rows"], begun: np.ndarray, ended: np.ndarray) -> float:
        """Effective degrees of freedom of one combination of the first lines' errors, :meth:`_root_of` of it."""
        root = np.sqrt(self.free[: len(begun)])
        mean = squares = 0.0
        for a, b in _pairs(c.shape[1]):
            before = np.concatenate([[0.0], np.cumsum(c[:, a] * c[:, b])])
            taken = (before[begun] - before[ended]) * root[:, a] * root[:, b]
            mean += taken.sum() if a == b else 0.0
            squares += (1.0 if a == b else 2.0) * (taken @ taken)
        return max(mean**2 / max(squares, 1e-300), 1.0)

    def _root_of(self, combinations: Float[np.ndarray, "m rows k"], part: slice) -> Float[np.ndarray, "m rows k"]:
        """Combinations times the root of the spectrum, for one degree of freedom a window."""
        count = np.maximum(self.freedom(part).mean(axis=1), 1.0)
        return _root(self.at(part)) @ combinations / np.sqrt(count)[:, None, None]


def _pairs(size: int) -> list[tuple[int, int]]:
    """Return the pairs of axes of a symmetric matrix."""
    return [(a, b) for a in range(size) for b in range(a, size)]


def _half_window(position: Int[np.ndarray, " k"], wider: int) -> Int[np.ndarray, " k"]:
    """Return the number of lines to either side of a line over which its spectrum is averaged."""
    return wider * np.maximum(np.ceil(2 * position**0.6), LEAST_LINES).astype(int)


def reach(inside: int, count: int, wider: int) -> int:
    """Return how many of ``count`` lines, the first ones, the spectrum at the first ``inside`` of them is made from."""
    return min(max(inside + int(_half_window(np.array([inside - 1]), wider)[0]), SLOPE_LINES + inside), count)


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
    ``2 j^0.6`` lines to either side, ``LEAST_LINES`` at least; a known filter's gain and each axis's fitted power of
    the frequency are divided out first. Lines of constants stand apart from their neighbours, and are never
    smaller than their own residual.

    Args:
        residuals: of the lines, in the order of frequency [N·m].
        free: degrees of freedom left at each, 1 minus its leverage.
        constants: how many lines, the first ones, are those of constants.
        gain: power gain of a known filter that errors have passed, at each line.
        wider: by how much to widen the windows.
    """
    passed = np.broadcast_to(np.maximum(gain, LEAST_GAIN), len(residuals))
    shape = np.ones(residuals.shape)
    shape[constants:] = _colour(residuals[constants:], free[constants:], passed[constants:])
    shape *= passed[:, None]
    np.sqrt(shape, out=shape)
    return Spectrum(residuals=residuals / shape, shape=shape, constants=constants, free=free, wider=wider)


def _sums(
    values: Float[np.ndarray, " m"], first: Int[np.ndarray, " k"], last: Int[np.ndarray, " k"]
) -> Float[np.ndarray, " k"]:
    """Return the sums of values from each of some places to the one before another."""
    start, stop = int(first.min()), int(last.max())
    before = np.zeros(stop - start + 1)
    np.cumsum(values[start:stop], out=before[1:])
    return before[last - start] - before[first - start]


def leverage(rows: LineRows, inverse: Float[np.ndarray, "p p"]) -> Float[np.ndarray, "m rows"]:
    """Return how much of each value its own fit takes up: the diagonal of ``X (XᵀX)⁻¹ Xᵀ``."""

    def taken(block: np.ndarray) -> np.ndarray:
        weighed = (block.reshape(-1, block.shape[2]) @ inverse).reshape(block.shape)
        return np.clip(np.einsum("map,map->ma", weighed, block), 0, 1)

    every = np.empty((len(rows), rows[:1].shape[1]))
    for part in blocks(len(rows)):
        every[part] = taken(rows[part])
    return every


def _colour(
    residuals: Float[np.ndarray, "m rows"], free: Float[np.ndarray, "m rows"], gain: Float[np.ndarray, " m"]
) -> Float[np.ndarray, "m rows"]:
    """Return each axis's power of the frequency, the mean of :data:`SLOPES` by Whittle's likelihood of the first lines.

    The mean needs no test of whether there is a slope, which few lines cannot decide. Each axis has its own: where only
    some drift, one for all would lay their slope on the others.
    """
    number = np.arange(1, len(residuals) + 1)
    usable = (number <= SLOPE_LINES) & (gain >= OPEN)
    if usable.sum() < LEAST_LINES:
        return np.ones(residuals.shape)
    count, power = free[usable], residuals[usable] ** 2 / gain[usable, None]
    shapes = number[usable] ** SLOPES[:, None]
    level = np.log((1 / shapes) @ power + 1e-300)  # the most probable one of each slope
    likelihood = -0.5 * (np.log(shapes) @ count + count.sum(axis=0) * level)
    weight = np.exp(likelihood - likelihood.max(axis=0))
    return np.asarray(number[:, None] ** (SLOPES @ weight / weight.sum(axis=0)))


def _root(matrices: np.ndarray) -> np.ndarray:
    """``Lᵀ`` of each ``L Lᵀ``."""
    unit = np.eye(matrices.shape[1])
    scale = np.trace(matrices, axis1=1, axis2=2)[:, None, None] * unit
    return np.swapaxes(np.linalg.cholesky(matrices + 1e-9 * scale + 1e-300 * unit), 1, 2)


BINS = 300
"""Most segments of time, and most frequencies."""
POINTS = 1500
"""Most samples of the motion."""
STRETCH = 5.0
"""Seconds of a run whose moment is drawn over time."""
SEGMENTS = 8
"""Segments over which a spectrum is averaged, at least."""
LONGEST = 4096
"""Most samples in a segment of a spectrum."""
DRAWN = 2**18
"""Most samples that a spectrum is from: 64 segments are smooth."""


class Stretch(NamedTuple):
    """A short stretch of a run: measured and predicted moment about the centre of gravity, less the offsets."""

    t: Float[np.ndarray, " s"]
    """Instants of the samples, from the run's start [s]."""
    measured: Float[np.ndarray, "s 3"]
    """Moment ``M - r × F`` on each axis [N·m]."""
    predicted: Float[np.ndarray, "s 3"]
    """Moment ``Ω I`` of the estimate [N·m]."""


@dataclass(frozen=True, eq=False)
class Trace:
    """A run's residual moment ``M - r × F - Ω I``, less the offsets that were removed, and the motion behind it."""

    t: Float[np.ndarray, " m"]
    """Middle of each interval of time in which residuals are summarised [s]."""
    low: Float[np.ndarray, "m 3"]
    """Least residual in it, on each axis [N·m]."""
    high: Float[np.ndarray, "m 3"]
    """Largest residual in it [N·m]."""
    frequency: Float[np.ndarray, " k"]
    """Frequencies of the spectra [Hz]."""
    residual_density: Float[np.ndarray, "k 3"]
    """Amplitude density of the residuals on each axis [N·m/Hz^½]."""
    moment_density: Float[np.ndarray, " k"]
    """Amplitude density of the moment about the centre of gravity, root mean square of the axes [N·m/Hz^½]."""
    omega: Float[np.ndarray, "p 3"]
    """Angular velocity in B [rad/s]."""
    alpha: Float[np.ndarray, "p 3"]
    """Angular acceleration in B [rad/s²], at the same instants."""
    stretch: Stretch


def trace(
    t: Float[np.ndarray, " n"],
    residuals: Float[np.ndarray, "n 3"],
    moment: Float[np.ndarray, "w 3"],
    motion: Float[np.ndarray, "p 6"],
) -> Trace:
    """Thin a run's fit for drawing.

    The spectra (Welch) are those of the first samples of the longest segment without a gap, averaged over bands of
    equal ratio.

    Args:
        t: instants of the rows [s], with gaps where samples were left out.
        residuals: measured less fitted moment about the centre of gravity [N·m].
        moment: the measured moment about the centre of gravity at these first samples [N·m].
        motion: angular velocity [rad/s] and acceleration [rad/s²], :func:`thinned`.
    """
    edges = _edges(len(t), BINS)
    low, high = (reach.reduceat(residuals, edges, axis=0) for reach in (np.minimum, np.maximum))
    step, segment = float(np.median(np.diff(t))), longest_segment(t)
    t_shown, residuals_shown = t[segment][: len(moment)], residuals[segment][: len(moment)]
    frequency, densities = _density(residuals_shown, 1 / step)
    _, moment_densities = _density(moment, 1 / step)
    middle = (t[edges] + t[np.append(edges[1:], len(t)) - 1]) / 2
    moment_density = np.sqrt(np.mean(moment_densities**2, axis=1))
    return Trace(
        t=middle, low=low, high=high, frequency=frequency, residual_density=densities, moment_density=moment_density,
        omega=motion[:, :3], alpha=motion[:, 3:],
        stretch=_stretch(t_shown, moment, residuals_shown),
    )  # fmt: skip


def _stretch(t: np.ndarray, moment: np.ndarray, residuals: np.ndarray) -> Stretch:
    """The middle ``STRETCH`` seconds of a segment."""
    middle = (t[0] + t[-1]) / 2
    first, last = np.searchsorted(t, [middle - STRETCH / 2, middle + STRETCH / 2])
    signals = thinned(np.hstack([t[:, None], moment, moment - residuals])[first : last + 1])
    return Stretch(signals[:, 0], signals[:, 1:4], signals[:, 4:])


def thinned(signals: Float[np.ndarray, "n k"]) -> Float[np.ndarray, "p k"]:
    """Return every so many samples, ``POINTS`` at most, of which nothing else is kept."""
    return signals[:: -(-len(signals) // POINTS)].copy()


def _edges(count: int, most: int) -> np.ndarray:
    """Return the start of each of at most so many segments of equal length."""
    return np.unique(np.linspace(0, count, min(count, most) + 1).astype(int)[:-1])


def longest_segment(t: Float[np.ndarray, " n"]) -> slice:
    """Return the longest segment of instants [s] without a gap."""
    cuts = np.concatenate([[0], np.flatnonzero(np.diff(t) > 1.5 * float(np.median(np.diff(t)))) + 1, [len(t)]])
    longest = int(np.argmax(np.diff(cuts)))
    return slice(int(cuts[longest]), int(cuts[longest + 1]))


def _density(signal: np.ndarray, rate: float) -> tuple[np.ndarray, np.ndarray]:
    """Frequencies and amplitude density, thinned to bands of equal ratio."""
    length = min(len(signal), LONGEST, max(len(signal) // SEGMENTS, 64))
    frequency, power = welch(signal, rate, length)
    frequency, power = frequency[1:], power[1:]
    if not len(frequency):
        return frequency, np.sqrt(power)
    band = np.unique(np.searchsorted(frequency, np.geomspace(frequency[0], frequency[-1], BINS) * (1 - 1e-9)))
    counts = np.diff(np.append(band, len(frequency)))
    means = [np.add.reduceat(values, band, axis=0) for values in (frequency, power)]
    return means[0] / counts, np.sqrt(means[1] / counts[:, None])
