"""An experiment's platform on its way and at rest: its motion, and what that asks of legs, load cell and body."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from identify.motion.leg_limits import Effort, Limits, PlatformMotion, effort, peaks, platform_motion
from identify.motion.limit_peaks import Peak
from identify.motion.stewart_platform import Pose, Twist
from uq.experiment.experiment import Experiment, TrajectorySpec


def motion_at(
    experiment: Experiment, spec: TrajectorySpec, t: Float[Array, " n"] | Float[np.ndarray, " n"]
) -> PlatformMotion:
    """Return the platform's motion along a trajectory at uniform instants [s], the first of which is at home."""
    still = jnp.asarray(experiment.r_cg_from_omb) if spec.still == "cg" else jnp.zeros(3)
    return platform_motion(experiment.platform, spec.trajectory, jnp.asarray(t), still)


def effort_of(experiment: Experiment, motion: PlatformMotion) -> Effort:
    """Return what a motion of the platform asks for."""
    r_cg, gravity = jnp.asarray(experiment.r_cg_from_omb), jnp.asarray(experiment.gravity)
    return effort(experiment.platform, experiment.body, r_cg, motion, gravity)


def effort_at_rest(experiment: Experiment, poses: Pose) -> Effort:
    """Return what the platform is asked for where it stands still in each of several poses."""
    still = jnp.zeros_like(poses.position)
    return effort_of(experiment, PlatformMotion(still[:, 0], poses, Twist(still, still, still, still)))


def peaks_at_home(experiment: Experiment, limits: Limits) -> list[Peak]:
    """Return the use of each limit by standing at home, the largest first."""
    home = jax.tree.map(lambda array: array[None], experiment.platform.home_pose)
    return peaks(effort_at_rest(experiment, home), limits, jnp.zeros(1))
