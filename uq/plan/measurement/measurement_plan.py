"""Plan of a measurement with one trajectory and estimator: the sensor worth improving, and the required duration."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from identify.display.reporting import Result
from uq.analysis.propagation.experiment_law import law
from uq.experiment.experiment import Experiment
from uq.experiment.experiment_tables import left_out_note
from uq.files.provenance import provenance
from uq.monte_carlo.campaign.statistics import large_mean_error
from uq.plan.measurement.required_duration import Duration, growth_of, half_of, required_duration
from uq.plan.measurement.sensor_worth import BOTH, SensorWorth, sensor_worth
from uq.progress_bar import Progress, progress_of


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

    def records(self) -> list[dict[str, Any]]:
        """Return what halving each source is worth, by source and component."""
        return self.sensors.records()

    def to_dict(self) -> dict[str, Any]:
        """Return the content of result.json: sensors in g·m², durations in the unit that they name."""
        return {
            **self.form(),
            "unit": "g*m^2",
            "answers": self.title().splitlines(),
            "sensors": self.sensors.to_dict(),
            "durations": [duration.to_dict() for duration in self.durations],
            "remarks": list(self.sensors.remarks),
            "warnings": list(self.warnings),
            "provenance": dict(self.provenance),
        }


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
    tell = progress_of(progress, "steps")
    name, _ = experiment.select(trajectory)
    chosen = experiment.estimator(estimator).name
    tell("law", 0, 1)
    total = law(experiment, name, chosen)[name, chosen].total
    tell("sensors", 0, 1)
    sensors = sensor_worth(experiment, name, chosen)
    wanted = [(goal, target) for goal in goals for target in targets or (half_of(total.three_sigma, goal),)]
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
