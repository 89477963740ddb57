"""Angular velocity from recorded attitudes: a smoothing fit on the unit quaternions, and the noise it leaves.

Over a short window the four components of the quaternion are fitted by polynomials (Savitzky–Golay); with the fit's
value q and slope q̇ at its middle, ``omega = 2 vec(q* q̇) / |q|²`` in the body frame.
"""

import numpy as np
from jaxtyping import Float

from identify.signals.differentiate import ORDER, fit_at_middle, highest_band, matched, savitzky_golay
from identify.signals.power_spectrum import motion_band, welch
from identify.signals.run import RunError

TOLERANCE = 1e-3
"""Departure of a quaternion's norm from 1 that counts as rounding."""


CHORD = 0.06
"""Seconds over which an attitude's turn tells its speed: an eighth of a period of 2 Hz."""
NEGLIGIBLE = 1e-3
"""Part of the second derivative's power above the highest band that a differentiator has, which it may lose."""


def differentiator(
    signal: Float[np.ndarray, "n k"], rate: float, name: str, *, band: float | None = None, by_turning: float = 0.0
) -> np.ndarray:
    """Return the taps of the smoothing differentiator that is matched to the band of uniform samples.

    Args:
        signal: attitudes or angles.
        rate: sample rate [Hz].
        name: what messages call it.
        band: highest frequency of the motion [Hz], where it is known; None: as the signal shows.
        by_turning: frequency by which the signal's band is above the motion's [Hz] (:func:`band_by_turning`).

    Raises:
        RunError: too few samples, or the rate is too low for the motion.
    """
    if len(signal) < 64:
        raise RunError(f"{len(signal)} samples of {name}: give 64 or more, to be differentiated")
    highest = highest_band(rate)
    signal_band = motion_band(signal, rate) if band is None else band + by_turning
    if band is None and signal_band > highest and _slow(signal, rate, highest):
        signal_band = highest
    try:
        taps = matched(rate, signal_band)
    except ValueError:
        most = _rounded_down(highest - by_turning)
        cure = f", or declare a band of the estimator, here at most {most:.2g} Hz" if most > 0 else ""
        raise RunError(
            f"{name} has {rate:.4g} Hz, too slow for its motion of {band or signal_band:.3g} Hz: record faster, or "
            f"move slower{cure}"
        ) from None
    longest = (len(signal) - 1) // 8
    return taps if len(taps) <= longest else savitzky_golay(rate, 2 * longest + 1)


def _slow(signal: Float[np.ndarray, "n k"], rate: float, highest: float) -> bool:
    """Whether hardly any of the second derivative's power lies above a frequency [Hz], where the signal stands out."""
    frequency, power = welch(signal, rate, max(len(signal) // 4, 8), window="blackmanharris")
    floor = np.median(power[frequency > rate / 8], axis=0)
    curve = frequency**4 * np.where(power > 100 * floor, power, 0.0).sum(axis=1)  # as motion_band sees it
    return bool(curve[frequency > highest].sum() < NEGLIGIBLE * curve.sum())


def _rounded_down(value: float) -> float:
    """A number with two digits that is not above it; 0 for none that is positive."""
    if value <= 0:
        return 0.0
    digit = 10.0 ** (np.floor(np.log10(value)) - 1)
    return float(digit * np.floor(value / digit * (1 + 1e-12)))


def band_by_turning(quaternion: Float[np.ndarray, "n 4"], rate: float) -> float:
    """Return by how much the quaternion's components reach above the motion's band [Hz].

    A body that turns at W rad/s moves them at W / 4π Hz, about which its motion modulates them. W is that over
    ``CHORD``, so that noise hardly adds to it.
    """
    step = max(round(CHORD * rate), 1)
    chord = np.linalg.norm(quaternion[step:] - quaternion[:-step], axis=1).max(initial=0.0)
    return float(2 * chord * rate / step / (4 * np.pi))


def continuous(quaternion: Float[np.ndarray, "n 4"], name: str) -> Float[np.ndarray, "n 4"]:
    """Return unit quaternions (x, y, z, w) without jumps of sign.

    Raises:
        RunError: one is not of unit length.
    """
    norm = np.linalg.norm(quaternion, axis=1)
    bad = ~(np.abs(norm - 1) <= TOLERANCE)
    if bad.any():
        k = int(np.argmax(bad))
        raise RunError(f"the quaternion of {name} at sample {k} has the norm {norm[k]:.6g}: its norm must be 1")
    unit = quaternion / norm[:, None]
    steps = np.sign(np.einsum("ni,ni->n", unit[1:], unit[:-1]))
    signs = np.concatenate([[1.0], np.cumprod(np.where(steps == 0, 1.0, steps))])
    return unit * signs[:, None]


def angular_velocity(
    quaternion: Float[np.ndarray, "n 4"], taps: Float[np.ndarray, " h"]
) -> tuple[Float[np.ndarray, "m 3"], Float[np.ndarray, "3"]]:
    """Return the angular velocity in the body frame [rad/s], and the white noise of the attitude on its axes [rad].

    Args:
        quaternion: from the body frame to a frame at rest, (x, y, z, w), uniform samples without jumps of sign.
        taps: of the differentiator [1/s]; as many samples at either end have no derivative, m = n - 2h.
    """
    half = len(taps)
    slope_taps = np.concatenate([-taps[::-1], [0.0], taps])
    value, slope = (
        np.stack([np.convolve(component, kernel[::-1], "valid") for component in quaternion.T], axis=1)
        for kernel in (fit_at_middle(half, ORDER), slope_taps)
    )
    omega = 2 * _vector(value, slope) / (value**2).sum(axis=1, keepdims=True)
    inner = quaternion[2:-2]
    fourth = 2 * _vector(inner, np.diff(quaternion, 4, axis=0))
    return omega, np.sqrt(np.mean(fourth**2, axis=0) / 70)


def _vector(q: np.ndarray, p: np.ndarray) -> np.ndarray:
    """The vector part of ``q* p``."""
    return q[:, 3:] * p[:, :3] - p[:, 3:] * q[:, :3] - np.cross(q[:, :3], p[:, :3])
