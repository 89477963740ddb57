"""Windows that start and stop a motion: smooth steps, flat at both ends with all derivatives."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

Scalar = Float[Array, ""] | Float[np.ndarray, ""] | float


def step(u: Scalar) -> Float[Array, ""]:
    """Return the smooth step from 0 (u ≤ 0) to 1 (u ≥ 1), ``1 / (1 + exp(1/u - 1/(1-u)))``, flat at both ends."""
    inside = (u > 0) & (u < 1)
    safe = jnp.where(inside, u, 0.5)
    exponent = jnp.clip(1 / (1 - safe) - 1 / safe, -80.0, 80.0)
    return jnp.where(inside, jax.nn.sigmoid(exponent), jnp.where(u >= 1, 1.0, 0.0))


def window(t: Scalar, duration: Scalar, ramp: Scalar) -> Float[Array, ""]:
    """Return the window ``s(t) s(D - t)`` that starts and stops a motion within ``ramp`` [s] at either end."""
    return step(t / ramp) * step((duration - t) / ramp)


def swell(u: Scalar) -> Float[Array, ""]:
    """Return another smooth step, ``sin(π/2 step(u))``: fast where it is small, slow where it is near one.

    An oscillation of angular frequency Ω times a window w asks for an acceleration of ``√(w² + (2w'/Ω)²)`` of its own,
    which for ``w = sin Ωt/2`` is one all the time.
    """
    return jnp.sin(jnp.pi / 2 * step(u))
