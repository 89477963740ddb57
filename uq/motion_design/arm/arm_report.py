"""The report of an arm's design: predicted uncertainty beside common practice, limits, simulation, files."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from identify.motion.limit_peaks import Peak
from identify.reporting import Drawing
from identify.rigid_body.inertia import COMPONENTS, GRAM_METRE
from identify.rounding import fixed
from identify.text_tables import Table
from uq.files.output_folder import place
from uq.files.provenance import provenance
from uq.motion_design.arm.arm_design import ArmDesign
from uq.motion_design.arm.joint_export import joint_files
from uq.motion_design.arm.joint_search import Candidate
from uq.motion_design.arm.mujoco_run import MujocoRun, simulated
from uq.motion_design.arm.predicted_payload import average_expanded
from uq.motion_design.report import MotionReport, by_component, peak_cells
from uq.report.figures.style import PALETTE

NAMES = {"designed": "designed", "random": "best random series", "single": "one joint at a time"}
SHOWN = 12.0
"""Length of the motion that the figure shows, from its start [s]."""
TOLERATED = 0.02
"""Share by which the simulated joints may exceed a limit: they follow their command with error."""


@dataclass(frozen=True, repr=False)
class ArmDesignReport(MotionReport):
    """A design of an arm's motion, its simulation and its files.

    Example: ``arm_report(design_arm(Experiment.load("arm.toml"))).files()``.
    """

    kind = "inertia design arm"
    heading = "The best motion that an arm can run"
    method = (
        "3σ is three standard deviations of the best linear estimate of all ten parameters from force and moment under "
        "their declared white noise, the load cell's offsets estimated along. Both other motions are common practice "
        "in the same time, as large as the same limits allow."
    )
    design: ArmDesign
    run: MujocoRun
    contents: Mapping[str, bytes]
    """Bytes by file name."""
    provenance: Mapping[str, Any] = field(default_factory=dict)

    @property
    def goal(self) -> str:  # type: ignore[override]
        """Goal that the motion was designed for."""
        return self.design.goal

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

    def motion_table(self) -> Table:
        """Return the predicted 3σ of the ten parameters, by motion."""
        rows = []
        for name, candidate in self.design.motions.items():
            mass, *r_cg_and_tensor = _expanded(candidate)
            averages = [GRAM_METRE * x for x in average_expanded(candidate.covariance).values()]
            values = (mass, max(r_cg_and_tensor[:3]), *r_cg_and_tensor[3:], *averages)
            rows.append([NAMES[name], *(f"{x:.3g}" for x in values)])
        head = ["3σ", "mass, g", "r_CG, mm", *(f"{name}, g·m²" for name in COMPONENTS), "moments", "products"]
        return Table("Predicted 3σ of each motion", head, rows, MOTION_NOTE)

    def limit_table(self) -> Table:
        """Return each limit's largest use by the command, and by the simulated arm."""
        ran = {peak.quantity: peak for peak in self.run.peaks}
        rows = []
        for peak in self.design.designed.peaks:
            seen = f"{100 * ran[peak.quantity].share:.1f}" if peak.quantity in ran else "–"
            rows.append([*peak_cells(peak, peak.where), seen])
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

    def records(self) -> list[dict[str, Any]]:
        """Return 3σ by motion and component, in g·m²."""
        return [
            {"motion": name, "component": component, "three_sigma": width}
            for name, candidate in self.design.motions.items()
            for component, width in by_component(_expanded(candidate)[4:]).items()
        ]

    def drawings(self) -> list[Drawing]:
        """Return the joints' positions and speeds over the run."""
        return [Drawing("joints", "The joints' positions and speeds, as commanded.", self._draw_joints)]

    def _draw_joints(self) -> Any:
        from uq.motion_design.time_figure import time_figure

        arm, design = self.design.limits.arm, self.design
        t = np.linspace(0.0, min(SHOWN, design.duration), 600)
        shares = arm.joint_shares(design.designed.series.sampled(t))
        figure: Any = time_figure(t, {f"{what} / limit": share for what, share in shares.items()}, arm.names, PALETTE)
        for panel in figure.axes:
            panel.set_ylim(-1.05, 1.05)
        return figure

    def content(self) -> dict[str, Any]:
        """Return what result.json says of this design alone."""
        design = self.design
        return {
            "duration_s": design.duration,
            "motions": {
                name: {
                    "three_sigma": by_component(_expanded(c)[4:]),
                    "average": {what: GRAM_METRE * value for what, value in average_expanded(c.covariance).items()},
                    "mass_three_sigma_kg": float(_expanded(c)[0]) / GRAM_METRE,
                    "cg_three_sigma_m": (_expanded(c)[1:4] / GRAM_METRE).tolist(),
                    "peaks": _peaks(c.peaks),
                }
                for name, c in design.motions.items()
            },
            "starts": [{"goal": goal, "excess": excess} for goal, excess in design.starts],
            "simulation": {
                "tracking_error": dict(zip(design.limits.arm.names, self.run.tracking_error.tolist(), strict=True)),
                "peaks": _peaks(self.run.peaks),
                "contacts": list(self.run.contacts),
            },
        }

    def assumptions(self) -> Sequence[str]:
        """Return what the prediction and the simulation assume."""
        return ASSUMPTIONS


def _peaks(peaks: Sequence[Peak]) -> list[dict[str, Any]]:
    return [{name: getattr(peak, name) for name in ("quantity", "share", "where", "t")} for peak in peaks]


def _expanded(candidate: Candidate) -> np.ndarray:
    """Three standard deviations of the ten parameters, in thousandths of SI."""
    return np.asarray(GRAM_METRE * 3 * np.sqrt(np.diag(candidate.covariance)))


def arm_report(design: ArmDesign, *, rehearsal: float | None = None, out: Path | None = None) -> ArmDesignReport:
    """Simulate a designed motion and make its files, a slower rehearsal among them if it is wanted.

    Args:
        design: by :func:`uq.motion_design.arm.arm_design.design_arm`.
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


MOTION_NOTE = "r_CG: the largest of its three. Random: the best of several Fourier series of five harmonics."
LIMIT_NOTE = "Over the whole run with its ramps, on a grid ten times finer than the search's."
ASSUMPTIONS = (
    "The body is rigid; joints are perfect; drives have neither friction nor inertia of their own.",
    "In the simulation computed torque with 0.8 of the payload, and feedback of 12 Hz, drives the joints.",
    "The tool's motion is known without error.",
)
