"""The achieved motion of a platform: a recorded run beside its plan, and the uncertainty of what was run.

On each axis the plan is fitted to the measured angular velocity, ``gain * plan(t - lag) + offset``: the lag is found by
cross-correlation first, then by least squares on the plan's own derivative. The centre of gravity's acceleration is the
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
from identify.rounding import significant
from identify.signals.filters import lowpass
from identify.signals.run import Run, RunError
from uq.experiment.experiment import Experiment, ExperimentError, TrajectorySpec, turn_rates
from uq.files.provenance import provenance
from uq.propagation.experiment_law import law
from uq.recorded.load_run import load
from uq.tracking.centre_stillness import Stillness, stillness_of

ROUNDS = 6
"""Linear steps to lag, gain and offset."""
ALIKE = 0.5
"""Correlation with the plan below which a run does not count as a run of this plan."""


@dataclass(frozen=True)
class Followed:
    """Deviation of a measured signal from its plan, one figure an axis."""

    gain: Float[np.ndarray, "3"]
    """Amplitude over the planned one; not-a-number for an axis without a plan."""
    gain_standard_error: Float[np.ndarray, "3"]
    lag: Float[np.ndarray, "3"]
    """Delay behind the plan, counted from the run's first sample [s]."""
    lag_standard_error: Float[np.ndarray, "3"]
    offset: Float[np.ndarray, "3"]
    """Offset of the angular velocity from the plan [rad/s]."""
    residual: Float[np.ndarray, "3"]
    """Root mean square of what is left [rad/s]."""

    @property
    def common_lag(self) -> float:
        """The axes' lag, weighted by its standard errors [s]."""
        fitted = np.isfinite(self.lag)
        weight = 1 / np.maximum(self.lag_standard_error[fitted], 1e-12) ** 2
        return float((weight * self.lag[fitted]).sum() / weight.sum())


def follow(run: Run, spec: TrajectorySpec) -> Followed:
    """Return gain, lag and offset of a run's angular velocity against a trajectory's, on each axis.

    Raises:
        RunError: the run does not follow the trajectory.
    """
    t, measured = run.t - run.t[0], np.asarray(run.omega)
    usable = run.usable
    lag = np.full(3, _coarse_lag(run, spec))
    gain, offset = np.ones(3), np.zeros(3)
    scale = np.abs(plan_at(spec, t - lag[0])[0]).max()
    active = np.abs(plan_at(spec, t - lag[0])[0]).max(axis=0) > 1e-6 * scale
    error = np.full((3, 2), np.nan)
    residual = np.zeros(3)
    for _ in range(ROUNDS):
        for k in range(3):
            plan, slope = plan_at(spec, t - lag[k])
            inside = usable & (t >= lag[k]) & (t <= lag[k] + spec.duration)
            columns = np.stack([plan[:, k], -slope[:, k], np.ones(len(t))], axis=1)[inside]
            if not active[k]:
                offset[k], residual[k] = measured[inside, k].mean(), measured[inside, k].std()
                continue
            solution = np.linalg.lstsq(columns, measured[inside, k], rcond=None)[0]
            residuals = measured[inside, k] - columns @ solution
            gain[k], offset[k], residual[k] = solution[0], solution[2], np.sqrt(np.mean(residuals**2))
            if not gain[k] > 0:
                raise _unlike(run)
            spread = residual[k] * np.sqrt(np.diag(np.linalg.inv(columns.T @ columns)))
            error[k] = spread[0], spread[1] / gain[k]
            lag[k] += np.clip(solution[1] / gain[k], -0.05, 0.05)
    gain[~active], lag[~active] = np.nan, np.nan
    return Followed(
        gain=gain, gain_standard_error=error[:, 0], lag=lag, lag_standard_error=error[:, 1], offset=offset,
        residual=residual,
    )  # fmt: skip


def _coarse_lag(run: Run, spec: TrajectorySpec) -> float:
    """Lag by cross-correlation of all axes, with a parabola through its peak [s]."""
    measured = run.omega - run.omega.mean(axis=0)
    at = np.arange(int(np.ceil(spec.duration * run.rate))) / run.rate
    plan, _ = plan_at(spec, at)
    together = sum(scipy.signal.correlate(measured[:, k], plan[:, k], mode="full", method="fft") for k in range(3))
    k = int(np.argmax(together))
    likeness = together[k] / max(np.linalg.norm(measured) * np.linalg.norm(plan), 1e-300)
    if likeness < ALIKE:
        raise _unlike(run)
    shift = 0.0
    if 0 < k < len(together) - 1:
        before, here, after = together[k - 1 : k + 2]
        shift = 0.5 * (before - after) / min(before - 2 * here + after, -1e-300)
    return float((k + shift - (len(plan) - 1)) / run.rate)


def _unlike(run: Run) -> RunError:
    return RunError(
        f"the angular velocity of {run.name} is not like the plan's: name the trajectory that was run (--trajectory), "
        "or correct the sensor's axes in [recording]"
    )


def plan_at(spec: TrajectorySpec, t: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Planned angular velocity and acceleration at any instants, at rest outside the motion, (n, 3) each."""
    inside = (t > 0) & (t < spec.duration)
    omega, alpha = turn_rates(spec.trajectory, jnp.asarray(np.clip(t, 0.0, spec.duration)))
    return np.where(inside[:, None], omega, 0.0), np.where(inside[:, None], alpha, 0.0)


def verdicts(followed: Followed) -> list[str]:
    """Return warnings of a platform that did not follow."""
    off = np.abs(followed.gain - 1)
    worst = int(np.nanargmax(off))
    lines = []
    if off[worst] > 0.05:
        gain = significant(100 * followed.gain[worst])
        lines.append(f"the platform ran {gain} % of the planned amplitude about axis {worst + 1}")
    spread = np.nanmax(followed.lag) - np.nanmin(followed.lag)
    if spread > 5e-3:
        lines.append(f"the axes lag by unequal times, {significant(1e3 * spread)} ms apart")
    return lines


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
    plan_name = "plan" if name != "plan" else "the plan"
    trajectories = {name: measured, plan_name: spec}
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
