"""What is to be said of a design: its budget beside known trajectories, its limits, sensors, durations, files."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import jax
import jax.numpy as jnp
import msgspec
import numpy as np

from identify.motion.leg_limits import effort, platform_motion
from identify.rigid_body.inertia import COMPONENTS
from identify.signals.estimator_spec import EstimatorSpec
from identify.text_tables import fixed, html_table, text_table
from uq.campaign.statistics import GRAM_METRE, Breakdown
from uq.excitation.design import Design
from uq.excitation.designed_experiment import NAME, designed_files
from uq.excitation.platform_scene import FRAMES, Scene, scene
from uq.excitation.reference_trajectory import highest_frequency
from uq.experiment.experiment import Experiment, ExperimentError, TrajectorySpec
from uq.files.provenance import provenance
from uq.planning.required_duration import Duration, average, growth_of, required_duration
from uq.planning.sensor_worth import SensorWorth, sensor_worth
from uq.propagation.experiment_law import law
from uq.propagation.law_result import LawStatistics

SHOWN = 10.0
"""How much of the motion figures show, from its middle [s]."""
PLAYED = 5.0
"""How much the moving drawing plays [s]."""
RATE = 100.0
"""Of the instants that figures draw [Hz]."""
BESIDE = ("T1", "T2", "T4")
"""Trajectories of the experiment that stand beside the design, where there are such."""
GOALS = ("moments", "products")
Progress = Callable[[str, int, int], None]


@dataclass(frozen=True)
class DesignReport:
    """A design and everything that is to be said of it."""

    design: Design
    goal: str
    laws: Mapping[str, Breakdown[LawStatistics]]
    """By trajectory: ``designed`` first, then ``reference`` (rescaled and retimed), then others of the experiment."""
    bands: Mapping[str, float]
    """Highest frequency that each trajectory's differentiator is matched to [Hz]."""
    sensors: SensorWorth
    durations: tuple[Duration, ...]
    files_of: Mapping[str, bytes] = field(repr=False)
    """``designed.toml`` and what it names."""
    provenance: Mapping[str, Any] = field(repr=False)
    name: str = "design"

    def averages(self, trajectory: str) -> dict[str, float]:
        """Return the average 3σ of moments and products by the law [kg·m²]."""
        return {goal: average(np.diag(self.laws[trajectory].total.covariance), goal) for goal in GOALS}

    @property
    def bound(self) -> dict[str, float | None]:
        """The least average 3σ that any motion under these limits reaches [kg·m²]; None: not known."""
        bound = self.design.bound
        return {goal: None if bound is None else float(getattr(bound, goal)) for goal in GOALS}

    def rows(self) -> tuple[list[str], list[list[str]]]:
        """Return head and rows: 3σ of each trajectory by component, averages, change against the reference."""
        base, rows = self.averages("reference"), []
        for name, found in self.laws.items():
            own = self.averages(name)
            cells = [f"{GRAM_METRE * x:.3g}" for x in found.total.three_sigma]
            for goal in GOALS:
                cells += [f"{GRAM_METRE * own[goal]:.3g}", _change(own[goal], base[goal])]
            rows.append([name, f"{self.bands[name]:.3g}", *cells])
        pairs = [(least, base[goal]) for goal, least in self.bound.items() if least is not None]
        if pairs:
            cells = [cell for pair in pairs for cell in (f"{GRAM_METRE * pair[0]:.3g}", _change(*pair))]
            rows.append(["bound", "", *("" for _ in COMPONENTS), *cells])
        return ["3σ, g·m²", "band, Hz", *COMPONENTS, "moments", "change, %", "products", "change, %"], rows

    def source_rows(self) -> tuple[list[str], list[list[str]]]:
        """Return head and rows: average 3σ of each source alone, by trajectory."""
        head = ["alone, g·m²", *(f"{name}, {goal}" for name in self.laws for goal in GOALS)]
        rows = []
        for source in next(iter(self.laws.values())).sources:
            variances = [np.diag(found.sources[source].covariance) for found in self.laws.values()]
            cells = [f"{GRAM_METRE * average(variance, goal):.3g}" for variance in variances for goal in GOALS]
            rows.append([source.replace("_", " "), *cells])
        return head, rows

    def limit_rows(self) -> tuple[list[str], list[list[str]]]:
        """Return head and rows: each limit's largest use over the whole run."""
        rows = [
            [peak.quantity.replace("_", " "), f"{peak.part + 1}", fixed(peak.t, 3), fixed(100 * peak.share, 1)]
            for peak in self.design.peaks
        ]
        return ["limit", "leg or axis", "at, s", "used, %"], rows

    def duration_rows(self) -> tuple[list[str], list[list[str]]]:
        """Return head and rows: what each target takes."""
        rows = []
        for one in self.durations:
            wanted = [one.goal, f"{GRAM_METRE * one.target:.3g}", f"{GRAM_METRE * one.now:.3g}"]
            if one.seconds is None:
                rows.append([*wanted, "–", f"out of reach: {one.forbids} leaves {GRAM_METRE * one.reached:.3g} g·m²"])
            else:
                rows.append([*wanted, f"{one.seconds:.4g}", ""])
        return ["average 3σ of", "target, g·m²", "now, g·m²", "duration, s", "why"], rows

    def verdicts(self) -> list[str]:
        """Return what the design says in words."""
        own, base = self.averages(NAME), self.averages("reference")
        parts = [
            f"of the {goal} {GRAM_METRE * own[goal]:.3g} g·m² ({_change(own[goal], base[goal])} %)" for goal in GOALS
        ]
        said = [f"Average 3σ {' and '.join(parts)}, against the reference, by the law with every declared source."]
        if not self.design.improved:
            said.append("No design beat the reference: the reference itself is returned.")
        names = sorted({peak.quantity.replace("_", " ") for peak in self.design.active})
        said.append(f"What limits it: {', '.join(names)}." if names else "No limit is used up.")
        if self.design.bound is not None:
            bounds = [
                f"{GRAM_METRE * least:.3g} g·m² ({goal})" for goal, least in self.bound.items() if least is not None
            ]
            said.append(f"No motion under these limits promises less than {' and '.join(bounds)}.")
        return said

    def files(self) -> dict[str, bytes]:
        """Return the files' bytes by name."""
        return dict(self.files_of)

    def to_dict(self) -> dict[str, Any]:
        """Return the content of result.json, in g·m²."""
        design = self.design
        return {
            "unit": "g*m^2",
            "goal": self.goal,
            "improved": design.improved,
            "trajectories": {
                name: {
                    "band_Hz": self.bands[name],
                    "groups": {group: s.to_dict() for group, s in found.groups.items()},
                    "sources": {source: s.to_dict() for source, s in found.sources.items()},
                    "average_three_sigma": {goal: GRAM_METRE * x for goal, x in self.averages(name).items()},
                }
                for name, found in self.laws.items()
            },
            "promised_three_sigma": _by_component(GRAM_METRE * design.expanded),
            "promised_three_sigma_reference": _by_component(GRAM_METRE * design.expanded_reference),
            "bound": {goal: None if least is None else GRAM_METRE * least for goal, least in self.bound.items()},
            "bound_relaxes": [] if design.bound is None else list(design.bound.relaxes),
            "limits": [_plain(peak._asdict()) for peak in design.peaks],
            "active": [str(peak) for peak in design.active],
            "starts": [_plain(dataclasses.asdict(start)) for start in design.starts],
            "sensors": self.sensors.to_dict(),
            "durations": [one.to_dict() for one in self.durations],
            "files": list(self.files_of),
            "provenance": dict(self.provenance),
        }

    def __repr__(self) -> str:
        tables = (self.rows(), self.limit_rows(), self.sensors.rows(), self.duration_rows())
        return "\n\n".join(["\n".join(self.verdicts()), *(text_table(*table) for table in tables)])

    def _repr_html_(self) -> str:
        said = "".join(f"<p>{text}</p>" for text in self.verdicts())
        return said + html_table(*self.rows(), caption="Predicted 3σ") + html_table(*self.limit_rows())

    # --- figures ---

    def stretch(self) -> tuple[Any, Any]:
        """Return motion and effort of the design at the instants that figures show."""
        spec, experiment = self.design.spec, self.design.experiment
        shown = min(SHOWN, spec.duration)
        last = np.ceil((spec.duration + shown) / 2 * RATE) / RATE
        t = jnp.arange(0.0, last, 1 / RATE)
        still = jnp.asarray(experiment.r_cg_from_omb) if spec.still == "cg" else jnp.zeros(3)
        whole = platform_motion(experiment.platform, spec.trajectory, t, still)
        motion = jax.tree.map(lambda x: x[len(t) - round(shown * RATE) :], whole)
        found = effort(
            experiment.platform, experiment.body, jnp.asarray(experiment.r_cg_from_omb), motion,
            jnp.asarray(experiment.gravity),
        )  # fmt: skip
        return motion, found

    def scene(self, motion: Any) -> Scene:
        """Return what the drawing of the platform shows."""
        experiment, step = self.design.experiment, round(RATE / FRAMES)
        part = slice(0, round(PLAYED * RATE) + 1, step)
        position, rotation = (np.asarray(x)[part] for x in motion.pose)
        seconds = (len(position) - 1) / FRAMES
        return scene(experiment.platform, experiment.body, experiment.r_cg_from_omb, position, rotation, seconds)


def _plain(content: Mapping[str, Any]) -> dict[str, Any]:
    """A mapping whose figures JSON can hold."""
    plain = {key: value.item() if hasattr(value, "item") else value for key, value in content.items()}
    return {key: None if isinstance(x, float) and not np.isfinite(x) else x for key, x in plain.items()}


def _by_component(values: np.ndarray) -> dict[str, float]:
    return dict(zip(COMPONENTS, np.asarray(values).tolist(), strict=True))


def _change(own: float, base: float) -> str:
    return fixed(100 * (own / base - 1), 1)


def design_report(
    design: Design, *, goal: str = "all", targets: Sequence[float] = (), progress: Progress | None = None
) -> DesignReport:
    """Say everything of a design: budgets by the law, sensors, durations, files.

    Args:
        design: by :func:`uq.excitation.design.design`.
        goal: what it was designed for.
        targets: average 3σ of moments and of products whose durations are wanted [kg·m²]; none: half of the design's.
        progress: called with what is being done, the steps done and the steps in all.

    Raises:
        ExperimentError: a source that the law cannot take, or an experiment that is of no file.
    """
    tell = progress or (lambda *_: None)
    experiment = design.experiment
    files = designed_files(experiment, design.spec, design.band)
    beside = {name: experiment.trajectories[name] for name in BESIDE if name in experiment.trajectories}
    specs = {NAME: design.spec, "reference": design.reference, **beside}
    bands = {name: design.band if name == NAME else highest_frequency(spec) for name, spec in specs.items()}
    laws = {}
    for number, (name, spec) in enumerate(specs.items()):
        tell("budgets", number, len(specs))
        laws[name] = law(_matched(experiment, name, spec, bands[name]), name)[name, NAME]
    own = _matched(experiment, NAME, design.spec, design.band)
    tell("sensors", 0, 1)
    sensors = sensor_worth(own, NAME)
    growth = growth_of(own, NAME)
    durations = []
    for k, wanted in enumerate(GOALS):
        tell("durations", k, len(GOALS))
        half = average(np.diag(laws[NAME].total.covariance), wanted) / 2
        durations += [required_duration(own, target, goal=wanted, growth=growth) for target in targets or (half,)]
    tell("durations", len(GOALS), len(GOALS))
    record = provenance(**experiment.inputs(), goal=goal)
    return DesignReport(design, goal, laws, bands, sensors, tuple(durations), files, record)


def check_rate(experiment: Experiment, reference: str | None = None) -> None:
    """Refuse, before a long search, a sample rate at which the designed motion cannot be differentiated.

    Args:
        experiment: with ``[platform.limits]``.
        reference: the trajectory whose sample rate the design takes; None for T1.

    Raises:
        ExperimentError: there is no such trajectory, or its rate is too low for the bandwidth.
    """
    name, spec = experiment.select(reference or "T1")
    band = np.inf if experiment.limits is None else experiment.limits.figures.bandwidth
    if np.isfinite(band):
        try:
            EstimatorSpec(NAME, "savitzky-golay", band).taps(spec.rate)
        except ValueError:
            raise ExperimentError(
                f"trajectory.{name}.rate is {spec.rate:g} Hz, too low to differentiate a motion of {band:g} Hz: raise "
                "it, or lower platform.limits.bandwidth"
            ) from None


def _matched(experiment: Experiment, name: str, spec: TrajectorySpec, band: float) -> Experiment:
    """The experiment with one trajectory and a differentiator matched to its band."""
    estimator = EstimatorSpec(NAME, "savitzky-golay", band)
    recording = msgspec.structs.replace(experiment.recording, estimator=None)
    return dataclasses.replace(
        experiment, trajectories={name: spec}, estimators=(estimator,), recording=recording, document={}
    )
