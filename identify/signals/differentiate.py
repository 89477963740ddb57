"""Angular acceleration from angular velocity: antisymmetric finite impulse responses and their gain.

A differentiator is its taps ``c``, ``alpha[k] = sum_j c[j] (omega[k+j] - omega[k-j])`` for j = 1 … h, in 1/s. Being
antisymmetric it has no phase error and ignores a constant bias; what it does to the motion is one real gain.
"""

import functools

import numpy as np
from jaxtyping import Float

from identify.rigid_body.regressor import Array, ArrayT
from identify.signals.filters import convolved

ORDER = 4
"""Degree of the polynomials."""
SHORTEST = ORDER // 2
"""Fewest taps of a matched differentiator: half the window of as many points as the polynomial has coefficients."""
LONGEST = 50_000
"""Most taps of a matched differentiator."""
DIRECT = 6
"""Taps up to which their sum takes less time than transforms."""
GAIN_TOLERANCE = 1e-4
"""Largest departure of a matched differentiator's gain from jω over the motion's band."""


def central_difference(rate: float) -> np.ndarray:
    """Return the taps of the paper's central difference at a sample rate [Hz]."""
    return np.array([rate / 2])


def savitzky_golay(rate: float, window: int) -> np.ndarray:
    """Return the taps of the Savitzky–Golay first derivative (doi:10.1021/ac60214a047).

    Args:
        rate: sample rate [Hz].
        window: number of points of the fit, odd, more than the degree.

    Raises:
        ValueError: the window is even or too short for the degree.
    """
    half = window // 2
    if window % 2 == 0 or window <= ORDER:
        raise ValueError(f"Argument `window` must be odd and more than the order {ORDER}, but is {window}.")
    return fit_at_middle(half, ORDER, derivative=1)[half + 1 :] * rate / half


def fit_at_middle(half: int, order: int, *, derivative: int = 0) -> np.ndarray:
    """Return the weights of ``2 half + 1`` samples that make a polynomial fit's value, or derivative, at their middle.

    Time runs from -1 to 1.
    """
    powers = np.polynomial.legendre.legvander(np.arange(-half, half + 1) / half, order)
    at_middle = [np.polynomial.legendre.Legendre.basis(k).deriv(derivative)(0.0) for k in range(order + 1)]
    return np.asarray(np.array(at_middle) @ np.linalg.pinv(powers))


def gain(taps: np.ndarray, rate: float, frequency: np.ndarray) -> np.ndarray:
    """Return the differentiator's response over jω at each frequency [Hz]; 1 where it differentiates exactly."""
    omega = 2 * np.pi * np.asarray(frequency, float)
    lags = np.arange(1, len(taps) + 1) / rate
    return 2 * np.sin(np.multiply.outer(omega, lags)) @ taps / np.where(omega == 0, 1.0, omega) + (omega == 0)


def worst_gain(taps: np.ndarray, rate: float, band: float) -> float:
    """Return the largest ``|gain - 1|`` from (nearly) zero to ``band`` [Hz]."""
    return float(np.max(np.abs(gain(taps, rate, np.linspace(band / 200, band, 200)) - 1)))


def _keeps_gain(rate: float, half: int, band: float) -> bool:
    return worst_gain(savitzky_golay(rate, 2 * half + 1), rate, band) <= GAIN_TOLERANCE


@functools.cache
def matched(rate: float, band: float) -> np.ndarray:
    """Return the longest Savitzky–Golay differentiator that keeps its gain within 1e-4 of jω over the band.

    Args:
        rate: sample rate [Hz].
        band: highest frequency of the motion [Hz].

    Raises:
        ValueError: the rate is too low for any smoothing at this band, or so high that no window is long enough.
    """
    good = SHORTEST  # half windows
    if not _keeps_gain(rate, good, band):
        raise ValueError(
            f"Argument `rate` must be high enough to differentiate a motion of {band:g} Hz within {GAIN_TOLERANCE:g}, "
            f"but is {rate:g} Hz."
        )
    bad = 2 * good
    while _keeps_gain(rate, bad, band):
        good, bad = bad, 2 * bad
        if good > LONGEST:
            raise ValueError(f"Argument `band` must be within a factor of {LONGEST:,} of the rate, but is {band:g} Hz.")
    while bad - good > 1:  # a longer window has always the larger error, up to the first that is too long
        middle = (good + bad) // 2
        good, bad = (middle, bad) if _keeps_gain(rate, middle, band) else (good, middle)
    best = savitzky_golay(rate, 2 * good + 1)
    best.flags.writeable = False  # all callers share it
    return best


def highest_band(rate: float) -> float:
    """Return the highest band [Hz] for which :func:`matched` has a differentiator at a sample rate [Hz]."""
    low, high = 0.0, rate / 2
    for _ in range(20):
        middle = (low + high) / 2
        low, high = (middle, high) if _keeps_gain(rate, SHORTEST, middle) else (low, middle)
    return low


def derivative(signal: Float[ArrayT, "3 n"], taps: Float[Array, " h"]) -> Float[ArrayT, "3 m"]:
    """Apply a differentiator to component-first samples; ``h`` samples at either end have no derivative: m = n - 2h."""
    h = taps.shape[0]
    n = signal.shape[1] - 2 * h
    if n < 1:
        raise ValueError(f"Argument `signal` must have more than {2 * h} samples, but has {signal.shape[1]}.")
    if isinstance(signal, np.ndarray) and h > DIRECT:
        return convolved(signal, np.concatenate([taps[::-1], [0.0], -taps]))
    return sum(
        (taps[j - 1] * (signal[:, h + j : h + j + n] - signal[:, h - j : h - j + n]) for j in range(2, h + 1)),
        start=taps[0] * (signal[:, h + 1 : h + 1 + n] - signal[:, h - 1 : h - 1 + n]),
    )


def padded_derivative(signal: Float[np.ndarray, "3 n"], taps: Float[np.ndarray, " h"]) -> Float[np.ndarray, "3 n"]:
    """Return :func:`derivative` of samples in NumPy, with a zero for each sample that has none."""
    return np.pad(derivative(signal, taps), ((0, 0), (len(taps),) * 2))
