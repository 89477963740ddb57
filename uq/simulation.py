"""A synthetic recorded run: one trial's signals, as the load cell and the IMU would give them."""

import json
from dataclasses import dataclass, field
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from identify.dynamics import acceleration_at, wrench
from identify.inertia import Body
from identify.precision import check_precision
from identify.run import Run
from identify.trajectory import Motion
from rig.bag import write
from rig.channels import ImuChannel, WrenchChannel
from uq.campaign import true_motion
from uq.experiment import Experiment
from uq.sources import BLOCK, Source, draw_bias, draw_block

NANOSECONDS = 1_000_000_000


@dataclass(frozen=True)
class SimulatedRun:
    """What a rig with the experiment's errors would record, and the truth behind it."""

    run: Run
    """Measured force, moment and angular velocity."""
    specific_force: np.ndarray = field(repr=False)
    """True specific force at Q in B [m/s²], (n, 3): an accelerometer without errors."""
    rotation: np.ndarray = field(repr=False)
    """True attitude R_AB, (n, 3, 3)."""
    trajectory: str
    seed: int
    trial: int

    def write(self, path: str | Path, *, overwrite: bool = False) -> None:
        """Write the run as ROS 2 MCAP: ``/wrench`` on the body at Q in B, ``/imu``, metadata ``rig.run``.

        Raises:
            RigError: the file exists.
            OSError: it cannot be written.
        """
        stamp = np.round(self.run.t * NANOSECONDS).astype(np.int64)
        about = {
            "simulated": json.dumps({"trajectory": self.trajectory, "seed": self.seed, "trial": self.trial}),
            "wrench": "on_body",
            "frames": json.dumps({"/wrench": "force and moment on the body at Q, in B", "/imu": "in B, at Q"}),
            "units": json.dumps({"force": "N", "moment": "N*m", "angular_velocity": "rad/s", "acceleration": "m/s^2"}),
        }
        write(
            path,
            wrench=WrenchChannel("/wrench", "body", stamp, stamp, self.run.force, self.run.moment),
            imu=ImuChannel("/imu", "body", stamp, stamp, self.run.omega, self.specific_force),
            metadata={"rig.run": about},
            overwrite=overwrite,
        )


def simulate(experiment: Experiment, trajectory: str | None = None, *, seed: int = 0, trial: int = 0) -> SimulatedRun:
    """Simulate one run with all the experiment's errors, but that of r_CG, which no sensor sees.

    The draws are those of the Monte Carlo's trial of that number with ``sampling="samples"``.

    Args:
        experiment: body, platform, trajectories, sources.
        trajectory: name of the trajectory; None for the first.
        seed: seed of the draws.
        trial: number of the trial.

    Raises:
        ExperimentError: there is no such trajectory, or the body is not stated.
    """
    name, spec = experiment.select(trajectory)
    warnings = check_precision("float64")
    body = experiment.body
    motion = true_motion(experiment, spec)
    force, moment, at_q = _true_signals(body, motion)
    noise = {target: _noise(experiment.sources, target, seed, trial, len(motion.t)) for target in ("F", "M", "omega")}
    run = Run(
        np.asarray(motion.t),
        np.asarray(force) + noise["F"],
        np.asarray(moment) + noise["M"],
        np.asarray(motion.omega.T) + noise["omega"],
        name=f"simulated {name}",
        warnings=tuple(warnings),
    )
    return SimulatedRun(run, np.asarray(at_q), np.asarray(motion.rotation), name, seed, trial)


@jax.jit
def _true_signals(body: Body, motion: Motion) -> tuple[Array, Array, Array]:
    """Force and moment at Q, and specific force at Q, each (n, 3)."""
    true = jax.vmap(wrench, in_axes=(None, 1, 1, 1))(body, motion.omega, motion.alpha, motion.specific_force_cg)
    to_q = jax.vmap(acceleration_at, in_axes=(None, 1, 1))(-body.r_cg_from_q, motion.omega, motion.alpha)
    return true.force, true.moment, motion.specific_force_cg.T + to_q


def _noise(sources: tuple[Source, ...], target: str, seed: int, trial: int, n: int) -> np.ndarray:
    """The sum of a target's errors, (n, 3)."""
    key, index = jax.random.key(seed), jnp.asarray(trial)
    total = np.zeros((n, 3))
    for source in sources:
        if source.target == target and source.kind == "bias":
            total += np.asarray(draw_bias(source, key, index, jnp.dtype(float)))
        elif source.target == target:
            drawn = _all_blocks(source, key, index, -(-n // BLOCK))
            total += np.concatenate(np.asarray(drawn), axis=1).T[:n]
    return total


@eqx.filter_jit
def _all_blocks(source: Source, key: Array, index: Array, count: int) -> Array:
    return jax.lax.map(lambda block: draw_block(source, key, index, block, jnp.dtype(float)), jnp.arange(count))
