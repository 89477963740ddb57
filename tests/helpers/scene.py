"""A recording as rigs make them: the body mounted by hand, three poses, two false starts, the trajectory, a knock."""

import dataclasses

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from identify.motion.trajectory import Sphere, Trajectory, sample, step
from identify.rigid_body.dynamics import acceleration_at, wrench

MOUNTED = 15.0
"""When the hands leave the body [s]."""
POSES = ((18.0, (1.0, 0.0, 0.0)), (24.0, (-1.0, 0.6, 0.0)), (30.0, (0.0, -0.6, 0.5)))
"""When each turn to the next pose begins, and about which axis."""
TURN = 3.0
"""Seconds that a turn takes."""


class Scene(Trajectory):
    """Turns from pose to pose, two starts that are broken off, and the whole trajectory."""

    duration: Array
    sphere: Sphere
    starts: tuple[float, float, float]
    broken: float

    def omega(self, t: Float[Array, ""]) -> Float[Array, "3"]:
        """Return the angular velocity in B at ``t``."""
        turns = sum(
            jnp.asarray(axis) * 0.12 * jnp.sin(jnp.pi * jnp.clip((t - begin) / TURN, 0, 1)) ** 2
            for begin, axis in POSES
        )
        first, second, whole = (self.sphere.omega(t - start) for start in self.starts)
        cut = lambda start: 1 - step((t - start - self.broken) / 0.3)  # noqa: E731
        return turns + first * cut(self.starts[0]) + second * cut(self.starts[1]) + whole


@dataclasses.dataclass
class Recorded:
    """Signals of a scene, samples first, and where its trajectory lies."""

    t: np.ndarray
    force: np.ndarray
    moment: np.ndarray
    omega: np.ndarray
    specific_force: np.ndarray
    """At Q."""
    start: float
    stop: float


@jax.jit
def _signals(scene, body, gravity, t):
    """Force, moment, angular velocity and specific force at Q, samples first."""
    motion = sample(scene, t, r_cg_from_still=jnp.zeros(3), gravity=gravity)
    true = jax.vmap(wrench, in_axes=(None, 1, 1, 1))(body, motion.omega, motion.alpha, motion.specific_force_cg)
    lever = jax.vmap(acceleration_at, in_axes=(None, 1, 1))(-body.r_cg_from_q, motion.omega, motion.alpha)
    return true.force, true.moment, motion.omega.T, motion.specific_force_cg.T + lever


def record(experiment, rng, *, noise: float = 1.0, name: str = "T1") -> Recorded:
    """Record a scene around a trajectory, with the experiment's white noise (times ``noise``) and the gyro's bias."""
    spec = experiment.trajectories[name]
    sphere, duration, rate = spec.trajectory, spec.duration, spec.rate
    broken = float(sphere.ramp) + 0.08 * duration
    first = POSES[-1][0] + TURN + 5
    second = first + broken + 4
    whole = second + broken + 4
    t = jnp.asarray(np.arange(round((whole + duration + 8) * rate)) / rate)
    scene = Scene(jnp.asarray(whole + duration), sphere, (first, second, whole), broken)
    signals = [np.array(signal) for signal in _signals(scene, experiment.body, experiment.gravity, t)]
    times = np.asarray(t)
    _mount(times, *signals, rng)
    _knock(times - whole - duration - 3, *signals)
    sigma = {s.name: s.sigma for s in experiment.sources}
    signals[0] += noise * sigma["F_precision"] * rng.standard_normal(signals[0].shape)
    signals[1] += noise * sigma["M_precision"] * rng.standard_normal(signals[1].shape)
    signals[2] += noise * (sigma["omega_precision"] * rng.standard_normal(signals[2].shape) + [5e-3, -4e-3, 3e-3])
    signals[3] += noise * 0.02 * rng.standard_normal(signals[3].shape)
    return Recorded(times, *signals, whole, whole + duration)


def _mount(t, force, moment, omega, specific_force, rng):
    """Hands set the body down and turn it about, pull and push; until then the cell bears a part of its weight."""
    share = np.clip((t - 4) / (MOUNTED - 6), 0, 1)[:, None]
    hands = ((t > 2) & (t < MOUNTED))[:, None] * np.sin(np.pi * np.clip((t - 2) / (MOUNTED - 2), 0, 1))[:, None]

    def wobble(size):
        return size * sum(
            np.sin(2 * np.pi * np.multiply.outer(t, rng.uniform(0.3, 2.0, 3)) + rng.uniform(0, 6, 3)) for _ in range(4)
        )

    force *= share
    moment *= share
    force += hands * wobble(15.0)
    moment += hands * wobble(2.0)
    omega += hands * wobble(0.4)
    specific_force += hands * wobble(1.0)


def _knock(since, force, moment, omega, specific_force):
    """A blow of 10 ms, and what rings after it."""
    rings = (since > 0) * np.exp(-np.clip(since, 0, None) / 0.15)
    ring = (rings * np.sin(2 * np.pi * 25 * since))[:, None]
    blow = ((since > 0) & (since < 0.01))[:, None]
    force += 60 * ring + 300 * blow * [1, 0, 0.5]
    moment += 6 * ring
    omega += ring * [0.2, 0.3, 0.1] + blow * [0.5, 0.2, 0]
    specific_force += 10 * ring
