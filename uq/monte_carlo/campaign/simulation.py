"""A synthetic recorded run: one trial's signals, as the load cell and the IMU would give them."""

import json
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array

from identify.exceptions import explains_names
from identify.floating_point import check_precision
from identify.motion.trajectory import Motion, acceleration_of
from identify.rigid_body.dynamics import acceleration_at
from identify.rigid_body.rotation import exponential
from identify.signals.run import Run
from rig.channels import ImuChannel, WrenchChannel
from rig.runs import write
from uq.experiment.experiment import Experiment
from uq.monte_carlo.campaign.trial_setup import setting_of
from uq.monte_carlo.trials.samples_engine import (
    SamplesEngine,
    SensorRecord,
    by_act,
    draw_noise,
    prepare_samples,
    sensed,
    smooth_signals,
)
from uq.sources.constant_errors import errors_of
from uq.sources.draws import draw_constants

NANOSECONDS = 1_000_000_000


@dataclass(frozen=True)
class SimulatedRun:
    """A simulated recording of a rig with the experiment's errors, and the truth behind it."""

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
        at: dict[str, Any] = {"frame_id": "body", "log_time": stamp, "stamp": stamp}
        wrench = WrenchChannel(topic="/wrench", force=self.run.force, moment=self.run.moment, **at)
        omega, acceleration = self.run.omega, self.specific_force
        imu = ImuChannel(topic="/imu", angular_velocity=omega, linear_acceleration=acceleration, **at)
        write(path, wrench=wrench, imu=imu, metadata={"rig.run": about}, overwrite=overwrite)


@explains_names
def simulate(experiment: Experiment, trajectory: str | None = None, *, seed: int = 0, trial: int = 0) -> SimulatedRun:
    """Simulate one run with all the experiment's errors, but that of r_CG, which no sensor sees.

    The draws are those of the Monte Carlo's trial by samples of that number.

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
    setting = setting_of(experiment, spec, ())
    motion = setting.motion
    recorded = _recorded(prepare_samples(setting), motion, jax.random.key(seed), jnp.asarray(trial))
    record, specific_force, rotation = jax.tree.map(np.asarray, recorded)
    force, moment, omega = (signal.T for signal in record)
    run = Run(np.asarray(motion.t), force, moment, omega, name=f"simulated {name}", warnings=tuple(warnings))
    return SimulatedRun(
        run=run, specific_force=specific_force, rotation=rotation, trajectory=name, seed=seed, trial=trial
    )


@jax.jit
def _recorded(setup: SamplesEngine, motion: Motion, key: Array, trial: Array) -> tuple[SensorRecord, Array, Array]:
    """Return the sensors' readings, the true specific force at Q, and the true attitude."""
    draws = draw_constants(setup.sources, setup.mixing, key, trial, setup.dtype)
    errors, draws = errors_of(setup.sources, draws), draws | draw_noise(setup, key, trial)
    numbers = {name: draws[name] for name in setup.by_act}
    record = sensed(setup, smooth_signals(setup, errors, numbers), draws, [True] * len(setup.sources))
    rotation = jnp.matmul(exponential(errors.tilt), motion.rotation)
    q_from_still = jnp.asarray(setup.platform.r_cg_from_still) + errors.r_cg_from_omb - setup.body.r_cg_from_q
    turning = jax.vmap(acceleration_at, in_axes=(None, 1, 1))(q_from_still, motion.omega, motion.alpha)
    moving = jax.vmap(lambda t, r_ab: acceleration_of(setup.trajectory, t) @ r_ab)(motion.t, motion.rotation)
    up = rotation[:, 2, :]
    specific_force = turning + moving + (setup.platform.gravity + errors.gravity) * up + by_act(setup, numbers)[9:].T
    return record, specific_force, rotation
