"""The report of an arm's design: predicted uncertainty beside common practice, limits, simulation, files.

The files: the joint motion, each read back and compared with it, and ``identify.toml``, the experiment that identifies
the payload from a recording of the motion.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

from identify.motion.limit_peaks import Peak
from identify.motion.serial_arm.joint_series import JointSeries, JointStates
from identify.rigid_body.inertia import GRAM_METRE
from identify.rigid_body.inertial_parameters import by_component
from uq.experiment.arm_table import DeclaredArm
from uq.experiment.experiment import Experiment
from uq.files.output_folder import place
from uq.files.provenance import provenance
from uq.files.toml_text import toml_text
from uq.plan.motion_design.arm.arm import Arm
from uq.plan.motion_design.arm.arm_design import ArmDesign
from uq.plan.motion_design.arm.mujoco_run import MujocoRun, simulated
from uq.plan.motion_design.commanded import JointCommand
from uq.plan.motion_design.motion_formats import written
from uq.plan.motion_design.report import MotionReport
from uq.runs.recorded.urdf_model import urdf_robot

TOLERATED = 0.02
"""Share by which the simulated joints may exceed a limit: they follow their command with error."""


@dataclass(frozen=True, repr=False)
class ArmDesignReport(MotionReport):
    """A design of an arm's motion, its simulation and its files.

    Example: ``arm_report(design_arm(Experiment.load("arm.toml"))).files()``.
    """

    kind = "inertia design arm"
    design: ArmDesign
    run: MujocoRun
    contents: Mapping[str, bytes]
    """Bytes by file name."""
    provenance: Mapping[str, Any] = field(default_factory=dict)

    @property
    def goal(self) -> str:  # type: ignore[override]
        """Goal that the motion was designed for."""
        return self.design.goal

    @property
    def warnings(self) -> list[str]:
        """Warnings that a reader must not miss: contacts, exceeded limits, sources that do not count."""
        texts = [f"In the simulation {contact}: do not run this motion." for contact in self.run.contacts]
        texts += [f"In the simulation {peak}." for peak in self.run.peaks if peak.share > 1 + TOLERATED]
        texts += self.design.limits.clearance.exceptions()
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
            for component, width in by_component(GRAM_METRE * candidate.expanded[4:]).items()
        ]

    def content(self) -> dict[str, Any]:
        """Return what result.json says of this design alone."""
        design = self.design
        return {
            "duration_s": design.duration,
            "motions": {
                name: {
                    "three_sigma": by_component(GRAM_METRE * c.expanded[4:]),
                    "average": {what: GRAM_METRE * value for what, value in c.averages.items()},
                    "mass_three_sigma_kg": float(c.expanded[0]),
                    "cg_three_sigma_m": c.expanded[1:4].tolist(),
                    "peaks": _peaks(c.peaks),
                }
                for name, c in design.motions.items()
            },
            "average_with_undeclared": {
                what: GRAM_METRE * value for what, value in design.with_undeclared.averages.items()
            },
            "starts": [{"goal": goal, "excess": excess} for goal, excess in design.starts],
            "simulation": {
                "tracking_error": dict(zip(design.limits.arm.names, self.run.tracking_error.tolist(), strict=True)),
                "peaks": _peaks(self.run.peaks),
                "contacts": list(self.run.contacts),
            },
        }


def _peaks(peaks: Sequence[Peak]) -> list[dict[str, Any]]:
    return [{name: getattr(peak, name) for name in ("quantity", "share", "where", "t")} for peak in peaks]


def arm_report(design: ArmDesign, *, rehearsal: float | None = None, out: Path | None = None) -> ArmDesignReport:
    """Simulate a designed motion and make its files, a slower rehearsal among them if it is wanted.

    Args:
        design: by :func:`uq.plan.motion_design.arm.arm_design.design_arm`.
        rehearsal: part of the motion's own speed, above 0 and at most 1.
        out: folder where the files are written before the simulation, which may fail; None: nowhere.

    Raises:
        ExperimentError: MuJoCo cannot read the URDF.
        RigError: MuJoCo is not installed.
        OSError: the folder cannot be written.
    """
    arm, series, experiment = design.limits.arm, design.designed.series, design.experiment
    contents = joint_files(arm, series) | payload_experiment(experiment, arm.declared)
    if rehearsal is not None:
        contents |= joint_files(arm, series, "rehearsal", rehearsal)
    if out is not None:
        place(contents, out)
    run = simulated(arm, experiment.body, experiment.gravity, series, design.limits.clearance.may_touch)
    return ArmDesignReport(design, run, contents, provenance(**experiment.inputs(), goal=design.goal))


def joint_files(arm: Arm, series: JointSeries, name: str = "motion", speed: float = 1.0) -> dict[str, bytes]:
    """Return the motion's files by name, from rest to rest at the arm's rate; ``speed`` stretches the time.

    Raises:
        RuntimeError: a file does not say what it should.
    """
    count = int(np.ceil(series.duration / speed * arm.declared.rate - 1e-9)) + 1
    t = np.arange(count) / arm.declared.rate
    position, rate, acceleration = series.sampled(t * speed)
    joints = JointStates(position, speed * rate, speed**2 * acceleration)
    command = JointCommand(arm.names, t, joints, turning=not any(arm.chain.prismatic))
    return {file.name: file.content for file in written(command, name)}


NAME = "identify.toml"
ANYWHERE = "0.1 m"
"""Standard uncertainty of a centre of gravity that is a first guess."""


def payload_experiment(experiment: Experiment, arm: DeclaredArm) -> dict[str, bytes]:
    """Return the experiment and its URDF, whose other joints are fixed, by their names.

    By method ``joint``, from the wrench and the joints' positions: mass, centre of gravity and tensor are unknown, the
    sources of force and moment as declared. Of the sensor it says that its axes are those of ``platform.tool`` and that
    it reads what the payload does to it: ``inertia inspect`` names what is otherwise.
    """
    document: dict[str, Any] = dict(experiment.document)
    band = document["platform"]["limits"]["bandwidth"]
    urdf = Path(arm.urdf).name
    guess = {"name": "r_cg", "target": "r_cg", "kind": "bias", "sigma": [ANYWHERE] * 3, "group": "first guess"}
    content = {
        "body": {"r_cg_from_q": document["body"]["r_cg_from_q"]},
        "platform": {"gravity": f"{experiment.gravity!r} m/s^2"},
        "estimator": [{"name": "smoothed", "differentiator": "savitzky-golay", "band": band}],
        "source": [guess, *(source for source in document["source"] if source["target"] in ("F", "M", "wrench"))],
        "recording": {
            "wrench": "on_sensor",
            "wrench_rotation_to_body": "x, y, z",
            "method": "joint",
            "urdf": urdf,
            "urdf_frame": arm.tool,
            "urdf_gravity": ["0 m/s^2", "0 m/s^2", f"{-experiment.gravity!r} m/s^2"],
            "sigma_rotation": "0 deg",
            "sigma_gyro_bias": "0 rad/s",
            "sigma_accelerometer_bias": "0 m/s^2",
        },
    }
    robot = ElementTree.tostring(urdf_robot(arm.urdf, "platform.urdf", arm.fixed), "unicode")
    return {NAME: toml_text(content).encode(), urdf: robot.encode()}
