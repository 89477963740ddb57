"""The report of an arm's design: predicted uncertainty beside common practice, limits, simulation, files."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from identify.reporting import Drawing, Result, Section, plain
from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE
from identify.rounding import fixed
from identify.text_tables import Table
from uq.arm.arm_design import ArmDesign
from uq.arm.joint_export import joint_files
from uq.arm.joint_search import Candidate
from uq.arm.mujoco_run import MujocoRun, simulated
from uq.arm.predicted_payload import average_expanded
from uq.files.output_folder import place
from uq.files.provenance import provenance
from uq.report.input_tables import source_tables

NAMES = {"designed": "designed", "random": "best random series", "single": "one joint at a time"}
TOLERATED = 0.02
"""Share by which the simulated joints may exceed a limit: they follow their command with error."""


@dataclass(frozen=True, repr=False)
class ArmDesignReport(Result):
    """A design of an arm's motion, its simulation and its files.

    Example: ``arm_report(design_arm(Experiment.load("arm.toml"))).files()``.
    """

    kind = "inertia design arm"
    design: ArmDesign
    run: MujocoRun
    contents: Mapping[str, bytes]
    """Bytes by file name."""
    provenance: Mapping[str, Any] = field(default_factory=dict)
    name: str = "design"

    def title(self) -> str:
        """Return the verdicts, a line each."""
        return "\n".join(self.verdicts())

    def verdicts(self) -> list[str]:
        """Return what the design says in words."""
        least = average_expanded(self.design.designed.covariance)
        changes = [
            f"{fixed(100 * (least[what] / average_expanded(self.design.motions['random'].covariance)[what] - 1), 1)} %"
            for what in least
        ]
        figures = [f"{GRAM_METRE * value:.3g} g·m²" for value in least.values()]
        contact = f"{len(self.run.contacts)} contacts" if self.run.contacts else "no contact"
        follows = max(self.run.tracking_error.tolist())
        return [
            f"Average 3σ of the moments {figures[0]} ({changes[0]}) and of the products {figures[1]} ({changes[1]}), "
            f"against the best random series of the same {self.design.duration:g} s.",
            f"Most used: {self.design.designed.peaks[0]}.",
            f"Simulated in MuJoCo: joints within {follows:.2g} rad or m of their command, {contact}.",
        ]

    def tables(self) -> list[Table]:
        """Return predicted 3σ of each motion, the use of each limit, and how the simulated joints follow."""
        return [self.motion_table(), self.limit_table(), self.joint_table()]

    def overview(self) -> list[Table]:
        """Return the same without captions."""
        return [replace(table, caption="") for table in self.tables()]

    def motion_table(self) -> Table:
        """Return the predicted 3σ of the ten parameters, by motion."""
        rows = []
        for name, candidate in self.design.motions.items():
            widths = 3 * np.sqrt(np.diag(candidate.covariance))
            averages = average_expanded(candidate.covariance).values()
            cells = [f"{1e3 * widths[0]:.3g}", f"{1e3 * widths[1:4].max():.3g}"]
            rows.append([NAMES[name], *cells, *(f"{GRAM_METRE * x:.3g}" for x in (*widths[4:], *averages))])
        head = ["3σ", "mass, g", "r_CG, mm", *(f"{name}, g·m²" for name in COMPONENTS), "moments", "products"]
        return Table("Predicted 3σ of each motion", head, rows, MOTION_NOTE)

    def limit_table(self) -> Table:
        """Return each limit's largest use by the command, and by the simulated arm."""
        ran = {peak.quantity: peak for peak in self.run.peaks}
        rows = []
        for peak in self.design.designed.peaks:
            seen = f"{100 * ran[peak.quantity].share:.1f}" if peak.quantity in ran else "–"
            what = peak.quantity.replace("_", " ")
            rows.append([what, peak.where, fixed(peak.t, 3), fixed(100 * peak.share, 1), seen])
        head = ["limit", "where", "at, s", "used, %", "simulated, %"]
        return Table("What each limit is used to", head, rows, LIMIT_NOTE)

    def joint_table(self) -> Table:
        """Return how far each simulated joint departs from its command."""
        arm = self.design.limits.arm
        units = [("mrad", "mm")[slides] for slides in arm.chain.prismatic]
        rows = [
            [name, f"{1e3 * error:.3g} {unit}"]
            for name, error, unit in zip(arm.names, self.run.tracking_error, units, strict=True)
        ]
        return Table("Largest distance of the simulated joints from their command", ["joint", "error"], rows)

    def findings(self) -> list[str]:
        """Return what a reader must not miss: contacts, exceeded limits, sources that do not count."""
        texts = [f"In the simulation {contact}: do not run this motion." for contact in self.run.contacts]
        texts += [f"In the simulation {peak}." for peak in self.run.peaks if peak.share > 1 + TOLERATED]
        if self.run.unseen:
            texts.append(f"The simulation sees no contact of {', '.join(self.run.unseen)}: MuJoCo reads no such mesh.")
        if self.design.noise.left_out:
            texts.append(
                "The prediction holds the white noise of force and moment alone; left out: "
                f"{', '.join(self.design.noise.left_out)}."
            )
        return texts

    def notes(self) -> list[str]:
        """Return the findings, a line each."""
        return [f"attention: {text}" for text in self.findings()]

    def records(self) -> list[dict[str, Any]]:
        """Return 3σ by motion and component, in g·m²."""
        return [
            {"motion": name, "component": component, "three_sigma": GRAM_METRE * 3 * float(np.sqrt(variance))}
            for name, candidate in self.design.motions.items()
            for component, variance in zip(COMPONENTS, np.diag(candidate.covariance)[4:], strict=True)
        ]

    def drawings(self) -> list[Drawing]:
        """Return the joints' positions and speeds over the run."""
        return [Drawing("joints", "The joints' positions and speeds, as commanded.", self._draw_joints)]

    def _draw_joints(self) -> Any:
        from uq.arm.joint_figure import joint_figure

        return joint_figure(self.design)

    def files(self) -> dict[str, bytes]:
        """Return the motion's files by name."""
        return dict(self.contents)

    def to_dict(self) -> dict[str, Any]:
        """Return the content of result.json, in g·m² where no unit is named."""
        design = self.design
        return {
            **self.form(),
            "unit": "g*m^2",
            "goal": design.goal,
            "duration_s": design.duration,
            "motions": {
                name: {
                    "three_sigma": dict(zip(COMPONENTS, _expanded(c)[4:].tolist(), strict=True)),
                    "average": {what: GRAM_METRE * value for what, value in average_expanded(c.covariance).items()},
                    "mass_three_sigma_kg": float(_expanded(c)[0]) / GRAM_METRE,
                    "cg_three_sigma_m": (_expanded(c)[1:4] / GRAM_METRE).tolist(),
                    "peaks": [plain(peak._asdict()) for peak in c.peaks],
                }
                for name, c in design.motions.items()
            },
            "starts": [{"goal": goal, "excess": excess} for goal, excess in design.starts],
            "simulation": {
                "tracking_error": dict(zip(design.limits.arm.names, self.run.tracking_error.tolist(), strict=True)),
                "peaks": [plain(peak._asdict()) for peak in self.run.peaks],
                "contacts": list(self.run.contacts),
            },
            "files": list(self.contents),
            "warnings": self.findings(),
            "provenance": dict(self.provenance),
        }

    def section(self) -> Section:
        """Return its part of a report."""
        return Section(
            title="The best motion that an arm can run", computed=[*self.verdicts()[1:], COMPUTED],
            findings=self.findings(), tables=self.tables(), drawings=self.drawings(),
            details=source_tables(self.provenance), assumptions=ASSUMPTIONS, provenance=self.provenance,
            verdict=self.verdicts()[0],
        )  # fmt: skip


def _expanded(candidate: Candidate) -> np.ndarray:
    """Three standard deviations of the ten parameters, in thousandths of SI."""
    return np.asarray(GRAM_METRE * 3 * np.sqrt(np.diag(candidate.covariance)))


def arm_report(design: ArmDesign, *, rehearsal: float | None = None, out: Path | None = None) -> ArmDesignReport:
    """Simulate a designed motion and make its files, a slower rehearsal among them if it is wanted.

    Args:
        design: by :func:`uq.arm.arm_design.design_arm`.
        rehearsal: part of the motion's own speed, above 0 and at most 1.
        out: folder where the files are written before the simulation, which may fail; None: nowhere.

    Raises:
        ExperimentError: MuJoCo cannot read the URDF.
        RigError: MuJoCo is not installed.
        OSError: the folder cannot be written.
    """
    arm, series, experiment = design.limits.arm, design.designed.series, design.experiment
    contents = joint_files(arm, series)
    if rehearsal is not None:
        contents |= joint_files(arm, series, "rehearsal", rehearsal)
    if out is not None:
        place(contents, out)
    run = simulated(arm, experiment.body, experiment.gravity, series)
    return ArmDesignReport(design, run, contents, provenance(**experiment.inputs(), goal=design.goal))


COMPUTED = (
    "3σ is three standard deviations of the best linear estimate of all ten parameters from force and moment under "
    "their declared white noise, the load cell's offsets estimated along. Both other motions are common practice in "
    "the same time, as large as the same limits allow."
)
MOTION_NOTE = "r_CG: the largest of its three. Random: the best of several Fourier series of five harmonics."
LIMIT_NOTE = "Over the whole run with its ramps, on a grid ten times finer than the search's."
ASSUMPTIONS = (
    "The body is rigid; joints are perfect; drives have neither friction nor inertia of their own.",
    "In the simulation computed torque with 0.8 of the payload, and feedback of 12 Hz, drives the joints.",
    "The tool's motion is known without error.",
)
