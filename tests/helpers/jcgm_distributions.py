"""Distributions of JCGM 101, 6.4, that no source has: what whoever propagates a model of their own may add."""

from typing import ClassVar

import jax
import jax.numpy as jnp
import numpy as np

from uq.sources.distributions import Bounded, Distribution, Value


class CurvilinearTrapezoid(Bounded):
    """Rectangular between limits that are themselves known within ± ``limit_half_width`` (6.4.3)."""

    uniforms: ClassVar[int] = 2
    limit_half_width: Value
    degrees_of_freedom: Value = np.inf

    @property
    def standard_deviation(self):
        return np.sqrt((self.high - self.low) ** 2 / 12 + self.limit_half_width**2 / 9)

    @property
    def excess_kurtosis(self):
        """With a half-width rectangular in w ± d: ``(w⁴ + 2 w² d² + d⁴/5)/5`` over σ⁴, less 3."""
        w, d = (self.high - self.low) / 2, self.limit_half_width
        return (w**4 + 2 * w**2 * d**2 + d**4 / 5) / 5 / self.standard_deviation**4 - 3

    def _transformed(self, uniform):
        limits, inside = uniform
        half = (self.high - self.low) / 2 + self.limit_half_width * (1 - 2 * limits)
        return self.mean + half * (2 * inside - 1)


class MultivariateNormal(Distribution):
    """Jointly normal values (6.4.8)."""

    mean: Value
    covariance: Value
    degrees_of_freedom: Value = np.inf

    @property
    def standard_deviation(self):
        return jnp.sqrt(jnp.diag(jnp.asarray(self.covariance)))

    def at(self, point, shape=()):
        strength, axes = jnp.linalg.eigh(jnp.asarray(self.covariance))
        root = axes * jnp.sqrt(jnp.maximum(strength, 0))[None]
        standard = jax.scipy.special.ndtri(point.reshape(shape))
        return jnp.broadcast_to(jnp.asarray(self.mean), shape) + standard @ root.T
