"""The achieved motion of a platform: a recorded run beside its plan, and the uncertainty of what was run.

How the angular velocity follows the plan is in :mod:`uq.tracking.followed`. The centre of gravity's acceleration is the
specific force there less gravity, turned along by the gyro. The prediction is the law of propagation with the measured
motion in place of the plan.

What the platform really ran is a trajectory: the gyro's angular velocity, low-passed, by splines.
"""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import jax.numpy as jnp
import numpy as np
import scipy
from jaxtyping import Array, Float

from identify.exceptions import explains_names
from identify.motion.trajectory import Scalar, Trajectory
from identify.reporting import Result
from identify.rigid_body.inertia import COMPONENTS
from identify.rigid_body.inertial_parameters import by_component
from identify.signals.filters import lowpass
from identify.signals.run import Run
from uq.experiment.experiment import Experiment, ExperimentError, TrajectorySpec
from uq.files.provenance import provenance
from uq.propagation.experiment_law import law
from uq.recorded.load_run import load
from uq.tracking.centre_stillness import Stillness, stillness_of
from uq.tracking.followed import Followed, follow, plan_at, verdicts


@dataclass(frozen=True, repr=False)
class Achieved(Result):
    """A recorded run beside its plan.

    Example: ``achieved(Experiment.load("designed.toml"), "run.mcap").to_frame()``.
    """

    unit_of_columns = "kg·m²"

    trajectory: str
    run: str
    followed: Followed
    stillness: Stillness | None
    """Stillness of the centre of gravity; None: mass or centre of gravity are not stated."""
    planned_three_sigma: Float[np.ndarray, "6"]
    """Three standard deviations of each component that the law predicts for the plan [kg·m²]."""
    three_sigma: Float[np.ndarray, "6"]
    """Three standard deviations of each component that the law predicts for the recorded motion [kg·m²]."""
    sources: Mapping[str, np.ndarray]
    """Three standard deviations by each source alone for the recorded motion, by the source's name [kg·m²]."""
    estimator: str
    trace: tuple[np.ndarray, np.ndarray, np.ndarray]
    """Instants [s] from the plan's start, planned and measured angular velocity (n, 3) [rad/s], for a figure."""
    warnings: tuple[str, ...] = ()
    provenance: Mapping[str, Any] = field(default_factory=dict)
    file_name: str = "achieved.json"

    def records(self) -> list[dict[str, Any]]:
        """Return predicted 3σ of the plan and of what was run, by component [kg·m²]."""
        rows = zip(COMPONENTS, self.planned_three_sigma, self.three_sigma, strict=True)
        return [dict(zip(("component", "planned", "achieved"), row, strict=True)) for row in rows]

    def to_dict(self) -> dict[str, Any]:
        """Return the content of achieved.json: SI, 3σ in kg·m²."""
        followed = {
            f.name: [None if np.isnan(x) else x for x in getattr(self.followed, f.name).tolist()]
            for f in dataclasses.fields(self.followed)
        }
        return {
            "unit": "kg*m^2", "trajectory": self.trajectory, "run": self.run, "estimator": self.estimator,
            "followed": {**followed, "common_lag": self.followed.common_lag},
            "cg": None if self.stillness is None else dataclasses.asdict(self.stillness),
            "three_sigma": {"planned": by_component(self.planned_three_sigma),
                            "achieved": by_component(self.three_sigma),
                            "sources": {name: by_component(values) for name, values in self.sources.items()}},
            "warnings": list(self.warnings), "provenance": dict(self.provenance),
        }  # fmt: skip


@explains_names
def achieved(
    experiment: Experiment, path: str | Path, trajectory: str | None = None, *, estimator: str | None = None
) -> Achieved:
    """Compare a recorded run with the trajectory that was planned, and predict the uncertainty of what was run.

    Args:
        experiment: with the trajectory, the sources, and what the run's channels mean.
        path: a recorded run.
        trajectory: its name; None for ``designed`` where there is one, else the first.
        estimator: whose uncertainty; None for the recording's, or the first.

    Raises:
        ExperimentError: no such trajectory, or an estimator without a band.
        RunError: the run's angular velocity is not like the plan's.
        RigError, OSError: the file cannot be read.
    """
    if trajectory is None and "designed" in experiment.trajectories:
        trajectory = "designed"
    name, spec = experiment.select(trajectory)
    estimator_spec = experiment.estimator(estimator)
    if estimator_spec.band is None:
        raise ExperimentError(f"estimator '{estimator_spec.name}' has no band: give the motion's highest frequency")
    recorded = load(path, experiment.recording, gravity=experiment.gravity, band=estimator_spec.band, marks=False)
    run, warnings = recorded.run, list(recorded.run.warnings)
    followed = follow(run, spec)
    lag = followed.common_lag
    measured = measured_trajectory(run, spec, followed, estimator_spec.band)
    covered = min(run.t[-1] - run.t[0], lag + spec.duration) - max(0.0, lag)
    if covered < 0.98 * spec.duration:
        warnings.append(f"the run holds {covered:.4g} s of the plan's {spec.duration:g} s: the rest counts as rest")
    trajectories = {name: measured, "plan": spec} if name != "plan" else {name: measured, "the plan": spec}
    plan_name = list(trajectories)[1]
    result = law(dataclasses.replace(experiment, trajectories=trajectories, document={}), None, estimator_spec.name)
    breakdown = result[name, estimator_spec.name]
    return Achieved(
        trajectory=name, run=run.name, followed=followed,
        stillness=stillness_of(run, experiment, spec, measured, lag, estimator_spec.band),
        planned_three_sigma=result[plan_name, estimator_spec.name].total.three_sigma,
        three_sigma=breakdown.total.three_sigma,
        sources={source: statistics.three_sigma for source, statistics in breakdown.sources.items()},
        estimator=estimator_spec.name, trace=_trace(run, spec, lag), warnings=(*warnings, *verdicts(followed)),
        provenance=provenance(**experiment.inputs(), inputs=[{"file": str(path), "sha256": run.sha256}]),
    )  # fmt: skip


def _trace(run: Run, spec: TrajectorySpec, lag: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Some seconds from the middle of the motion."""
    t = run.t - run.t[0]
    middle = lag + spec.duration / 2
    inside = np.abs(t - middle) <= min(3.0, spec.duration / 2)
    return t[inside] - lag, plan_at(spec, t[inside] - lag)[0], np.asarray(run.omega)[inside]


CLOSE = 20.0
"""Samples of the measured motion to a period of its highest frequency."""


class MeasuredRotation(Trajectory):
    """A measured rotation: a cubic spline through its samples, at rest outside of them."""

    pieces: Float[Array | np.ndarray, "4 n 3"]
    """Coefficients of the cubic in each interval, that of the third power first [rad/s]."""
    interval: Scalar
    """Time between samples [s]."""
    duration: Scalar
    """Duration of the motion [s]."""
    ramp: Scalar
    """Ramp of the plan [s]."""
    plan: Trajectory
    """Planned trajectory, whose displacement the measured motion is taken to have."""

    def omega(self, t: Float[Array, ""]) -> Float[Array, "3"]:
        """Return the angular velocity in B at ``t``."""
        count = self.pieces.shape[1]
        number = jnp.clip(jnp.floor(t / self.interval), 0.0, count - 1.0)
        x = jnp.clip(t, 0.0, count * self.interval) - number * self.interval
        a, b, c, d = jnp.asarray(self.pieces)[:, number.astype(int)]
        return ((a * x + b) * x + c) * x + d

    def displacement(self, t: Float[Array, ""]) -> Float[Array, "3"]:
        """Return the plan's displacement."""
        return self.plan.displacement(t)


def measured_trajectory(run: Run, spec: TrajectorySpec, followed: Followed, band: float) -> TrajectorySpec:
    """Return the measured motion as a trajectory: without offset, low-passed above its band, from the plan's start."""
    t = run.t - run.t[0] - followed.common_lag
    omega = run.omega - followed.offset
    nyquist = 3 * band  # flat to 0.4 of it
    if nyquist < run.rate / 2:
        taps = lowpass(run.rate, nyquist)
        half = len(taps) // 2
        omega = scipy.signal.oaconvolve(np.pad(omega, ((half, half), (0, 0))), taps[:, None], mode="valid", axes=0)
    stride = max(1, int(run.rate / (CLOSE * band)))
    interval = stride / run.rate
    at = np.arange(int(np.ceil(spec.duration / interval)) + 1) * interval
    inside = (at >= t[0]) & (at <= t[-1])
    values = np.where(inside[:, None], scipy.interpolate.CubicSpline(t, omega)(np.clip(at, t[0], t[-1])), 0.0)
    pieces = scipy.interpolate.CubicSpline(at, values).c
    ramp = spec.trajectory.ramp  # type: ignore[attr-defined]
    trajectory = MeasuredRotation(
        pieces=pieces, interval=np.array(interval), duration=np.array(spec.duration), ramp=np.asarray(ramp),
        plan=spec.trajectory,
    )  # fmt: skip
    return dataclasses.replace(spec, trajectory=trajectory)
