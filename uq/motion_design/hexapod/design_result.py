"""The report of a design: its budget beside known trajectories, its limits, sensors, durations, files."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from identify.reporting import Drawing, plain
from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE, MOMENTS, PRODUCTS
from identify.rounding import common, fixed, significant
from identify.text_tables import Table
from uq.campaign.statistics import Breakdown, large_mean_error
from uq.experiment.experiment_tables import left_out_note
from uq.motion_design.hexapod.design import Design
from uq.motion_design.hexapod.designed_experiment import NAME
from uq.motion_design.report import MotionReport, by_component, peak_cells
from uq.planning.required_duration import Duration, average
from uq.planning.sensor_worth import SensorWorth
from uq.propagation.law_result import LawStatistics
from uq.report.tables.planning import duration_table

GOALS = ("moments", "products")
RULES = 0.5
"""Part of the variance from which on the load cell's noise, which alone the bound counts, makes the bound tell."""
OF_THE_CELL = (0, 1)
"""Signals of the load cell, force and moment, as ``Source.signal`` numbers them."""


@dataclass(frozen=True, repr=False)
class DesignReport(MotionReport):
    """A design and what its report states.

    Example: ``design_report(design(experiment)).to_frame().loc["designed"]``.
    """

    kind = "inertia design"
    heading = "The best experiment that a platform can run"
    method = (
        "3σ is three standard deviations, the mean error the expected estimate less the truth, both by the law of "
        "propagation with every declared source; each trajectory's "
        "differentiator is matched to its own band. The reference is the named trajectory at the size and speed that "
        "promise most under the same limits. Confirm it: inertia montecarlo designed.toml --trajectory designed."
    )
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
        return {goal: average((widths / 3) ** 2, goal) for goal in GOALS}

    @property
    def bound(self) -> dict[str, float | None]:
        """The least average 3σ that any motion under these limits reaches [kg·m²]; None: not known."""
        bound = self.design.bound
        return {goal: None if bound is None else float(getattr(bound, goal)) for goal in GOALS}

    def tables(self) -> list[Table]:
        """Return predicted 3σ, the use of each limit, what each sensor is worth, and durations."""
        (sensors,) = self.sensors.tables()
        sensors = replace(sensors, caption="Which sensor should I buy?", note=SENSOR_NOTE)
        return [self.trajectory_table(), self.limit_table(), sensors, duration_table(self.durations)]

    def records(self) -> list[dict[str, Any]]:
        """Return predicted 3σ, mean error and 3√(σ² + mean error²) by trajectory and component, in g·m²."""
        return [
            {"trajectory": name, "component": component}
            | {key: GRAM_METRE * getattr(law.total, key)[k] for key in ("three_sigma", "mean_error", "three_rms")}
            for name, law in self.laws.items()
            for k, component in enumerate(COMPONENTS)
        ]

    def drawings(self) -> list[Drawing]:
        """Return platform, motion, legs, coverage of the sphere, budgets and durations."""
        from uq.motion_design.hexapod.design_drawings import design_drawings

        return design_drawings(self.design, self.laws, self.bound, self.durations)

    def trajectory_table(self) -> Table:
        """Return 3σ, mean error and both together by trajectory and component, averages, changes."""
        rows = []
        for name, breakdown in self.laws.items():
            total = breakdown.total
            for k, (text, values, objective) in enumerate((
                ("3σ", total.three_sigma, "3sigma"), ("mean error", total.mean_error, None),
                ("3 rms", total.three_rms, "rms"),
            )):  # fmt: skip
                head = ["", text, ""] if k else [name, text, significant(self.bands[name])]
                last = ["", "", "", ""] if objective is None else self._against_reference(name, objective)
                shown = common(GRAM_METRE * values) if objective is None else map(_figure, values)
                rows.append([*head, *shown, *last])
        base, cells = self.averages("reference"), []
        for goal, least in self.bound.items():
            if least is not None:
                comparable = self.noise_share(goal) >= RULES
                cells += [_figure(least), _change(least, base[goal]) if comparable else ""]
        if cells:
            rows.append(["bound", "3σ", "", *("" for _ in COMPONENTS), *cells])
        head = ["g·m²", "", "band, Hz", *COMPONENTS, "moments", "change, %", "products", "change, %"]
        return Table("Predicted 3σ and mean error of each trajectory, g·m²", head, rows, BUDGET_NOTE)

    def _against_reference(self, name: str, objective: str) -> list[str]:
        """Averages of moments and products, each with its change against the reference's."""
        averages, base = self.averages(name, objective), self.averages("reference", objective)
        return [cell for goal in GOALS for cell in (_figure(averages[goal]), _change(averages[goal], base[goal]))]

    def source_table(self) -> Table:
        """Return the average 3σ of each source alone, by trajectory."""
        head = ["alone, g·m²", *(f"{name}, {goal}" for name in self.laws for goal in GOALS)]
        rows = []
        for source in next(iter(self.laws.values())).sources:
            variances = [np.diag(breakdown.sources[source].covariance) for breakdown in self.laws.values()]
            cells = [_figure(average(variance, goal)) for variance in variances for goal in GOALS]
            rows.append([source.replace("_", " "), *cells])
        return Table("Each source alone: average 3σ, g·m²", head, rows)

    def limit_table(self) -> Table:
        """Return each limit's largest use over the whole run."""
        rows = [peak_cells(peak, f"{peak.channel + 1}") for peak in self.design.peaks]
        return Table("What each limit is used to", ["limit", "leg or axis", "at, s", "used, %"], rows, LIMIT_NOTE)

    def verdicts(self) -> list[str]:
        """Return what the design says in words."""
        sentences = [
            f"Average {WIDTHS[objective]} {self._averages_in_words(objective)}, against the reference{end}"
            for objective, end in (("rms", "."), ("3sigma", ", by the law with every declared source."))
        ]
        if not self.design.improved:
            sentences.append("No design beat the reference: the reference itself is returned.")
        names = sorted({peak.quantity.replace("_", " ") for peak in self.design.active})
        sentences.append(f"What limits it: {', '.join(names)}." if names else "No limit is used up.")
        return [*sentences, *self._bound_in_words()]

    def _bound_in_words(self) -> list[str]:
        """Say what no motion can beat, where the noise that the bound counts rules; else which source rules."""
        told = {goal: f"{_figure(least)} g·m²" for goal, least in self.bound.items() if least is not None}
        ruled = [f"{figure} ({goal})" for goal, figure in told.items() if self.noise_share(goal) >= RULES]
        sentences = [f"No motion under these limits promises a 3σ of less than {' and '.join(ruled)}."] if ruled else []
        for goal, figure in told.items():
            if self.noise_share(goal) < RULES:
                shares = self._shares(goal)
                name = max(shares, key=lambda source: shares[source])
                rules = f"{name.replace('_', ' ')} makes {100 * shares[name]:.0f} % of the variance"
                counts = f"The bound of the {goal}, {figure}, counts the load cell's noise alone"
                sentences.append(f"{counts}, but {rules}: it says little.")
        return sentences

    def noise_share(self, goal: str) -> float:
        """Return the part of the design's variance that the load cell's white noise makes, which the bound counts."""
        shares = self._shares(goal)
        return sum(shares[s.name] for s in self.design.experiment.sources if s.white and s.signal in OF_THE_CELL)

    def _shares(self, goal: str) -> dict[str, float]:
        """Each source's part in the sum of the goal's variances, of the design."""
        law, components = self.laws[NAME], list(MOMENTS if goal == "moments" else PRODUCTS)
        total = np.diag(law.total.covariance)[components].sum()
        return {name: np.diag(s.covariance)[components].sum() / total for name, s in law.sources.items()}

    def _averages_in_words(self, objective: str) -> str:
        cells = self._against_reference(NAME, objective)
        return " and ".join(f"of the {goal} {cells[2 * k]} g·m² ({cells[2 * k + 1]} %)" for k, goal in enumerate(GOALS))

    def findings(self) -> list[str]:
        """Return what a reader must not miss: mean errors of design and reference that exceed their 3σ, and of what."""
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

    def notes(self) -> list[str]:
        """Return the findings, a line each, and where less of a source makes the 3σ larger."""
        return [*super().notes(), *self.sensors.notes()]

    def content(self) -> dict[str, Any]:
        """Return what result.json says of this design alone."""
        design = self.design
        return {
            "objective": design.objective,
            "improved": design.improved,
            "trajectories": {
                name: {
                    "band_Hz": self.bands[name],
                    "groups": {group: s.to_dict() for group, s in breakdown.groups.items()},
                    "sources": {source: s.to_dict() for source, s in breakdown.sources.items()},
                    **{
                        key: {goal: GRAM_METRE * x for goal, x in self.averages(name, objective).items()}
                        for key, objective in (("average_three_sigma", "3sigma"), ("average_three_rms", "rms"))
                    },
                }
                for name, breakdown in self.laws.items()
            },
            "promised_three_sigma": by_component(GRAM_METRE * design.expanded),
            "promised_three_sigma_reference": by_component(GRAM_METRE * design.expanded_reference),
            "promised_mean_error": by_component(GRAM_METRE * design.mean_error),
            "promised_mean_error_reference": by_component(GRAM_METRE * design.mean_error_reference),
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

    def remarks(self) -> list[str]:
        """Return what the sensors' table remarks, that nothing beat the reference, and limits that are exceeded."""
        stayed = "No design beat the reference within these limits: the reference is returned."
        exceeded = [f"A limit is exceeded: {peak}." for peak in self.design.peaks if peak.share > 1 + 1e-6]
        return [*self.sensors.remarks, *([] if self.design.improved else [stayed]), *exceeded]

    def details(self) -> list[Table]:
        """Return 3σ by source, and what each start led to."""
        return [self.source_table(), self.search_table()]

    def assumptions(self) -> Sequence[str]:
        """Return what the prediction assumes, and what the bound leaves out."""
        relaxed = () if self.design.bound is None else self.design.bound.relaxes
        return [*ASSUMPTIONS, *(f"The bound leaves out: {text}." for text in relaxed)]

    def search_table(self) -> Table:
        """Return what each start of the search led to."""
        rows = [
            [f"{k}", f"{start.goal:.4f}", "yes" if start.met else "no"]
            for k, start in enumerate(self.design.starts, start=1)
        ]
        return Table("Searches", ["start", "goal, reference = 1", "limits met"], rows)


def _figure(value: float) -> str:
    return significant(GRAM_METRE * value)


def _change(value: float, base: float) -> str:
    return fixed(100 * (value / base - 1), 1)


WIDTHS = {"rms": "3√(σ² + mean error²)", "3sigma": "3σ"}
BUDGET_NOTE = (
    "3 rms: 3√(σ² + mean error²), three times the root mean square error. change: of the average, against the "
    "reference's. A longer run makes 3σ smaller, but not the mean error."
)
LIMIT_NOTE = "Over the whole run with its ramps, on a grid ten times finer than the search's; from 98 % on it limits."
SENSOR_NOTE = "By component: derivative of ln 3σ by ln sigma. 0.8 says that 1 % less of this sigma leaves 0.8 % less."
ASSUMPTIONS = (
    "The body is rigid; the platform runs the trajectory as commanded, and its legs turn in perfect joints.",
    "Leg forces are those of body, plate and legs by d'Alembert's principle, without friction.",
    "Every error source is as declared; the law of propagation takes its first and second order.",
)
