"""The report of a design, computed: its budget beside known trajectories, sensors, durations, files."""

import dataclasses
from collections.abc import Sequence

import msgspec
import numpy as np

from identify.exceptions import explains_names
from uq.experiment.experiment import Experiment, TrajectorySpec
from uq.files.provenance import provenance
from uq.motion_design.hexapod.design import Design
from uq.motion_design.hexapod.design_result import GOALS, DesignReport
from uq.motion_design.hexapod.designed_experiment import NAME, designed_files
from uq.motion_design.hexapod.reference_trajectory import differentiator
from uq.planning.required_duration import growth_of, half_of, required_duration
from uq.planning.sensor_worth import sensor_worth
from uq.propagation.experiment_law import law
from uq.trials.progress_bar import Progress, progress_of

BESIDE = ("T1", "T2", "T4")
"""Trajectories of the experiment that stand beside the design, where there are such."""


@explains_names
def design_report(
    design: Design, *, goal: str = "all", targets: Sequence[float] = (), progress: Progress | bool | None = None
) -> DesignReport:
    """Say everything of a design: budgets by the law, sensors, durations, files.

    Args:
        design: by :func:`uq.motion_design.hexapod.design.design`.
        goal: what it was designed for.
        targets: average 3σ of moments and of products whose durations are wanted [kg·m²]; none: half of the
            design's, to two digits.
        progress: called with what is being done, the steps done and the steps in all; True: a bar.

    Raises:
        ExperimentError: a source that the law cannot take, or an experiment that is of no file.
    """
    tell = progress_of(progress, "steps") or (lambda *_: None)
    experiment = design.experiment
    files = designed_files(experiment, design.spec, design.band)
    beside = {name: experiment.trajectories[name] for name in BESIDE if name in experiment.trajectories}
    specs = {NAME: design.spec, "reference": design.reference, **beside}
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
    for k, wanted in enumerate(GOALS):
        tell("durations", k, len(GOALS))
        half = half_of(np.diag(laws[NAME].total.covariance), wanted)
        durations += [required_duration(matched, target, goal=wanted, growth=growth) for target in targets or (half,)]
    tell("durations", len(GOALS), len(GOALS))
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
