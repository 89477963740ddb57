"""The achieved motion of a platform: a recorded run beside its plan, and the uncertainty of what was run.

How the angular velocity follows the plan is in :mod:`uq.tracking.followed`. The centre of gravity's acceleration is the
specific force there less gravity, turned along by the gyro. The prediction is the law of propagation with the measured
motion in place of the plan.
"""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float

from identify.exceptions import explains_names
from identify.reporting import Drawing, Result, Section
from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE
from identify.rounding import common, fixed, significant, with_uncertainty
from identify.signals.run import Run
from identify.text_tables import Table, one_line
from uq.experiment.experiment import Experiment, ExperimentError, TrajectorySpec
from uq.files.provenance import provenance
from uq.planning.required_duration import average
from uq.propagation.experiment_law import law
from uq.recorded.load_run import load
from uq.report.input_tables import source_tables
from uq.tracking.centre_stillness import SLOWEST, Stillness, stillness_of
from uq.tracking.followed import Followed, follow, plan_at, verdicts
from uq.tracking.measured_trajectory import measured_trajectory

if TYPE_CHECKING:
    from matplotlib.figure import FigureBase


@dataclass(frozen=True, repr=False)
class Achieved(Result):
    """A recorded run beside its plan.

    Example: ``achieved(Experiment.load("designed.toml"), "run.mcap").to_frame()``.
    """

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

    def tables(self) -> list[Table]:
        """Return how each axis followed, predicted 3σ, and how still the centre of gravity was."""
        return [self.axis_table(), self.width_table(), *self.stillness_tables()]

    def overview(self) -> list[Table]:
        """Return the same without captions."""
        return [dataclasses.replace(table, caption="") for table in self.tables()]

    def axis_table(self) -> Table:
        """Return how each axis followed."""
        f = self.followed
        gains = map(with_uncertainty, f.gain, f.gain_standard_error)
        lags = map(with_uncertainty, 1e3 * f.lag, 1e3 * f.lag_standard_error)
        others = [*zip(common(1e3 * f.offset), common(1e3 * f.residual), strict=True)]
        rows = [[f"ω{k + 1}", gain, lag, *others[k]] for k, (gain, lag) in enumerate(zip(gains, lags, strict=True))]
        head = ["axis", "amplitude / planned", "lag, ms", "offset, mrad/s", "residual rms, mrad/s"]
        return Table("How each axis followed", head, rows, LAG)

    def width_table(self) -> Table:
        """Return predicted 3σ of the plan and of what was run, by component."""
        change = 100 * (self.three_sigma / self.planned_three_sigma - 1)
        rows = [
            ["planned", *(significant(GRAM_METRE * x, 4) for x in self.planned_three_sigma)],
            ["what was run", *(significant(GRAM_METRE * x, 4) for x in self.three_sigma)],
            ["change, %", *(fixed(x, 1) for x in change)],
        ]
        return Table("Predicted 3σ, g·m²", ["3σ, g·m²", *COMPONENTS], rows, PREDICTED)

    def stillness_tables(self) -> list[Table]:
        """Return how the centre of gravity moved, where mass and centre of gravity are stated."""
        still = self.stillness
        if still is None:
            return []
        rows = [
            ["acceleration, mm/s²", significant(1e3 * still.acceleration)],
            ["planned, mm/s²", significant(1e3 * still.planned)],
            ["measured less planned, mm/s²", significant(1e3 * still.apart)],
            [f"displacement at {SLOWEST:g} Hz and above, mm", significant(1e3 * still.displacement)],
        ]
        note = f"By the {still.by}, from {SLOWEST:g} Hz to the motion's band."
        return [Table("How still the centre of gravity was", ["centre of gravity, rms", "value"], rows, note)]

    def records(self) -> list[dict[str, Any]]:
        """Return predicted 3σ of the plan and of what was run, by component [kg·m²]."""
        rows = zip(COMPONENTS, self.planned_three_sigma, self.three_sigma, strict=True)
        return [dict(zip(("component", "planned", "achieved"), row, strict=True)) for row in rows]

    def drawings(self) -> list[Drawing]:
        """Return planned and measured angular velocity over some seconds."""

        def draw() -> "FigureBase":
            from uq.tracking.followed_figure import followed

            return followed(*self.trace)

        return [Drawing("followed", "Some seconds from the middle of the motion.", draw)]

    def section(self) -> Section:
        """Return its part of a report."""
        return Section(
            title=f"What was run: {self.run} beside {self.trajectory}",
            computed=[f"{self.summary()[0].upper()}{self.summary()[1:]}.", FOLLOWED],
            findings=self.warnings,
            tables=self.tables(),
            drawings=self.drawings(),
            details=source_tables(self.provenance),
            assumptions=[
                "The displacement of the platform's centre was that of the plan; the attitude follows the gyro."
            ],
            provenance=self.provenance,
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
        averages = [
            f"{name} {significant(GRAM_METRE * a)} g·m² (planned {significant(GRAM_METRE * b)})" for name, a, b in pairs
        ]
        return f"average 3σ of what was run: {', '.join(averages)}"

    def title(self) -> str:
        """Return which run stands beside which plan."""
        return one_line(f"{self.run} beside {self.trajectory}")

    def notes(self) -> list[str]:
        """Return the averages and the warnings, a line each."""
        return [self.summary(), *(f"attention: {text}" for text in self.warnings)]


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
    recorded = load(path, experiment.recording, band=estimator_spec.band, marks=False)
    run, warnings = recorded.run, list(recorded.run.warnings)
    followed = follow(run, spec)
    lag = followed.common_lag
    measured = measured_trajectory(run, spec, followed, estimator_spec.band)
    covered = min(run.t[-1] - run.t[0], lag + spec.duration) - max(0.0, lag)
    if covered < 0.98 * spec.duration:
        warnings.append(f"the run holds {covered:.4g} s of the plan's {spec.duration:g} s: the rest counts as rest")
    trajectories = {name: measured, "plan": spec} if name != "plan" else {name: measured, "the plan": spec}
    of_plan = list(trajectories)[1]
    result = law(dataclasses.replace(experiment, trajectories=trajectories, document={}), None, estimator_spec.name)
    breakdown = result[name, estimator_spec.name]
    return Achieved(
        trajectory=name, run=run.name, followed=followed,
        stillness=stillness_of(run, experiment, spec, measured, lag, estimator_spec.band),
        planned_three_sigma=result[of_plan, estimator_spec.name].total.three_sigma,
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


FOLLOWED = "The run's angular velocity is fitted by the planned one: amplitude, lag, and offset of each axis."
LAG = "lag: counted from the run's first sample; ± is a standard error, from the residuals."
PREDICTED = "By the law of propagation, the measured angular velocity in place of the planned one."
