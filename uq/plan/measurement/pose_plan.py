"""Static poses for a platform, designed for mass and centre of gravity: a list that ``inertia centre`` reads."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from identify.display.reporting import Result
from identify.estimation.static_poses.centre import predicted_covariance
from identify.estimation.static_poses.centre_result import PARAMETERS, UNITS
from identify.estimation.static_poses.pose_design import best_poses, log_determinant
from identify.exceptions import explains_names
from identify.motion.euler_angles import roll_pitch_yaw
from identify.motion.leg_limits import Limits, leg_lengths, shares
from identify.motion.stewart_platform import Pose, StewartPlatform
from identify.rigid_body.rotation import exponential
from uq.analysis.propagation.prediction import Prediction
from uq.experiment.experiment import Experiment, ExperimentError, TrajectorySpec
from uq.experiment.pose_table import Poses, uncertain
from uq.plan.measurement.platform_run import effort_at_rest, peaks_at_home

POSES, HOLD = 12, 2.0
"""Number of poses, and the time for which each is held still [s]."""
AZIMUTHS, TILTS = 24, 121
"""Directions to lean to, and tilts that are tried in each, evenly up to ``MOST_TILT``."""
MOST_TILT = np.deg2rad(30.0)
"""Largest tilt of a planned pose [rad], whatever the platform could do."""
PIVOTS = np.linspace(-0.2, 0.4, 13)
"""Heights over OMB about which the platform may lean [m]."""
COLUMNS = (
    "pose", "x_m", "y_m", "z_m", "roll_rad", "pitch_rad", "yaw_rad", *(f"leg{k}_m" for k in range(1, 7)),
    "gx", "gy", "gz", "fx", "fy", "fz", "tx", "ty", "tz",
)  # fmt: skip
DECLARATION: Mapping[str, Any] = {
    "force": ["fx", "fy", "fz"], "moment": ["tx", "ty", "tz"], "gravity": ["gx", "gy", "gz"],
}  # fmt: skip
"""The table ``[poses]`` that reads the list once force and moment are filled in."""


@dataclass(frozen=True, repr=False)
class PosePlan(Result):
    """Static poses to run, and what they promise beside the poses that one would take without thinking.

    Example: ``plan_poses(experiment, experiment.trajectories["T1"], limits).to_frame()["designed"]``.
    """

    position: Float[np.ndarray, "n 3"]
    """Position of OMB from home, in A [m]."""
    rotation: Float[np.ndarray, "n 3 3"]
    """Attitude R_AB, from components in B to components in A."""
    length: Float[np.ndarray, "n 6"]
    """Lengths of the legs [m]."""
    covariance: Float[np.ndarray, "10 10"]
    """Predicted, of the ten parameters of a :class:`~identify.estimation.static_poses.centre_result.Centre`."""
    naive: Float[np.ndarray, "10 10"]
    """Covariance of as many poses that are level or lean along ±x and ±y, by the tilt that all four directions
    allow."""
    reach: Float[np.ndarray, " azimuths"]
    """Largest tilt in each direction, counter-clockwise from x [rad]."""
    hold: float
    """Time for which each pose is held [s]."""
    name: str = "poses"
    provenance: Mapping[str, Any] = field(default_factory=dict)

    @property
    def tilt(self) -> Float[np.ndarray, " n"]:
        """Tilt of each pose [rad]."""
        return np.arccos(np.clip(self.rotation[:, 2, 2], -1, 1))

    @property
    def angles(self) -> Float[np.ndarray, "n 3"]:
        """Roll, pitch and yaw of each pose [rad]."""
        return roll_pitch_yaw(self.rotation)

    @property
    def standard_uncertainty(self) -> Float[np.ndarray, "10"]:
        """Predicted, of the ten parameters."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def naive_standard_uncertainty(self) -> Float[np.ndarray, "10"]:
        """Standard uncertainties of the ten parameters with the naive poses."""
        return np.sqrt(np.diag(self.naive))

    def csv(self) -> str:
        """Return the list: pose, legs, gravity in B; force and moment stand empty until they are measured."""
        rows = np.hstack([self.position, self.angles, self.length, -self.rotation[:, 2]])
        lines = [f"{k},{','.join(f'{x + 0.0:.9f}' for x in row)}{',' * 6}" for k, row in enumerate(rows, start=1)]
        return "\n".join([",".join(COLUMNS), *lines, ""])

    def files(self) -> dict[str, bytes]:
        """Return the list of poses."""
        return {f"{self.name}.csv": self.csv().encode()}

    def repeats(self) -> list[list[int]]:
        """Return the numbers of poses that are the same, from 1 on, a list for each pose that comes more than once."""
        same: dict[bytes, list[int]] = {}
        for number, pose in enumerate(np.hstack([self.position, self.rotation.reshape(-1, 9)]), start=1):
            same.setdefault(np.round(pose, 9).tobytes(), []).append(number)
        return [numbers for numbers in same.values() if len(numbers) > 1]

    def records(self) -> list[dict[str, Any]]:
        """Return predicted standard uncertainties of the ten parameters, in SI, designed and naive."""
        columns = (PARAMETERS, UNITS, self.standard_uncertainty, self.naive_standard_uncertainty)
        names = ("parameter", "unit", "designed", "naive")
        return [dict(zip(names, row, strict=True)) for row in zip(*columns, strict=True)]

    def to_dict(self) -> dict[str, Any]:
        """Return what result.json says, SI."""
        pairs = (("standard_uncertainty", self.standard_uncertainty), ("naive", self.naive_standard_uncertainty))
        return {
            "file": f"{self.name}.csv", "poses": len(self.position), "hold": self.hold, "tilt": self.tilt.tolist(),
            "reach": self.reach.tolist(),
            **{key: dict(zip(PARAMETERS, values.tolist(), strict=True)) for key, values in pairs},
        }  # fmt: skip


@explains_names
def plan_poses(
    experiment: Experiment,
    spec: TrajectorySpec,
    limits: Limits,
    *,
    count: int = POSES,
    hold: float = HOLD,
    starts: int = 3,
    seed: int = 0,
) -> PosePlan:
    """Choose the static poses that best determine mass and centre of gravity within a platform's limits.

    The poses lean about a horizontal axis, through OMB or a point above or below it, as far as legs, joints and load
    cell allow. Judged is the predicted covariance of ``inertia centre``: white noise of force and moment averaged over
    ``hold``, and the attitudes' uncertainties of ``[poses]``; constant offsets are estimated and cost nothing more.

    Args:
        experiment: body, platform, sources.
        spec: a trajectory of it, for the sample rate.
        limits: of the rig.
        count: of poses, 3 or more.
        hold: for how long each is held still [s].
        starts: random sets to begin with.
        seed: of those.

    Raises:
        ExperimentError: too few poses, no noise of the load cell, or a platform that cannot hold the body or lean.
    """
    if count < 3:
        raise ExperimentError(f"{count} static poses: ask for three or more")
    if not hold > 0:
        raise ExperimentError(f"static poses held for {hold:g} s: hold them for longer")
    scatter = np.asarray(Prediction.of(experiment, spec).wrench) / max(hold * spec.rate, 1.0)
    if not (np.diag(scatter) > 0).all():
        raise ExperimentError("no noise of force and moment in [[source]]: declare it on all axes, or poses are equal")
    place, reach = candidates(experiment, limits)
    force = experiment.gravity * np.asarray(place.rotation)[:, 2]
    mass, centre = float(experiment.body.mass), np.asarray(experiment.stated_r_cg)

    def predicted(figure: Callable[..., Any], force: np.ndarray) -> Any:
        return figure(force, mass, centre, scatter, uncertain(force, experiment.poses or Poses(), None, np.eye(3)))

    try:
        cost = lambda chosen: predicted(log_determinant, force[chosen])  # noqa: E731
        chosen = best_poses(len(force), count, cost, starts=starts, seed=seed)
    except ValueError as error:
        raise ExperimentError(f"{error}: the platform leans by {np.degrees(reach.max()):.2g}° at most") from None
    return PosePlan(
        position=np.asarray(place.position)[chosen] - np.asarray(experiment.platform.home),
        rotation=np.asarray(place.rotation)[chosen], length=np.asarray(leg_lengths(experiment.platform, place))[chosen],
        covariance=predicted(predicted_covariance, force[chosen]), reach=reach, hold=hold,
        naive=predicted(predicted_covariance, _naive(experiment, reach, count)), provenance=experiment.inputs(),
    )  # fmt: skip


def candidates(experiment: Experiment, limits: Limits) -> tuple[Pose, np.ndarray]:
    """Return the poses to choose from, level first, and the largest tilt in each direction [rad].

    Raises:
        ExperimentError: the platform cannot hold the body at home.
    """
    azimuths = 2 * np.pi * np.arange(AZIMUTHS) / AZIMUTHS
    tilts = np.linspace(0, MOST_TILT, TILTS)
    grid = [values.ravel() for values in np.meshgrid(azimuths, tilts, PIVOTS, indexing="ij")]
    poses = _leaning(experiment.platform, *map(jnp.asarray, grid))
    used = shares(effort_at_rest(experiment, poses), limits)
    used = np.concatenate([np.abs(values) for values in used.values()], axis=1).max(axis=1)
    allowed = (used <= 1 + 1e-9).reshape(AZIMUTHS, TILTS, len(PIVOTS))
    if not allowed[:, 0].any():
        worst = peaks_at_home(experiment, limits)[0]
        raise ExperimentError(f"the platform cannot stand at home with the body: {worst}")
    unbroken = np.logical_and.accumulate(allowed, axis=1)
    furthest = np.where(unbroken, tilts[None, :, None], -1.0).max(axis=1)
    reach, pivot = furthest.max(axis=1), PIVOTS[furthest.argmax(axis=1)]
    leaning = [(at, part * tilt, height) for at, tilt, height in zip(azimuths, reach, pivot, strict=True)
               for part in (1.0, 0.5) if tilt > 0]  # fmt: skip
    poses_to_try = np.array([(0.0, 0.0, 0.0), *leaning])
    return _leaning(experiment.platform, *map(jnp.asarray, poses_to_try.T)), reach


def _naive(experiment: Experiment, reach: np.ndarray, count: int) -> np.ndarray:
    """Specific force of poses along ±x and ±y and level, over and over."""
    tilt = reach[:: AZIMUTHS // 4].min()
    across = -np.sin(tilt) * np.array([(0, 0), (1, 0), (0, 1), (-1, 0), (0, -1)])
    upward = np.column_stack([across, np.sqrt(1 - np.sum(across**2, axis=1))])
    return experiment.gravity * np.resize(upward, (count, 3))


@jax.jit
def _leaning(
    platform: StewartPlatform, azimuth: Float[Array, " n"], tilt: Float[Array, " n"], pivot: Float[Array, " n"]
) -> Pose:
    """Poses whose b3 leans towards an azimuth about a point ``pivot`` above OMB."""

    def leaning(azimuth, tilt, pivot):
        rotation = exponential(tilt * jnp.stack([-jnp.sin(azimuth), jnp.cos(azimuth), jnp.zeros_like(azimuth)]))
        about = jnp.stack([jnp.zeros_like(pivot), jnp.zeros_like(pivot), pivot])
        return Pose(jnp.asarray(platform.home) + about - rotation @ about, rotation)

    return jax.vmap(leaning)(azimuth, tilt, pivot)
