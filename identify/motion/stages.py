"""A motion in stages: each repeats a period of its own for its share of the run, in closed form over one period."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from identify.motion.multisine import Multisine
from identify.motion.periodic_motion import Moved, Periodic, moved
from identify.motion.stewart_platform import StewartPlatform
from identify.motion.trajectory import swell
from identify.pytree import Pytree

STARTED = 0.3
"""Part of a ramp that is left out, next to rest: there the window is below 0.2."""
FINER = 4
"""Times as many instants of a period at which limits are looked at."""


class Stages(Pytree):
    """Stages of one period, from rest to rest, whose unknowns are their motions', one after the other.

    Of each stage one period and both ramps are looked at: what it does besides is one of these again.
    """

    periodic: Periodic
    border: Float[np.ndarray, " b"]
    """Instants at which the stages start, and the end of the last one [s]."""
    ramp: float
    """Time to start and to stop each stage [s]."""

    @classmethod
    def of(cls, periodic: Periodic, share: Float[np.ndarray, " s"], duration: float, ramp: float) -> "Stages":
        """Divide a run [s] by shares. Stages start after whole periods, so that they see the same phases in any run.

        The ramps are at most a quarter of the shortest one, and whole steps between the instants of a period.
        """
        between = periodic.period / len(periodic.t)
        ramp = max(1, np.floor(min(ramp, duration * np.min(share) / np.sum(share) / 4) / between + 1e-9)) * between
        inner = duration * np.cumsum(share / np.sum(share))[:-1]
        starts = np.round(inner / periodic.period) * periodic.period
        return cls(periodic, np.array([0.0, *starts, duration]), float(ramp))

    @property
    def count(self) -> int:
        """Number of stages."""
        return len(self.border) - 1

    @property
    def between(self) -> float:
        """Time from instant to instant [s]."""
        return self.periodic.period / len(self.periodic.t)

    @property
    def in_ramp(self) -> Float[np.ndarray, " m"]:
        """The instants of a ramp, from rest [s]."""
        within = np.arange(1, round(self.ramp / self.between) + 1) * self.between
        return within[within >= STARTED * self.ramp]

    @property
    def seconds(self) -> Float[np.ndarray, " n"]:
        """Time that each instant of :meth:`moved` stands for [s]."""
        n, ramps = len(self.periodic.t), 2 * len(self.in_ramp)
        full = np.maximum(np.diff(self.border) - 2 * self.ramp, 0.0) / n
        return np.concatenate([np.append(np.full(n, step), np.full(ramps, self.between)) for step in full])

    def moved(
        self,
        platform: StewartPlatform,
        unknowns: Float[Array, " u"],
        r_cg_from_omb: Float[Array, "3"],
        gravity: Float[Array, ""],
    ) -> Moved:
        """Return what platform and body do over one period and both ramps of each stage, one stage after the other.

        Args:
            platform: for its home.
            unknowns: of the motion.
            r_cg_from_omb: centre of gravity from the platform's centre, in B [m].
            gravity: local gravity [m/s²].
        """
        ramp, full = rising(self.in_ramp, self.ramp), len(self.periodic.t)
        falling = ramp[:, ::-1] * jnp.array([1.0, -1.0, 1.0, -1.0])[:, None]
        at_full_size = jnp.zeros((4, full)).at[0].set(1.0)
        window = jnp.concatenate([at_full_size, ramp, falling], axis=1)
        times, coordinates = [], []
        for start, end, values in zip(self.border, self.border[1:], unknowns.reshape(self.count, -1), strict=False):
            t = [start + self.ramp + self.periodic.t, start + self.in_ramp, end - self.in_ramp[::-1]]
            times.append(np.concatenate(t))
            coordinates.append(windowed(window, self.periodic.coordinates(values, times[-1])))
        at = jnp.asarray(np.concatenate(times))
        return moved(platform, at, jnp.concatenate(coordinates, axis=1), r_cg_from_omb, gravity)

    def finer(self, values: Float[Array, "n k"]) -> Float[Array, "m k"]:
        """Return what is known at the instants of :meth:`moved` on a grid finer by ``FINER``, by interpolation.

        What is smooth has its peaks between the instants. Periods are interpolated by their Fourier series, ramps by
        polynomials through six neighbours.
        """
        n, m = len(self.periodic.t), len(self.in_ramp)
        stages = values.reshape(self.count, -1, values.shape[-1])
        kernels = [
            (by_series(n), stages[:, :n]),
            (by_neighbours(m), stages[:, n : n + m]),
            (by_neighbours(m), stages[:, n + m :]),
        ]
        finer = [jnp.einsum("mn,snk->smk", jnp.asarray(kernel), samples) for kernel, samples in kernels]
        return jnp.concatenate(finer, axis=1).reshape(-1, values.shape[-1])

    def multisine(self, unknowns: Float[np.ndarray, " u"], *, short: bool = False) -> Multisine:
        """Return the trajectory that runs the stages one after the other.

        Args:
            unknowns: of the motion.
            short: leave out whole periods of each stage: the same ramps, two periods at full size between them, and
                so the same peaks, in a shorter run.
        """
        border, period = self.border, self.periodic.period
        if short:
            spare = np.maximum(0.0, np.floor((np.diff(border) - 2 * self.ramp) / period - 2))
            border = border - period * np.concatenate([[0.0], np.cumsum(spare)])
        motions = jnp.asarray(unknowns).reshape(self.count, -1)
        cosine, sine = np.concatenate([np.asarray(self.periodic.amplitudes(motion)) for motion in motions], axis=2)
        start = None if self.count == 1 else np.repeat(border[:-1], len(self.periodic.frequency))
        frequency, duration = np.tile(self.periodic.frequency, self.count), np.array(border[-1])
        return Multisine(
            frequency=frequency, cosine=cosine, sine=sine, duration=duration, ramp=np.array(self.ramp), start=start
        )


def rising(t: Float[np.ndarray, " n"], ramp: float) -> Float[Array, "4 n"]:
    """Return the window that rises within a ramp, with its three derivatives."""
    derivatives, function = [], swell
    for order in range(4):
        derivatives.append(jax.vmap(function)(jnp.asarray(t / ramp)) / ramp**order)
        function = jax.grad(function)
    return jnp.stack(derivatives)


def windowed(shape: Float[Array, "4 n"], motion: Float[Array, "4 n c"]) -> Float[Array, "4 n c"]:
    """Return a product and its three derivatives, from those of its factors (Leibniz)."""
    w = shape[:, :, None]
    return jnp.stack(
        [
            w[0] * motion[0],
            w[1] * motion[0] + w[0] * motion[1],
            w[2] * motion[0] + 2 * w[1] * motion[1] + w[0] * motion[2],
            w[3] * motion[0] + 3 * w[2] * motion[1] + 3 * w[1] * motion[2] + w[0] * motion[3],
        ]
    )


def by_series(n: int) -> Float[np.ndarray, "m n"]:
    """Return what takes one period's n values to those on the finer grid, by the Fourier series through them."""
    offset = (np.arange(n * FINER)[:, None] / FINER - np.arange(n)) / n
    turns = offset[..., None] * np.arange(1, (n - 1) // 2 + 1)
    return (1 + 2 * np.cos(2 * np.pi * turns).sum(axis=-1)) / n


def by_neighbours(n: int) -> Float[np.ndarray, "m n"]:
    """Return what takes n values at uniform instants to those on the finer grid between them, by Lagrange's formula."""
    count = min(n, 6)
    at = np.arange((n - 1) * FINER + 1) / FINER
    kernel = np.zeros((len(at), n))
    for row, place in zip(kernel, at, strict=True):
        first = int(np.clip(np.floor(place) - count // 2 + 1, 0, n - count))
        nodes = np.arange(first, first + count)
        apart = place - nodes
        row[nodes] = [np.prod(np.delete(apart, k) / np.delete(nodes[k] - nodes, k)) for k in range(count)]
    return kernel
