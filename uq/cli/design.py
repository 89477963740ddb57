"""``inertia design``: the best trajectory that a platform can run."""

import argparse
from pathlib import Path
from typing import Any

from uq.cli.terminal.command_parser import CommandParser
from uq.cli.terminal.common import finish, output_folder, start_jax
from uq.cli.terminal.options import positive_quantity, whole_number
from uq.cli.terminal.sources import add_without_option, shares_named
from uq.cli.terminal.terminal_bar import TerminalBar
from uq.experiment.experiment import Experiment, ExperimentError
from uq.plan.measurement.pose_plan import POSES, plan_poses
from uq.plan.motion_design.hexapod.design import design
from uq.plan.motion_design.hexapod.design_report import design_report
from uq.plan.motion_design.hexapod.motion_export import export_motion


def configure(parser: CommandParser) -> None:
    """Add the command's arguments."""
    parser.value("experiment", "EXPERIMENT.toml", "body, sources, [platform] geometry and limits")
    parser.value("--out", "DIR", "folder for result.json, report.html, designed.toml and the motion")
    parser.value(
        "--goal", "GOAL", "quantities to be known best: all, moments, products, worst, 'axis 1' to 'axis 3' (all)"
    )
    parser.value(
        "--objective", "OBJECTIVE",
        text="figure of a component that counts: rms, 3√(σ² + mean error²), or 3sigma, the dispersion alone (rms)",
    )  # fmt: skip
    parser.value("--reference", "NAME", "the trajectory to be beaten (the first)")
    parser.value("--duration", "'180 s'", "duration of the run (the reference's)")
    parser.value("--period", "'5 s'", "period of motions without stages, which repeat it, and of an arm's motion (5 s)")
    parser.value("--starts", "N", "motions to start from, minutes each; the first in stages (1)", type=whole_number)
    parser.value("--seed", "N", "seed of the starts (0)", type=whole_number)
    parser.value(
        "--target", "'1 g*m^2'", action="append",
        text="find the duration for this average 3σ of moments and of products; repeatable (half of the design's)",
    )  # fmt: skip
    parser.value("--poses", "N", f"static poses to plan, 0 for none ({POSES})", type=whole_number)
    parser.value("--rehearsal", "PART", "export the motion at this part of its speed, too, such as 0.5", type=float)
    parser.value("--rehearsal-amplitude", "PART", "part of the amplitude in the rehearsal (1)", type=float)
    add_without_option(parser)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    _check(arguments)
    targets = [positive_quantity("--target", text, "kg*m^2") for text in arguments.target or ()]
    given: dict[str, Any] = {
        name: positive_quantity(f"--{name}", text, "s")
        for name in ("duration", "period")
        if (text := getattr(arguments, name)) is not None
    }
    named = {name: getattr(arguments, name) for name in ("goal", "objective", "reference", "starts", "seed")}
    given |= {name: value for name, value in named.items() if value is not None}
    start_jax()
    experiment = Experiment.load(arguments.experiment).without_source(*arguments.without)
    with output_folder(arguments.out) as out:
        if experiment.arm is not None:
            _design_arm(arguments, experiment, given, out)
            return 0
        with TerminalBar(unit="steps", lines=True) as bar, shares_named(experiment, out):
            designed = design(experiment, progress=bar, **given)
            report = design_report(designed, goal=given.get("goal", "all"), targets=targets, progress=bar)
        more: list[Any] = [export_motion(experiment, designed.spec)]
        speed, amplitude = arguments.rehearsal, arguments.rehearsal_amplitude
        if speed or amplitude:
            shares = {"speed": speed or 1.0, "amplitude": amplitude or 1.0}
            more.append(export_motion(experiment, designed.spec, name="rehearsal", **shares))
        count = POSES if arguments.poses is None else arguments.poses
        if count:
            more.append(plan_poses(experiment, designed.spec, designed.limits, count=count, seed=given.get("seed", 0)))
        finish(report, out, *more)
    return 0


def _design_arm(arguments: argparse.Namespace, experiment: Experiment, given: dict[str, Any], out: Path | None) -> None:
    """Design the joint motion of an arm."""
    from uq.plan.motion_design.arm.arm_design import design_arm
    from uq.plan.motion_design.arm.arm_report import arm_report

    for option in _given(arguments, "objective", "reference", "target", "poses", "rehearsal_amplitude"):
        raise ExperimentError(f"{option} is for a platform on six legs, not for an arm: remove it")
    with TerminalBar(unit="steps", lines=True) as bar:
        designed = design_arm(experiment, progress=bar, **given)
    finish(arm_report(designed, rehearsal=arguments.rehearsal, out=out), out)


def _check(arguments: argparse.Namespace) -> None:
    """Refuse options that cannot be before anything is computed."""
    for option in _given(arguments, "rehearsal", "rehearsal_amplitude"):
        fraction = getattr(arguments, option[2:].replace("-", "_"))
        if not 0 < fraction <= 1:
            raise ExperimentError(f"{option} is {fraction:g}: give a part above 0 and at most 1")
    if arguments.poses is not None and arguments.poses != 0 and arguments.poses < 3:
        raise ExperimentError(f"--poses is {arguments.poses}: ask for three or more, or 0 for none")


def _given(arguments: argparse.Namespace, *names: str) -> list[str]:
    """Return which of these options are given."""
    return [f"--{name.replace('_', '-')}" for name in names if getattr(arguments, name) is not None]
