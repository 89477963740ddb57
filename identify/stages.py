"""A motion in stages: each repeats a period of its own for its share of the run, in closed form over one period."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from identify.periodic import Moved, Periodic, moved
from identify.platform import Platform
from identify.trajectory import Multisine


class Stages(eqx.Module):
    """Stages of one period and fixed shares of the run, whose unknowns are their motions', one after the other."""

    periodic: Periodic
    share: Float[np.ndarray, " s"]
    """Part of the run that each stage takes, together one."""

    @property
    def count(self) -> int:
        """How many stages there are."""
        return len(self.share)

    @property
    def unknowns(self) -> int:
        """How many numbers describe a motion."""
        return self.count * self.periodic.unknowns

    @property
    def weights(self) -> Float[Array, " n"]:
        """Part of the run that each instant of :meth:`moved` stands for."""
        n = len(self.periodic.t)
        return jnp.asarray(np.repeat(self.share / n, n))

    def moved(
        self,
        platform: Platform,
        unknowns: Float[Array, " u"],
        r_cg_from_omb: Float[Array, "3"],
        gravity: Float[Array, ""],
    ) -> Moved:
        """Return what platform and body do over one period of each stage, one after the other.

        Args:
            platform: for its home.
            unknowns: of the motion.
            r_cg_from_omb: centre of gravity from the platform's centre, in B [m].
            gravity: local gravity [m/s²].
        """
        one = lambda motion: moved(platform, self.periodic, motion, r_cg_from_omb, gravity)  # noqa: E731
        found = jax.vmap(one)(unknowns.reshape(self.count, -1))
        in_front = lambda x: x.reshape(-1, *x.shape[2:])  # noqa: E731
        behind = lambda x: jnp.moveaxis(x, 0, -2).reshape(*x.shape[1:-1], -1)  # noqa: E731
        t = (found.body.t + self.periodic.period * jnp.arange(float(self.count))[:, None]).ravel()
        body = found.body._replace(
            t=t, omega=behind(found.body.omega), alpha=behind(found.body.alpha),
            rotation=in_front(found.body.rotation), specific_force_cg=behind(found.body.specific_force_cg),
        )  # fmt: skip
        return Moved(jax.tree.map(in_front, found.platform), body, behind(found.jerk))

    def borders(self, duration: float) -> Float[np.ndarray, " b"]:
        """Return when each stage starts, and when the last one ends [s]: the run divided by their shares.

        The inner ones are whole periods, so that stages of any length see the same phases.
        """
        inner = duration * np.cumsum(self.share)[:-1]
        return np.array([0.0, *(np.round(inner / self.periodic.period) * self.periodic.period), duration])

    def multisine(
        self, unknowns: Float[np.ndarray, " u"], duration: float, ramp: float, *, short: bool = False
    ) -> Multisine:
        """Return the trajectory that runs the stages one after the other.

        Args:
            unknowns: of the motion.
            duration: of the run [s].
            ramp: time to start and to stop each stage [s].
            short: leave out whole periods of each stage: the same ramps, two periods at full size between them, and
                so the same peaks, in a shorter run.
        """
        borders, period = self.borders(duration), self.periodic.period
        if short:
            spare = np.maximum(0.0, np.floor((np.diff(borders) - 2 * ramp) / period - 2))
            borders = borders - period * np.concatenate([[0.0], np.cumsum(spare)])
        motions = jnp.asarray(unknowns).reshape(self.count, -1)
        cosine, sine = np.concatenate([np.asarray(self.periodic.amplitudes(one)) for one in motions], axis=2)
        start = None if self.count == 1 else np.repeat(borders[:-1], len(self.periodic.frequency))
        return Multisine(
            np.tile(self.periodic.frequency, self.count), cosine, sine, np.array(borders[-1]), np.array(ramp), start
        )
