"""What a platform really did: a recorded run beside its plan, and the uncertainty of what was run.

How the angular velocity follows the plan is in :mod:`uq.planning.tracking`. The centre of gravity's acceleration is the
specific force there less gravity, turned along by the gyro. The prediction is the law of propagation with the measured
motion in place of the plan.
"""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import jax.numpy as jnp
import numpy as np
import scipy
from jaxtyping import Array, Float

from identify.motion.trajectory import Trajectory
from identify.motion.window import Scalar
from identify.reporting import Drawing, Result, Section
from identify.rigid_body.dynamics import specific_force_at
from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE
from identify.signals.filters import lowpass
from identify.signals.run import Run
from identify.text_tables import Table, fixed, with_error
from uq.campaign.trial_setup import true_motion
from uq.experiment.experiment import Experiment, ExperimentError, TrajectorySpec
from uq.files.provenance import provenance
from uq.planning.required_duration import average
from uq.planning.tracking import Followed, follow, plan_at, verdicts
from uq.propagation.experiment_law import law
from uq.recorded.load_run import load
from uq.report.input_tables import source_tables

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SLOWEST = 0.2
"""Frequency below which no displacement is told from an acceleration [Hz]."""
CLOSE = 20.0
"""Samples of the measured motion to a period of its highest frequency."""


class Sampled(Trajectory):
    """A measured rotation: a cubic spline through its samples, at rest outside of them."""

    pieces: Float[Array | np.ndarray, "4 n 3"]
    """Coefficients of each interval, the cube's first [rad/s]."""
    interval: Scalar
    """Between samples [s]."""
    duration: Scalar
    """Duration [s]."""
    ramp: Scalar
    """Of the plan [s]."""
    plan: Trajectory
    """Whose displacement it is taken to have."""

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


@dataclass(frozen=True)
class Stillness:
    """How the centre of gravity moved, root mean square over the run, all axes together."""

    acceleration: float
    """Measured, up to the motion's band [m/s²]."""
    planned: float
    """[m/s²]."""
    apart: float
    """Measured less planned [m/s²]."""
    displacement: float
    """Of the measured motion at ``SLOWEST`` and above [m]."""
    by: str
    """Which sensor says so."""


@dataclass(frozen=True, repr=False)
class Achieved(Result):
    """A recorded run beside its plan.

    Example: ``achieved(Experiment.load("designed.toml"), "run.mcap").to_frame()``.
    """

    trajectory: str
    run: str
    followed: Followed
    stillness: Stillness | None
    """None: mass or centre of gravity are not stated."""
    planned_three_sigma: Float[np.ndarray, "6"]
    """By the law, of the plan [kg·m²]."""
    three_sigma: Float[np.ndarray, "6"]
    """By the law, of what was run [kg·m²]."""
    sources: Mapping[str, np.ndarray]
    """Of what was run, each source alone [kg·m²]."""
    estimator: str
    trace: tuple[np.ndarray, np.ndarray, np.ndarray]
    """Instants [s] from the plan's start, planned and measured angular velocity (n, 3) [rad/s], for a figure."""
    warnings: tuple[str, ...] = ()
    provenance: Mapping[str, Any] = field(default_factory=dict)
    file_name: str = "achieved.json"

    def tables(self) -> list[Table]:
        """Return how each axis followed, predicted 3σ, and how still the centre of gravity was."""
        return [self.axis_table(), self.width_table(), *self.stillness_tables()]

    def overview(self) -> list[Table]:
        """Return the same without captions."""
        return [dataclasses.replace(table, caption="") for table in self.tables()]

    def axis_table(self) -> Table:
        """Return how each axis followed."""
        f = self.followed
        gains = map(with_error, f.gain, f.gain_standard_error, [6] * 3)
        lags = map(with_error, 1e3 * f.lag, 1e3 * f.lag_standard_error, [6] * 3)
        others = [[f"{1e3 * x:.3g}".replace("-", "−") for x in pair] for pair in zip(f.offset, f.residual, strict=True)]
        rows = [[f"ω{k + 1}", gain, lag, *others[k]] for k, (gain, lag) in enumerate(zip(gains, lags, strict=True))]
        head = ["axis", "amplitude / planned", "lag, ms", "offset, mrad/s", "residual rms, mrad/s"]
        return Table("How each axis followed", head, rows, LAG)

    def width_table(self) -> Table:
        """Return predicted 3σ of the plan and of what was run, by component."""
        change = 100 * (self.three_sigma / self.planned_three_sigma - 1)
        rows = [
            ["planned", *(f"{GRAM_METRE * x:.4g}" for x in self.planned_three_sigma)],
            ["what was run", *(f"{GRAM_METRE * x:.4g}" for x in self.three_sigma)],
            ["change, %", *(fixed(x, 1) for x in change)],
        ]
        return Table("Predicted 3σ, g·m²", ["3σ, g·m²", *COMPONENTS], rows, PREDICTED)

    def stillness_tables(self) -> list[Table]:
        """Return how the centre of gravity moved, where mass and centre of gravity are stated."""
        still = self.stillness
        if still is None:
            return []
        rows = [
            ["acceleration, mm/s²", f"{1e3 * still.acceleration:.3g}"],
            ["planned, mm/s²", f"{1e3 * still.planned:.3g}"],
            ["measured less planned, mm/s²", f"{1e3 * still.apart:.3g}"],
            [f"displacement at {SLOWEST:g} Hz and above, mm", f"{1e3 * still.displacement:.3g}"],
        ]
        note = f"By the {still.by}, from {SLOWEST:g} Hz to the motion's band."
        return [Table("How still the centre of gravity was", ["centre of gravity, rms", "value"], rows, note)]

    def records(self) -> list[dict[str, Any]]:
        """Return predicted 3σ of the plan and of what was run, by component [kg·m²]."""
        rows = zip(COMPONENTS, self.planned_three_sigma, self.three_sigma, strict=True)
        return [dict(zip(("component", "planned", "achieved"), row, strict=True)) for row in rows]

    def drawings(self) -> list[Drawing]:
        """Return planned and measured angular velocity over some seconds."""

        def draw() -> "Figure":
            from uq.planning.tracking_figure import followed

            return followed(*self.trace)

        return [Drawing("followed", "Some seconds from the middle of the motion.", draw)]

    def section(self) -> Section:
        """Return its part of a report."""
        return Section(
            f"What was run: {self.run} beside {self.trajectory}",
            [f"{self.summary()[0].upper()}{self.summary()[1:]}.", FOLLOWED],
            self.warnings,
            self.tables(),
            self.drawings(),
            source_tables(self.provenance),
            ["The displacement of the platform's centre was that of the plan; the attitude follows the gyro."],
            self.provenance,
        )

    def to_dict(self) -> dict[str, Any]:
        """Return the content of achieved.json: SI, 3σ in kg·m²."""
        by = lambda values: dict(zip(COMPONENTS, np.asarray(values).tolist(), strict=True))  # noqa: E731
        followed = {
            f.name: [None if np.isnan(x) else x for x in getattr(self.followed, f.name).tolist()]
            for f in dataclasses.fields(self.followed)
        }
        return {
            "unit": "kg*m^2", "trajectory": self.trajectory, "run": self.run, "estimator": self.estimator,
            "followed": {**followed, "common_lag": self.followed.common_lag},
            "cg": None if self.stillness is None else dataclasses.asdict(self.stillness),
            "three_sigma": {"planned": by(self.planned_three_sigma), "achieved": by(self.three_sigma),
                            "sources": {name: by(values) for name, values in self.sources.items()}},
            "warnings": list(self.warnings), "provenance": dict(self.provenance),
        }  # fmt: skip

    def summary(self) -> str:
        """Return the averages in one line."""
        ours, theirs = ([average((s / 3) ** 2, goal) for goal in ("moments", "products")]
                        for s in (self.three_sigma, self.planned_three_sigma))  # fmt: skip
        pairs = zip(("moments", "products"), ours, theirs, strict=True)
        said = [f"{name} {GRAM_METRE * a:.3g} g·m² (planned {GRAM_METRE * b:.3g})" for name, a, b in pairs]
        return f"average 3σ of what was run: {', '.join(said)}"

    def title(self) -> str:
        """Return which run stands beside which plan."""
        return f"{self.run} beside {self.trajectory}"

    def notes(self) -> list[str]:
        """Return the averages and the warnings, a line each."""
        return [self.summary(), *(f"attention: {text}" for text in self.warnings)]


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
    own = experiment.estimator(estimator)
    if own.band is None:
        raise ExperimentError(f"estimator '{own.name}' has no band: give the motion's highest frequency")
    recorded = load(path, experiment.recording, band=own.band, marks=False)
    run, warnings = recorded.run, list(recorded.run.warnings)
    followed = follow(run, spec)
    lag = followed.common_lag
    measured = _motion_of(run, spec, followed, own.band)
    covered = min(run.t[-1] - run.t[0], lag + spec.duration) - max(0.0, lag)
    if covered < 0.98 * spec.duration:
        warnings.append(f"the run holds {covered:.4g} s of the plan's {spec.duration:g} s: the rest counts as rest")
    trajectories = {name: measured, "plan": spec} if name != "plan" else {name: measured, "the plan": spec}
    of_plan = list(trajectories)[1]
    found = law(dataclasses.replace(experiment, trajectories=trajectories, document={}), None, own.name)
    breakdown = found[name, own.name]
    return Achieved(
        name,
        run.name,
        followed,
        _stillness(run, experiment, spec, measured, lag, own.band),
        found[of_plan, own.name].total.three_sigma,
        breakdown.total.three_sigma,
        {source: statistics.three_sigma for source, statistics in breakdown.sources.items()},
        own.name,
        _trace(run, spec, lag),
        (*warnings, *verdicts(followed)),
        provenance(**experiment.inputs(), inputs=[{"file": str(path), "sha256": run.sha256}]),
    )


def _motion_of(run: Run, spec: TrajectorySpec, followed: Followed, band: float) -> TrajectorySpec:
    """The measured motion as a trajectory: without offset, low-passed above its band, from the plan's start."""
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
    found = Sampled(pieces, np.array(interval), np.array(spec.duration), np.asarray(ramp), spec.trajectory)
    return dataclasses.replace(spec, trajectory=found)


def _stillness(
    run: Run, experiment: Experiment, spec: TrajectorySpec, measured: TrajectorySpec, lag: float, band: float
) -> Stillness | None:
    """How the centre of gravity moved, by the accelerometer, or else by the load cell's force."""
    if experiment.r_cg_from_q is None or experiment.mass is None:
        return None
    motion, plan = true_motion(experiment, measured), true_motion(experiment, spec)
    upward = experiment.gravity * np.asarray(motion.rotation)[:, 2]
    planned = np.asarray(plan.specific_force_cg.T) - experiment.gravity * np.asarray(plan.rotation)[:, 2]
    at = np.asarray(motion.t)
    t = run.t - run.t[0] - lag
    if run.specific_force is not None:
        reading = scipy.interpolate.CubicSpline(t, run.specific_force)(np.clip(at, t[0], t[-1]))
        offset = np.asarray(experiment.r_cg_from_q) - (0.0 if run.imu_position is None else run.imu_position)
        turning = np.asarray(motion.omega.T), np.asarray(motion.alpha.T)
        force, by = specific_force_at(reading, *turning, offset), "accelerometer"
    else:
        reading = scipy.interpolate.CubicSpline(t, run.force)(np.clip(at, t[0], t[-1]))
        force, by = reading / experiment.mass, "load cell"
    inside = (at >= t[0]) & (at <= t[-1])
    in_a = np.einsum("nij,nj->ni", np.asarray(motion.rotation), np.asarray(force) - upward)
    plan_in_a = np.einsum("nij,nj->ni", np.asarray(plan.rotation), planned)
    own, theirs = (_in_band(x[inside], spec.rate, band) for x in (in_a, plan_in_a))
    difference = _in_band((in_a - plan_in_a)[inside], spec.rate, band)
    return Stillness(_rms(own[0]), _rms(theirs[0]), _rms(difference[0]), _rms(own[1]), by)


def _in_band(acceleration: np.ndarray, rate: float, band: float) -> tuple[np.ndarray, np.ndarray]:
    """An acceleration from ``SLOWEST`` up to a band, and the displacement that it makes, (n, 3) each."""
    spectrum = np.fft.rfft(acceleration, axis=0)
    frequency = np.fft.rfftfreq(len(acceleration), 1 / rate)[:, None]
    kept = (frequency >= SLOWEST) & (frequency <= band)
    turn = (2 * np.pi * np.where(kept, frequency, 1.0)) ** 2
    both = (np.where(kept, spectrum, 0), np.where(kept, -spectrum / turn, 0))
    return tuple(np.fft.irfft(one, len(acceleration), axis=0) for one in both)  # type: ignore[return-value]


def _rms(values: np.ndarray) -> float:
    return float(np.sqrt(np.mean(np.sum(values**2, axis=1))))


def _trace(run: Run, spec: TrajectorySpec, lag: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Some seconds from the middle of the motion."""
    t = run.t - run.t[0]
    middle = lag + spec.duration / 2
    inside = np.abs(t - middle) <= min(3.0, spec.duration / 2)
    return t[inside] - lag, plan_at(spec, t[inside] - lag)[0], np.asarray(run.omega)[inside]


FOLLOWED = "The run's angular velocity is fitted by the planned one: amplitude, lag, and offset of each axis."
LAG = "lag: counted from the run's first sample; ± is a standard error, from the residuals."
PREDICTED = "By the law of propagation, the measured angular velocity in place of the planned one."
