"""A motion of many frequencies, in stages from rest to rest: rotation and translation of the platform."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from identify.motion.trajectory import Scalar, Trajectory, swell
from identify.rigid_body.rotation import rate_of_turn


class Multisine(Trajectory):
    """A multi-frequency motion, rotation and translation: sums of sines and cosines, each times its stage's window.

    Its rotation vector is ``φ(t) = Σ_k w_k(t) (c_k cos 2πf_k t + s_k sin 2πf_k t)``, the attitude ``R_AB = exp(φ)``;
    the displacement of the platform's centre has the same form. Sines that start together are a stage, which ends at
    rest, at home, when the next one starts.
    """

    frequency: Float[Array | np.ndarray, " k"]
    """Frequencies f_k of the sines [Hz]."""
    cosine: Float[Array | np.ndarray, "6 k"]
    """Amplitudes c_k of the cosines: displacement [m] along the axes of A, then rotation vector [rad]."""
    sine: Float[Array | np.ndarray, "6 k"]
    """Amplitudes s_k, in the same order."""
    duration: Scalar
    """Duration of the motion [s]."""
    ramp: Scalar
    """Time to start and to stop each stage [s]."""
    start: Float[Array | np.ndarray, " k"] | None = None
    """Instants at which the stage of each sine starts [s]; None: a single stage from 0."""

    def coordinates(self, t: Float[Array, ""]) -> Float[Array, "6"]:
        """Return displacement [m] and rotation vector [rad] at ``t``."""
        angle = 2 * jnp.pi * jnp.asarray(self.frequency) * t
        if self.start is None:
            shape = jnp.asarray(self.cosine) @ jnp.cos(angle) + jnp.asarray(self.sine) @ jnp.sin(angle)
            return self.window(t, self.duration) * shape
        windows = jax.vmap(lambda start, end: self.window(t - start, end - start))(self.start, self.end)
        cosine, sine = windows * jnp.cos(angle), windows * jnp.sin(angle)
        return jnp.asarray(self.cosine) @ cosine + jnp.asarray(self.sine) @ sine

    def window(self, t: Scalar, duration: Scalar) -> Float[Array, ""]:
        """Return the window of a stage at ``t`` from its start, which starts and stops it within a ramp."""
        return swell(t / self.ramp) * swell((duration - t) / self.ramp)

    @property
    def end(self) -> Float[Array, " k"]:
        """Instants at which the stage of each sine ends [s]: with the next one's start, or with the motion."""
        start = jnp.zeros(len(self.frequency)) if self.start is None else jnp.asarray(self.start)
        next_start = jnp.where(start[None] > start[:, None], start[None], jnp.inf).min(axis=1)
        return jnp.minimum(next_start, self.duration)

    @property
    def period(self) -> float:
        """Time within which each stage repeats [s]; infinite where a frequency is no multiple of its lowest one."""
        frequency, longest = np.asarray(self.frequency), 0.0
        start = np.zeros(len(frequency)) if self.start is None else np.asarray(self.start)
        for stage_frequency in (frequency[start == first] for first in np.unique(start)):
            orders = stage_frequency / stage_frequency.min()
            harmonic = np.abs(orders - np.round(orders)).max() < 1e-9
            longest = max(longest, 1 / stage_frequency.min() if harmonic else np.inf)
        return longest

    def scaled(self, size: float, speed: float = 1.0) -> "Multisine":
        """Return the motion with ``size`` times its amplitudes, ``speed`` times as fast, in the same time."""
        return replace(self, frequency=speed * self.frequency, cosine=size * self.cosine, sine=size * self.sine)

    @property
    def highest_frequency(self) -> float:
        """Highest frequency of the sines [Hz]."""
        return float(np.max(self.frequency))

    def lasting(self, duration: float) -> "Multisine":
        """Return the motion of another duration [s], its ramps as they are, the stages in the same proportion."""
        start = None if self.start is None else duration / np.asarray(self.duration) * np.asarray(self.start)
        if start is not None and np.isfinite(self.period):  # ramps then meet the same phases
            start = np.round(start / self.period) * self.period
        return replace(self, duration=np.array(float(duration)), start=start)

    @property
    def shortest(self) -> float:
        """Shortest duration before one of the stages is nothing but two ramps [s]."""
        starts = np.unique(np.zeros(1) if self.start is None else np.asarray(self.start))
        return 2 * float(self.ramp * self.duration / np.diff([*starts, float(self.duration)]).min())

    def displacement(self, t: Float[Array, ""]) -> Float[Array, "3"]:
        """Return the displacement of the platform's centre at ``t``, in A."""
        return self.coordinates(t)[:3]

    def omega(self, t: Float[Array, ""]) -> Float[Array, "3"]:
        """Return the angular velocity in B at ``t``."""
        turn, rate = jax.jvp(self.coordinates, (t,), (jnp.ones_like(t),))
        return rate_of_turn(turn[3:], rate[3:])
