"""The largest mean square of a signal of limited band whose value and integral are bounded.

Let x have band B and ``|x| ≤ a``, and let its integral keep within ±v. By Bernstein's inequality in Szegő's form
``x'² + (2πB)² x² ≤ (2πB a)²``, so ``x = a sin θ`` with ``|θ'| ≤ Ω = 2πB``. Between two zeros x keeps its sign, so
``∫|x| ≤ 2v``. Take such an excursion of peak ``a s``, ``s = sin θm``, and any ``κ < s²``. With ``p = (s² - κ)/s`` the
function ``g(y) = y² - κ - p y`` is convex, negative at 0 and zero at s, so it is not positive in between. Since θ must
rise to θm and fall again, at most at the rate Ω,

    ∫(x²/a² - κ) dt = ∫ g(|x|/a) dt + p ∫ |x|/a dt ≤ (2/Ω) ∫₀^θm g(sin θ) dθ + 2 p v/a

So the mean square is at most ``a²`` times the largest κ for which some θm makes the right side zero: that of the
fastest rise, a hold at the peak that fills the area, and the fastest fall.
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
