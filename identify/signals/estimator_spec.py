"""The choice of differentiator and filter by which a run's signals become rows of the regression."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from identify.rigid_body.regressor import ArrayT
from identify.signals.differentiate import central_difference, derivative, gain, matched, savitzky_golay
from identify.signals.filters import gaussian, response


@dataclass(frozen=True)
class EstimatorSpec:
    """An ordinary least-squares estimator (10): what it does to omega and to both sides of the regression."""

    name: str
    differentiator: Literal["central", "savitzky-golay"]
    band: float | None = None
    """Highest frequency of the motion [Hz], which a smoothing differentiator is matched to."""
    window: int | None = None
    """Points of the smoothing differentiator; None: the longest whose gain holds over the band."""
    lowpass: float | None = None
    """Cut-off [Hz] of the Gaussian filter that both sides of the regression pass through; None: no filter."""

    def __post_init__(self) -> None:
        """Refuse what cannot be, with a ValueError."""
        if self.differentiator not in ("central", "savitzky-golay"):
            raise ValueError(
                f"Argument `differentiator` must be central or savitzky-golay, but is {self.differentiator}."
            )
        for name in ("band", "window", "lowpass"):
            value = getattr(self, name)
            if isinstance(value, str):
                raise TypeError(f"Argument `{name}` must be a number, of hertz or of points, but is {value!r}.")
            if value is not None and not 0 < value < 1e9:
                raise ValueError(f"Argument `{name}` must be above zero, but is {value}.")

    def taps(self, rate: float) -> np.ndarray:
        """Return the differentiator's taps [1/s] at a sample rate [Hz].

        Raises:
            ValueError: neither band nor window, a window that cannot be, or a rate too low for the band.
        """
        if self.differentiator == "central":
            return central_difference(rate)
        if self.window is not None:
            return savitzky_golay(rate, self.window)
        if self.band is None:
            raise ValueError(f"estimator '{self.name}' has neither band nor window: give the motion's band")
        return matched(rate, self.band)

    def reach(self, rate: float) -> int:
        """Return how many samples at either end of a run have no derivative, at a sample rate [Hz]."""
        return len(self.taps(rate))

    def derivative(self, omega: Float[ArrayT, "n 3"], rate: float) -> Float[ArrayT, "m 3"]:
        """Return the angular acceleration [rad/s²] by this differentiator, of JAX's arrays or of NumPy's.

        Row k belongs to sample ``k + reach(rate)``: m = n - 2 reach(rate). It has the precision of ``omega``.

        Args:
            omega: angular velocity at uniform instants [rad/s].
            rate: sample rate [Hz].

        Raises:
            ValueError: too few samples, or a rate too low for the band.
        """
        return derivative(omega.T, self.taps(rate).astype(omega.dtype)).T

    def filter_taps(self, rate: float) -> np.ndarray:
        """Return the taps of the filter on both sides at a sample rate [Hz]; one tap of 1 is no filter."""
        return np.ones(1) if self.lowpass is None else gaussian(rate, self.lowpass)

    def gain(self, rate: float, frequency: np.ndarray) -> np.ndarray:
        """Return the differentiator's response over jω at each frequency [Hz], at a sample rate [Hz]."""
        return gain(self.taps(rate), rate, frequency)

    def passed(self, rate: float, frequency: np.ndarray) -> np.ndarray:
        """Return the gain of the filter on both sides at each frequency [Hz], at a sample rate [Hz]."""
        return response(self.filter_taps(rate), rate, frequency)

    def lost(self, rate: float) -> int:
        """Return how many samples of a run, both ends together, give no row."""
        return 2 * len(self.taps(rate)) + len(self.filter_taps(rate)) - 1

    def alpha_noise_gain(self, rate: float) -> float:
        """Return the standard deviation of the rows' alpha per standard deviation of white noise in omega [1/s]."""
        half = self.taps(rate)
        return float(np.linalg.norm(np.convolve(np.concatenate([-half[::-1], [0.0], half]), self.filter_taps(rate))))
