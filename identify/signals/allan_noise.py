"""Noise of a channel at rest: white noise, flicker, random walk, spectral lines, drift, quantisation step.

The two-sided spectrum is ``N² + B² / (2π f) + K² / (2π f)²`` (IEEE Std 952-1997, annex C), fitted to the periodogram by
the likelihood of Whittle (doi:10.1007/BF02590998). The periodogram has a Hann window, whose leakage falls faster than
any of these spectra; of its frequencies every second counts, between which it leaves a correlation of 1/36.
"""

from functools import cache
from typing import NamedTuple

import numpy as np
import scipy
from jaxtyping import Float

from identify.signals.power_spectrum import WINDOWS
from identify.signals.segments import runs_of_true

PARAMETERS = ("white", "flicker", "random_walk")
"""N, B and K of the spectrum, in the unit of the signal times s^½, 1 and s^-½."""
FIRST = 3
"""First frequency that counts, in units of 1/T: below, the straight line that is taken off changes the spectrum."""
PER_OCTAVE = 8
"""Groups of frequencies an octave, over which the periodogram is averaged."""
HIGHEST = 0.9
"""Part of half the rate up to which the spectrum is fitted."""
CORRELATED = 1 + 2 / 36
"""Variance of a mean of every second frequency over that of as many independent ones."""
LEAST_GROUPS = 24
"""Groups that a fit needs: three octaves."""
CONVOLVED = 64
"""Frequencies whose expected periodogram is summed; above, leakage changes it by less than 1e-3."""
FALSE_LINE = 1e-3
"""Chance that one of all frequencies of a channel passes for a line by noise alone."""
LINE_GROUP = 32
"""Frequencies of a group, at least, whose median shows a line among them."""
MISFIT = 1.5
"""Deviance a degree of freedom above which the fit ends at half the frequency: there a sensor's filter falls off.

Measured: exceeded by chance in 3 of 600 channels (``python -m tests.helpers.noise_study``).
"""
LIKELY, ONE_SIDED = 3.841, 2.706
"""Twice the drop of the logarithm of the likelihood at the ends of an interval of 95 %, and at an upper limit of 95 %
(chi-squared of one degree)."""
FLICKER_SLOPE = 2.8648
"""Variance of the slope of a straight line through flicker noise of B = 1, times T²: the integral of its spectrum times
the transform of the estimate."""


class NoiseLine(NamedTuple):
    """A spectral line."""

    frequency: float
    """Frequency of the line [Hz]."""
    amplitude: float
    """Amplitude of the sine, in the signal's unit."""
    standard_uncertainty: float
    """Standard uncertainty of ``amplitude``."""


class AllanNoise(NamedTuple):
    """Noise of one channel at rest."""

    values: Float[np.ndarray, "3"]
    """White noise N, flicker B and random walk K, in the unit of the signal times s^½, 1 and s^-½."""
    interval95: Float[np.ndarray, "3 2"]
    """Interval of 95 % of each; from 0 to an upper limit of 95 % where the data do not show it."""
    drift: float
    """Slope of the straight line through the samples, in the signal's unit per second."""
    drift_uncertainty: float
    """Standard uncertainty of ``drift``, by this noise."""
    step: float
    """Step of the quantisation, in the signal's unit; 0: none is seen. Its noise is part of N."""
    lines: tuple[NoiseLine, ...]
    band: tuple[float, float]
    """Frequencies between which the spectrum was fitted [Hz]."""
    misfit: float
    """Deviance a degree of freedom; above ``MISFIT`` the spectrum has another shape, and the intervals are wider by its
    root."""

    def allan_deviation(self, tau: Float[np.ndarray, " m"]) -> Float[np.ndarray, " m"]:
        """Return the Allan deviation of this noise at averaging times [s] (IEEE Std 952-1997, annex C)."""
        white, flicker, walk = self.values**2
        return np.sqrt(white / tau + 2 * np.log(2) / np.pi * flicker + walk * tau / 3)


def allan_deviation(signal: Float[np.ndarray, " n"], rate: float) -> tuple[np.ndarray, np.ndarray]:
    """Return averaging times [s] and the overlapping Allan deviation of a signal at each.

    Args:
        signal: samples.
        rate: sample rate [Hz].
    """
    n = len(signal)
    sums = np.concatenate([[0.0], np.cumsum(signal - signal.mean())])
    counts = np.unique(np.geomspace(1, n // 4, 60).round().astype(int))
    means = [(sums[m:] - sums[:-m]) / m for m in counts]
    variances = [np.mean(np.square(mean[m:] - mean[:-m])) / 2 for m, mean in zip(counts, means, strict=True)]
    return counts / rate, np.sqrt(variances)


def quantisation_step(signal: Float[np.ndarray, " n"]) -> float:
    """Return the step of which all differences between samples are multiples; 0 where there is none."""
    levels = np.unique(signal)
    if len(levels) < 2 or len(levels) > len(signal) / 4:
        return 0.0
    steps = np.diff(levels)
    steps = steps[steps > 1e-3 * np.median(steps)]  # the same level twice, by the rounding of a conversion
    multiples = steps / steps.min()
    return float(steps.min()) if np.all(np.abs(multiples - multiples.round()) < 0.02) else 0.0


def allan_noise(signal: Float[np.ndarray, " n"], rate: float) -> AllanNoise:
    """Return the noise of a channel at rest.

    Args:
        signal: samples at equal intervals.
        rate: sample rate [Hz].

    Raises:
        ValueError: too few samples, or a signal that does not vary.
    """
    if np.ptp(signal) == 0:
        raise ValueError("it does not vary: its step hides its noise, or it is not connected")
    n = len(signal)
    too_few = ValueError(f"{n} samples do not show its noise: record for longer")
    if n < LEAST_GROUPS:
        raise too_few
    time = (np.arange(n) - (n - 1) / 2) / rate
    drift = float(time @ (signal - signal.mean()) / (time @ time))
    spectrum = _Spectrum(signal - signal.mean() - drift * time, rate)
    groups = {limit: spectrum.groups(limit) for limit in HIGHEST * rate / 2 ** np.arange(1, 20)}
    fits = (_Fit(*means, limit) for limit, means in groups.items() if len(means[0]) >= LEAST_GROUPS)
    widest = next(fits, None)
    if widest is None:
        raise too_few
    fit = widest if widest.misfit <= MISFIT else next((fit for fit in fits if fit.misfit <= MISFIT), widest)
    squares, intervals = fit.squares, fit.intervals()
    seconds = n / rate
    # the middle of the intervals: what is not seen at all may still make the slope
    slope = intervals.mean(axis=1) @ [12 / seconds**3, FLICKER_SLOPE / seconds**2, 6 / (5 * seconds)]
    return AllanNoise(
        values=np.sqrt(squares), interval95=np.sqrt(intervals), drift=drift, drift_uncertainty=float(np.sqrt(slope)),
        step=quantisation_step(signal), lines=spectrum.lines(), band=(FIRST / seconds, fit.limit),
        misfit=fit.misfit,
    )  # fmt: skip


class _Spectrum:
    """Periodogram of a channel, one-sided, and the shapes that N², B² and K² have in it."""

    def __init__(self, signal: np.ndarray, rate: float) -> None:
        n = len(signal)
        constant, cosine = WINDOWS["hann"]
        window = constant - cosine * np.cos(2 * np.pi * np.arange(n) / n)
        transform = scipy.fft.rfft(signal * window)[FIRST : (n + 1) // 2]
        self.width = rate / n
        power = 2 * np.abs(transform) ** 2 / (rate * (window**2).sum())
        self.power = np.maximum(power, 1e-30 * power.max())  # a periodic signal has zeros, whose logarithm is infinite
        numbers = np.arange(FIRST, FIRST + len(self.power))
        self.frequency = self.width * numbers
        turn = 2 * rate * np.sin(np.pi * self.frequency / rate)  # 2π f of a sampled sum
        self.shapes = 2 / turn[:, None] ** np.arange(3)
        few = min(len(numbers), CONVOLVED)
        self.shapes[:few] *= _leakage()[:few]
        self.place = np.floor(PER_OCTAVE * np.log2(numbers / FIRST) + 1e-9).astype(int)
        self.level = self._level()
        above = self.power > np.log(len(self.power) / FALSE_LINE) * self.level
        self.masked = np.convolve(above & (self.frequency <= HIGHEST * rate / 2), np.ones(5), "same") > 0

    def _level(self) -> np.ndarray:
        """Power without lines, by the median of each group; infinite where a group has too few frequencies to tell."""
        level = np.full(len(self.power), np.inf)
        starts = np.flatnonzero(np.diff(self.place, prepend=-1))
        for start, stop in zip(starts, [*starts[1:], len(self.power)], strict=True):
            if stop - start >= LINE_GROUP:
                level[start:stop] = np.median(self.power[start:stop]) / np.log(2)
        return level

    def groups(self, limit: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Mean power, mean shapes and count of the frequencies of each group below a limit [Hz]."""
        counts = ~self.masked & (self.frequency <= limit) & (np.arange(len(self.power)) % 2 == 0)
        place = self.place[counts]
        starts = np.flatnonzero(np.diff(place, prepend=-1))
        count = np.diff([*starts, len(place)])
        means = [np.add.reduceat(values[counts], starts, axis=0) for values in (self.power, self.shapes)]
        return means[0] / count, means[1] / count[:, None], count

    def lines(self) -> tuple[NoiseLine, ...]:
        """Spectral lines, the largest first."""
        lines = []
        for start, stop in runs_of_true(self.masked):
            part = slice(start, stop)
            level = self.level[part].min()  # of neighbours in a group without one: infinite
            excess = np.maximum(self.power[part] - level, 0)
            lines.append(
                NoiseLine(
                    frequency=float(self.frequency[part] @ excess / excess.sum()),
                    amplitude=float(np.sqrt(2 * self.width * excess.sum())),
                    # of a sine in noise of this density, under a Hann window (1.5 bins)
                    standard_uncertainty=float(np.sqrt(1.5 * self.width * level)),
                )
            )
        return tuple(sorted(lines, key=lambda line: -line.amplitude))


@cache
def _leakage() -> np.ndarray:
    """Expected periodogram of spectra that fall with the powers 0, 1, 2 of the frequency, over these, (CONVOLVED, 3).

    Under a Hann window, whose transform is ``sinc(x) / (1 - x²)`` at x bins from its frequency.
    """
    bins = (np.arange(-160 * 64, 160 * 64) + 0.5) / 64
    ratios = np.ones((CONVOLVED, 3))
    for place, number in enumerate(range(FIRST, FIRST + CONVOLVED)):
        offset = bins - number
        kernel = (np.sinc(offset) / (1 - offset**2)) ** 2
        powers = np.abs(bins / number)[:, None] ** -np.arange(3.0)
        ratios[place] = kernel @ powers / kernel.sum()
    return ratios


class _Fit:
    """Fit of N², B² and K² to the means of the periodogram, each of Gamma distribution."""

    def __init__(self, power: np.ndarray, shapes: np.ndarray, count: np.ndarray, limit: float) -> None:
        self.power, self.shapes, self.weight, self.limit = power, shapes, count / CORRELATED, limit
        self.squares = self._most_likely(np.arange(3))
        self.least = self._deviance(shapes @ self.squares)
        self.misfit = self.least / (len(power) - np.count_nonzero(self.squares))

    def _deviance(self, model: np.ndarray) -> float:
        ratio = self.power / model
        return float(2 * self.weight @ (ratio - 1 - np.log(ratio)))

    def _most_likely(self, free: np.ndarray, rest: np.ndarray | float = 0.0) -> np.ndarray:
        """Squares of the free parameters, zero or above, with a known ``rest`` of the model: Fisher's scoring."""
        from scipy.optimize import nnls

        shapes = self.shapes[:, free]
        squares, deviance, scale = np.zeros(len(free)), np.inf, self.power
        for _ in range(50):
            weight = np.sqrt(self.weight) / scale
            columns = shapes * weight[:, None]
            norms = np.linalg.norm(columns, axis=0)
            target = nnls(columns / norms, (self.power - rest) * weight)[0] / norms
            step = 1.0
            while step > 1e-3:
                trial = squares + step * (target - squares)
                reached = self._deviance(np.maximum(shapes @ trial + rest, 1e-12 * self.power))
                if reached <= deviance:
                    break
                step /= 2
            else:
                break
            gain, squares, deviance = deviance - reached, trial, reached
            scale = np.maximum(shapes @ squares + rest, 1e-12 * self.power)
            if gain < 1e-6:
                break
        return squares

    def intervals(self) -> np.ndarray:
        """Interval of 95 % of each square by the ratio of likelihoods, wider where the model does not fit, (3, 2)."""
        from scipy.optimize import brentq

        wider = self.misfit if self.misfit > MISFIT else 1.0

        def excess(square: float, number: int, likely: float) -> float:
            rest = square * self.shapes[:, number]
            free = np.delete(np.arange(3), number)
            others = self._most_likely(free, rest)
            return self._deviance(rest + self.shapes[:, free] @ others) - self.least - likely * wider

        ends = np.zeros((3, 2))
        for number, square in enumerate(self.squares):
            seen = square > 0 and excess(1e-9 * square, number, LIKELY) > 0
            asked = number, LIKELY if seen else ONE_SIDED
            high = max(square, float(np.min(self.power / self.shapes[:, number])) / 100)
            while excess(high, *asked) < 0:
                high *= 2
            ends[number, 1] = brentq(excess, square, high, asked, rtol=1e-3)
            if seen:
                ends[number, 0] = brentq(excess, 1e-9 * square, square, asked, rtol=1e-3)
        return ends
