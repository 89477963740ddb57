"""How large the mean square of a signal of limited band can be, when its value and its integral are bounded.

A signal of band B and modulus at most a obeys ``x'² + (2πB x)² ≤ (2πB a)²`` (Bernstein, Szegő), so ``x = a sin θ`` with
``|θ'| ≤ 2πB``: it takes at least 1/(2B) from one bound to the other. If its integral keeps within ±v, no excursion
between two zeros has an area above 2v. Among excursions of peak ``a s`` the mean square is largest for the fastest
rise, a hold at the peak that fills the area, and the fastest fall (docs/explanation/design.md has the proof).
"""

import numpy as np

PEAKS = 4001
"""Peaks between which the largest mean square is sought."""


def largest_mean_square(amplitude: float, integral: float, band: float) -> float:
    """Return what the mean square of a signal cannot exceed: that of the best rise, hold and fall between two zeros.

    Args:
        amplitude: bound a of its modulus.
        integral: bound v of its integral's modulus; infinite: none.
        band: its highest frequency B [Hz].

    Returns:
        The largest mean square, of at most ``amplitude²``.
    """
    if not np.isfinite(integral):
        return amplitude**2
    fast = 2 * np.pi * band
    amplitude = min(amplitude, fast * integral)
    turn = np.linspace(np.pi / 2 / PEAKS, np.pi / 2, PEAKS)
    peak = np.sin(turn)
    hold = np.maximum(2 * integral / amplitude - 2 / fast * (1 - np.cos(turn)), 0.0) / peak
    square = 2 / fast * (turn / 2 - np.sin(2 * turn) / 4) + hold * peak**2
    return float(amplitude**2 * np.max(square / (2 / fast * turn + hold)))


def largest_amplitude(amplitude: float, integral: float, twice: float, band: float) -> float:
    """Return the bound of a signal's modulus that its own and those of its two integrals leave (Bernstein)."""
    fast = 2 * np.pi * band
    return min(amplitude, fast * integral, fast**2 * twice)
