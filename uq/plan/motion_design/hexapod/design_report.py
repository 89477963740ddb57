"""The report of a design: its budget beside known trajectories, sensors, durations, files."""

import dataclasses
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import msgspec
import numpy as np

from identify.display.reporting import plain
from identify.exceptions import explains_names
from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE
from identify.rigid_body.inertial_parameters import by_component
from uq.analysis.propagation.experiment_law import law
from uq.analysis.propagation.law_result import LawStatistics
from uq.experiment.experiment import Experiment, TrajectorySpec
from uq.experiment.experiment_tables import left_out_note
from uq.files.provenance import provenance
from uq.monte_carlo.campaign.statistics import Breakdown, large_mean_error
from uq.plan.measurement.required_duration import GOALS, Duration, average, growth_of, half_of, required_duration
from uq.plan.measurement.sensor_worth import BOTH, SensorWorth, sensor_worth
from uq.plan.motion_design.hexapod.design import Design
from uq.plan.motion_design.hexapod.designed_experiment import NAME, designed_files
from uq.plan.motion_design.hexapod.reference_trajectory import differentiator
from uq.plan.motion_design.report import MotionReport
from uq.progress_bar import Progress, progress_of

BESIDE = ("T1", "T2", "T4")
"""Trajectories of the experiment that stand beside the design, where there are such."""


@dataclass(frozen=True, repr=False)
class DesignReport(MotionReport):
    """A design and what its report states.

    Example: ``design_report(design(experiment)).to_frame().loc["designed"]``.
    """

    unit_of_columns = "kg·m²"

    kind = "inertia design"
    design: Design
    goal: str
    laws: Mapping[str, Breakdown[LawStatistics]]
    """Law of propagation by trajectory: ``designed`` first, then ``reference`` (rescaled and retimed), then others."""
    bands: Mapping[str, float]
    """Highest frequency that each trajectory's differentiator is matched to [Hz]."""
    sensors: SensorWorth
    durations: tuple[Duration, ...]
    contents: Mapping[str, bytes]
    """Contents of the files by name: ``designed.toml`` and the files that it names."""
    provenance: Mapping[str, Any]

    def averages(self, trajectory: str, objective: str = "3sigma") -> dict[str, float]:
        """Return the average 3σ of moments and products by the law [kg·m²], or that of 3√(σ² + mean error²) (rms)."""
        total = self.laws[trajectory].total
        widths = total.three_rms if objective == "rms" else total.three_sigma
        return {goal: average(widths, goal) for goal in BOTH}

    @property
    def bound(self) -> dict[str, float | None]:
        """The least average 3σ that any motion under these limits reaches [kg·m²]; None: not known."""
        bound = self.design.bound
        return {goal: None if bound is None else float(getattr(bound, goal)) for goal in BOTH}

    def records(self) -> list[dict[str, Any]]:
        """Return predicted 3σ, mean error and 3√(σ² + mean error²) by trajectory and component, in kg·m²."""
        return [
            {"trajectory": name, "component": component}
            | {key: getattr(law.total, key)[k] for key in ("three_sigma", "mean_error", "three_rms")}
            for name, law in self.laws.items()
            for k, component in enumerate(COMPONENTS)
        ]

    def noise_share(self, goal: str) -> float:
        """Return the part of the design's variance that the load cell's white noise makes, which the bound counts."""
        shares = self.source_shares(goal)
        return sum(shares[s.name] for s in self.design.experiment.sources if s.white and not s.of_gyro)

    def source_shares(self, goal: str) -> dict[str, float]:
        """Return each source's part in the sum of the goal's variances, of the design."""
        law, components = self.laws[NAME], list(GOALS[goal])
        total = np.diag(law.total.covariance)[components].sum()
        return {name: np.diag(s.covariance)[components].sum() / total for name, s in law.sources.items()}

    @property
    def warnings(self) -> list[str]:
        """Warnings: mean errors of design and reference that exceed their 3σ, and their source."""
        excess = [text for name in (NAME, "reference") for text in large_mean_error(name, self.laws[name].total)]
        left_out = left_out_note(self.design.experiment.left_out)
        if not excess:
            return left_out
        sources = {name: np.abs(case.mean_error).max() for name, case in self.laws[NAME].sources.items()}
        most = max(sources, key=lambda name: sources[name]).replace("_", " ")
        cure = "" if self.design.objective == "rms" else " The objective rms designs against it."
        return [
            *left_out,
            *excess,
            f"Most of the mean error is that of {most}, which a longer run does not reduce.{cure}",
        ]

    def content(self) -> dict[str, Any]:
        """Return what result.json says of this design alone."""
        design = self.design
        return {
            "objective": design.objective,
            "improved": design.improved,
            "trajectories": {
                name: {
                    "band_Hz": self.bands[name],
                    **breakdown.to_dict(),
                    **{
                        key: {goal: GRAM_METRE * x for goal, x in self.averages(name, objective).items()}
                        for key, objective in (("average_three_sigma", "3sigma"), ("average_three_rms", "rms"))
                    },
                }
                for name, breakdown in self.laws.items()
            },
            "promised_three_sigma": by_component(GRAM_METRE * design.expanded),
            "promised_three_sigma_reference": by_component(GRAM_METRE * design.reference.expanded),
            "promised_mean_error": by_component(GRAM_METRE * design.mean_error),
            "promised_mean_error_reference": by_component(GRAM_METRE * design.reference.mean_error),
            "bound": {goal: None if least is None else GRAM_METRE * least for goal, least in self.bound.items()},
            "bound_relaxes": [] if design.bound is None else list(design.bound.relaxes),
            "limits": [
                plain({"quantity": peak.quantity, "share": peak.share, "part": peak.channel, "t": peak.t})
                for peak in design.peaks
            ],
            "active": [str(peak) for peak in design.active],
            "starts": [plain(start) for start in design.starts],
            "sensors": self.sensors.to_dict(),
            "durations": [duration.to_dict() for duration in self.durations],
        }


@explains_names
def design_report(
    design: Design, *, goal: str = "all", targets: Sequence[float] = (), progress: Progress | bool | None = None
) -> DesignReport:
    """Say everything of a design: budgets by the law, sensors, durations, files.

    Args:
        design: by :func:`uq.plan.motion_design.hexapod.design.design`.
        goal: what it was designed for.
        targets: average 3σ of moments and of products whose durations are wanted [kg·m²]; none: half of the
            design's, to two digits.
        progress: called with what is being done, the steps done and the steps in all; True: a bar.

    Raises:
        ExperimentError: a source that the law cannot take, or an experiment that is of no file.
    """
    tell = progress_of(progress, "steps")
    experiment = design.experiment
    files = designed_files(experiment, design.spec, design.band)
    compared = {name: experiment.trajectories[name] for name in BESIDE if name in experiment.trajectories}
    specs = {NAME: design.spec, "reference": design.reference.spec, **compared}
    bands = {name: design.band if name == NAME else spec.trajectory.highest_frequency for name, spec in specs.items()}
    laws = {}
    for number, (name, spec) in enumerate(specs.items()):
        tell("budgets", number, len(specs))
        laws[name] = law(_matched(experiment, name, spec, bands[name]), name)[name, NAME]
    matched = _matched(experiment, NAME, design.spec, design.band)
    tell("sensors", 0, 1)
    sensors = sensor_worth(matched, NAME)
    growth = growth_of(matched, NAME)
    durations = []
    for k, wanted in enumerate(BOTH):
        tell("durations", k, len(BOTH))
        half = half_of(laws[NAME].total.three_sigma, wanted)
        durations += [required_duration(matched, target, goal=wanted, growth=growth) for target in targets or (half,)]
    tell("durations", len(BOTH), len(BOTH))
    record = provenance(**experiment.inputs(), goal=goal)
    return DesignReport(
        design=design, goal=goal, laws=laws, bands=bands, sensors=sensors, durations=tuple(durations), contents=files,
        provenance=record,
    )  # fmt: skip


def _matched(experiment: Experiment, name: str, spec: TrajectorySpec, band: float) -> Experiment:
    """The experiment with one trajectory and a differentiator matched to its band."""
    recording = msgspec.structs.replace(experiment.recording, estimator=None)
    return dataclasses.replace(
        experiment, trajectories={name: spec}, estimators=(differentiator(band),), recording=recording, document={}
    )
