"""Plan of a measurement with one trajectory and estimator: the sensor worth improving, and the required duration."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from identify.reporting import Drawing, Result, Section
from identify.rigid_body.inertia import GRAM_METRE
from identify.rounding import significant
from identify.text_tables import Table
from uq.campaign.statistics import large_mean_error
from uq.experiment.experiment import Experiment
from uq.experiment.experiment_tables import left_out_note
from uq.files.provenance import provenance
from uq.planning.duration_figure import duration_drawing
from uq.planning.required_duration import (
    DURATION_NOTE,
    Duration,
    average,
    duration_table,
    growth_of,
    half_of,
    required_duration,
)
from uq.planning.sensor_worth import BOTH, SensorWorth, sensor_worth, signed_tenth
from uq.propagation.experiment_law import law
from uq.report.assumptions import source_assumptions
from uq.report.input_tables import source_tables
from uq.trials.progress_bar import Progress, progress_of


@dataclass(frozen=True, repr=False)
class MeasurementPlan(Result):
    """The worth of each source, and the durations that targets require.

    Example: ``plan_measurement(Experiment.load("barreto2016"), [1e-3]).sensors.best``.
    """

    kind = "inertia plan"
    sensors: SensorWorth
    durations: tuple[Duration, ...]
    warnings: tuple[str, ...] = ()
    provenance: Mapping[str, Any] = field(default_factory=dict)
    name: str = "plan"

    def title(self) -> str:
        """Return the answers, a line each."""
        return "\n".join(self.verdicts())

    def verdicts(self) -> list[str]:
        """Return what is now, what is worth most, and how long each target takes, in a sentence each."""
        sensors, seconds = self.sensors, self.durations[0].current_duration
        now = " and ".join(f"{_average(sensors.three_sigma, goal)} g·m² ({goal})" for goal in BOTH)
        best = sensors.sources.index(sensors.best)
        changes = " and ".join(
            f"{_average(sensors.halved[best], goal)} g·m² ({goal}, {signed_tenth(100 * change)} %)"
            for goal, change in zip(BOTH, sensors.changes()[best], strict=True)
        )
        where = f"{sensors.trajectory} of {seconds:g} s, {sensors.estimator}"
        return [
            f"Average 3σ now ({where}): {now}.",
            f"Worth most: {sensors.best.replace('_', ' ')}. With half of it, {changes}.",
            *(f"{duration.title()[0].upper()}{duration.title()[1:]}." for duration in self.durations),
        ]

    def tables(self) -> list[Table]:
        """Return what halving each source is worth on average, and what each target takes."""
        (sensors,) = self.sensors.overview()
        return [
            replace(sensors, caption="Which sensor is worth improving?", note=SENSOR_NOTE),
            duration_table(self.durations),
        ]

    def overview(self) -> list[Table]:
        """Return the first alone: the answers above it say how long."""
        return [replace(self.tables()[0], caption="")]

    def records(self) -> list[dict[str, Any]]:
        """Return what halving each source is worth, by source and component."""
        return self.sensors.records()

    def notes(self) -> list[str]:
        """Return remarks and warnings, a line each."""
        return [*self.sensors.notes(), *super().notes()]

    def drawings(self) -> list[Drawing]:
        """Return the average 3σ over the duration."""
        return [duration_drawing(self.durations)]

    def to_dict(self) -> dict[str, Any]:
        """Return the content of result.json: sensors in g·m², durations in the unit that they name."""
        return {
            **self.form(),
            "unit": "g*m^2",
            "answers": self.verdicts(),
            "sensors": self.sensors.to_dict(),
            "durations": [duration.to_dict() for duration in self.durations],
            "remarks": list(self.sensors.remarks),
            "warnings": list(self.warnings),
            "provenance": dict(self.provenance),
        }

    def section(self) -> Section:
        """Return its part of a report."""
        (by_component,), answers = self.sensors.tables(), self.verdicts()
        best, of_durations = answers[1], answers[2:]
        forbidden = [said for said, each in zip(of_durations, self.durations, strict=True) if not each.reachable]
        caption = "Each source halved, by component"
        return Section(
            title="Plan of a measurement",
            computed=[said for said in answers if said not in (best, *forbidden)] + [COMPUTED],
            findings=[*self.warnings, *forbidden, *self.sensors.remarks], tables=self.tables(),
            drawings=self.drawings(),
            details=[replace(by_component, caption=caption, note=DERIVATIVE_NOTE), *source_tables(self.provenance)],
            assumptions=[ASSUMPTION, *source_assumptions(self.provenance)], provenance=self.provenance, verdict=best,
            headline=2,
        )  # fmt: skip


def plan_measurement(
    experiment: Experiment,
    targets: Sequence[float] = (),
    *,
    goals: Sequence[str] = BOTH,
    trajectory: str | None = None,
    estimator: str | None = None,
    progress: Progress | bool | None = None,
) -> MeasurementPlan:
    """Return what each source is worth, and how long each target takes, by the law of propagation.

    Args:
        experiment: body, trajectory, sources, estimators; no platform is needed.
        targets: average 3σ that are wanted, of each of the goals [kg·m²]; none: half of what it is now, to two digits.
        goals: whose average: ``moments``, ``products``, components.
        trajectory: its name; None for the first.
        estimator: its name; None for the recording's, or the first.
        progress: called with what is being done, the steps done and the steps in all; True: a bar.

    Raises:
        ExperimentError: a target that is not above zero, an unknown name, sources that the law cannot take.
    """
    tell = progress_of(progress, "steps") or (lambda *_: None)
    name, _ = experiment.select(trajectory)
    chosen = experiment.estimator(estimator).name
    tell("law", 0, 1)
    total = law(experiment, name, chosen)[name, chosen].total
    tell("sensors", 0, 1)
    sensors = sensor_worth(experiment, name, chosen)
    wanted = [(goal, target) for goal in goals for target in targets or (half_of((total.three_sigma / 3) ** 2, goal),)]
    tell("durations", 0, len(wanted))
    growth = growth_of(experiment, name, chosen)
    durations = []
    for goal, target in wanted:
        durations.append(
            required_duration(experiment, target, goal=goal, trajectory=name, estimator=chosen, growth=growth)
        )
        tell("durations", len(durations), len(wanted))
    bias = [f"{text} A longer run does not reduce it." for text in large_mean_error(f"{name}, {chosen}", total)]
    warnings = (*left_out_note(experiment.left_out), *bias)
    return MeasurementPlan(sensors, tuple(durations), warnings, provenance(**experiment.inputs()))


def _average(three_sigma: np.ndarray, goal: str) -> str:
    return significant(GRAM_METRE * average((three_sigma / 3) ** 2, goal), 3)


COMPUTED = (
    "By the law of propagation with every declared source: 3σ is three standard deviations; an average is over three "
    f"moments or three products. {DURATION_NOTE}"
)
SENSOR_NOTE = "The average 3σ with this source's sigma halved, all others as they are."
DERIVATIVE_NOTE = (
    "By component: derivative of ln 3σ by ln sigma. 0.8 says that 1 % less of this sigma leaves 0.8 % less of the 3σ."
)
ASSUMPTION = "Every error source is as declared; the body is rigid and turns exactly as the trajectory says."
