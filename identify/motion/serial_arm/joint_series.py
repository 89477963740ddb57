"""Motions of an arm's joints, from rest to rest: Fourier series between two ramps, or in stages, one after another."""

from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from identify.motion.trajectory import Scalar, swell
from identify.pytree import Pytree

Joints = Float[Array, "t n"] | Float[np.ndarray, "t n"]


class JointStates(NamedTuple):
    """Joints at several instants, instants first; SI units: rad or m."""

    position: Joints
    speed: Joints
    acceleration: Joints


class JointSeries(Pytree):
    """Each joint's departure from home is a sum of sines, each times the window of its stage.

    ``q(t) = home + Σ_k w_k(t) (c_k cos 2πf_k t' + s_k sin 2πf_k t')``, t' from the start of the sine's stage. A sine of
    frequency zero is a constant departure. Every window is flat at both ends with all derivatives.
    """

    home: Float[Array | np.ndarray, " n"]
    """Joint positions at which the motion starts and ends [rad or m]."""
    frequency: Float[Array | np.ndarray, " k"]
    """Frequencies f_k of the sines [Hz]."""
    cosine: Float[Array | np.ndarray, "n k"]
    """Amplitudes c_k of the cosines of each joint [rad or m]."""
    sine: Float[Array | np.ndarray, "n k"]
    """Amplitudes s_k of the sines of each joint [rad or m]."""
    start: Float[Array | np.ndarray, " k"]
    """Instants at which the stage of each sine starts [s]."""
    end: Float[Array | np.ndarray, " k"]
    """Instants at which the stage of each sine ends [s]."""
    ramp: Scalar
    """Time to start and to stop each stage [s]."""

    @property
    def duration(self) -> float:
        """Instant at which the last stage ends [s]."""
        return float(np.max(self.end))

    def basis(self, t: Float[Array, ""]) -> Float[Array, "2 k"]:
        """Return cosines and sines at ``t``, each times its window."""
        since, remaining = t - jnp.asarray(self.start), jnp.asarray(self.end) - t
        window = jax.vmap(lambda a, b: swell(a / self.ramp) * swell(b / self.ramp))(since, remaining)
        angle = 2 * jnp.pi * jnp.asarray(self.frequency) * since
        return window[None] * jnp.stack([jnp.cos(angle), jnp.sin(angle)])

    def states(self, t: Float[Array | np.ndarray, " t"]) -> JointStates:
        """Return the joints' positions, speeds and accelerations at instants [s]."""
        return combined(bases(self, jnp.asarray(t)), jnp.asarray(self.home), self.amplitudes)

    def sampled(self, t: Float[np.ndarray, " t"]) -> JointStates:
        """Return :meth:`states` in NumPy."""
        return JointStates(*map(np.asarray, self.states(t)))

    @property
    def amplitudes(self) -> Float[Array, "2 n k"]:
        """The amplitudes of cosines and sines."""
        return jnp.stack([jnp.asarray(self.cosine), jnp.asarray(self.sine)])


@jax.jit
def bases(series: JointSeries, t: Float[Array, " t"]) -> Float[Array, "3 t 2 k"]:
    """Return the basis of a series and its first and second derivative at instants: the joints are linear in it."""

    def of_instant(at: Array) -> Array:
        first: Any = lambda now: jax.jvp(series.basis, (now,), (jnp.ones_like(now),))  # noqa: E731
        (value, slope), (_, curvature) = jax.jvp(first, (at,), (jnp.ones_like(at),))
        return jnp.stack([value, slope, curvature])

    return jax.vmap(of_instant, out_axes=1)(t)


def combined(
    basis: Float[Array, "3 t 2 k"], home: Float[Array, " n"], amplitudes: Float[Array, "2 n k"]
) -> JointStates:
    """Return the joints' states from a basis at its instants and the amplitudes of cosines and sines."""
    position, speed, acceleration = jnp.einsum("dtck,cnk->dtn", basis, amplitudes)
    return JointStates(position + home[None], speed, acceleration)
