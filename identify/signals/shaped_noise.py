"""Noise of an angular velocity that is not white, because it was made by differentiating angles."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from identify.signals.differentiate import gain
from identify.signals.estimator_spec import EstimatorSpec


class ShapedNoise(NamedTuple):
    """Noise of an angular velocity that a differentiator made of white noise in angles."""

    sigma: Float[np.ndarray, "3"]
    """Standard deviation of the white noise on each axis [rad]."""
    taps: Float[np.ndarray, " h"]
    """The differentiator's taps [1/s]."""
    rate: float
    """Sample rate of the differentiator [Hz]."""

    def alpha(self, estimator: EstimatorSpec, rate: float) -> Float[np.ndarray, "3"]:
        """Return the standard deviation of the rows' alpha on each axis [rad/s²], behind the estimator's filters.

        The white spectrum through three gains, summed up to the lower of the two Nyquist frequencies.

        Args:
            estimator: what differentiates the angular velocity once more, and filters.
            rate: the run's sample rate [Hz].
        """
        highest = min(rate, self.rate) / 2
        frequency = (np.arange(20_000) + 0.5) / 20_000 * highest
        gains = self.gain(frequency) * estimator.gain(rate, frequency)
        passed = (2 * np.pi * frequency) ** 2 * gains * estimator.passed(rate, frequency)
        return self.sigma * float(np.sqrt(np.mean(passed**2) * highest / (self.rate / 2)))

    def gain(self, frequency: Float[np.ndarray, " m"]) -> Float[np.ndarray, " m"]:
        """Return the response over jω of the differentiator that made the angular velocity, at frequencies [Hz]."""
        return gain(self.taps, self.rate, frequency)

    def turned(self, rotation: Float[np.ndarray, "3 3"]) -> "ShapedNoise":
        """Return the noise on other axes."""
        return self._replace(sigma=np.sqrt(rotation**2 @ self.sigma**2))
