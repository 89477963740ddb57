"""Low-pass filters without phase, for both sides of the regression alike; and the band of a recorded motion."""

import jax
import numpy as np
from jax.scipy.signal import fftconvolve
from jaxtyping import Array, Float
from scipy.signal import welch


def gaussian(rate: float, cutoff: float) -> np.ndarray:
    """Return the taps of a Gaussian low-pass: unit gain at rest, -3 dB at ``cutoff`` [Hz], cut at four σ.

    A Gaussian never rings and is the shortest filter for its bandwidth, so that a short run loses least at its ends.
    """
    sigma = np.sqrt(np.log(2)) / (2 * np.pi * cutoff)
    half = int(np.ceil(4 * sigma * rate))
    taps = np.exp(-0.5 * (np.arange(-half, half + 1) / (sigma * rate)) ** 2)
    return taps / taps.sum()


def response(taps: np.ndarray, rate: float, frequency: np.ndarray) -> np.ndarray:
    """Return the gain of symmetric taps at each frequency [Hz]."""
    lags = (np.arange(len(taps)) - len(taps) // 2) / rate
    return np.cos(2 * np.pi * np.multiply.outer(frequency, lags)) @ taps


def apply(signals: Float[Array, "k n"], taps: Float[Array, " odd"]) -> Float[Array, "k m"]:
    """Filter each row; half the taps are lost at either end, m = n - taps + 1."""
    if signals.shape[1] < taps.shape[0]:
        raise ValueError(f"Argument `signals` must have {taps.shape[0]} samples or more, but has {signals.shape[1]}.")
    one = lambda signal: fftconvolve(signal, taps.astype(signal.dtype), mode="valid")  # noqa: E731
    return jax.vmap(one)(signals)


def motion_band(omega: np.ndarray, rate: float) -> float:
    """Return the highest frequency [Hz] at which a recorded motion stands out from the gyro's noise.

    Welch's spectrum of the angular velocity, shape (n, 3), in eight stretches or more, against its own median above an
    eighth of the rate; a Blackman–Harris window, whose leakage is below the noise of any gyro.
    """
    frequency, power = welch(omega, fs=rate, nperseg=max(len(omega) // 4, 8), axis=0, window="blackmanharris")
    floor = np.median(power[frequency > rate / 8], axis=0)
    stands_out = (power > np.maximum(100 * floor, 1e-9 * power.max())).any(axis=1)
    return float(frequency[stands_out].max(initial=frequency[1]))


def noise_level(omega: np.ndarray) -> np.ndarray:
    """Return the standard deviation of white noise on each axis of samples (n, 3), from their fourth differences."""
    if len(omega) < 6:
        return np.zeros(omega.shape[1])
    return np.sqrt(np.mean(np.diff(omega, 4, axis=0) ** 2, axis=0) / 70)
