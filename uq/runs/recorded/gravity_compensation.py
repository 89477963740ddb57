"""Undo what a driver did to the wrench: a zero set with the body on the cell, its weight removed."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from identify.display.rounding import significant
from identify.least_squares.offsets import rest_of
from identify.rigid_body.dynamics import moment_about
from identify.signals.gravity_direction import UP, upward
from identify.signals.run import Run, RunError
from identify.signals.segments import Segment
from uq.experiment.experiment import Experiment

LEVEL = 0.02
"""Tilt of a rest that counts as level [rad]."""


def undo(run: Run, rests: Sequence[Segment], experiment: Experiment) -> tuple[Run, tuple[str, ...]]:
    """Return a run with the body's weight in its wrench again, and what this assumes.

    Args:
        run: the part of a run that counts, from the rest before it on.
        rests: where the body rests, from the run's first sample.
        experiment: mass, centre of gravity, gravity, and what was done.

    Raises:
        RunError: mass is not stated, or nothing tells the attitude.
    """
    recording = experiment.recording
    if recording.removes_weight:
        mass, removed_at = recording.payload_mass, recording.payload_r_cg_from_q
        if mass is None or removed_at is None:
            mass = _mass(run, experiment, f"compensated is {recording.compensated}")
            removed_at = experiment.stated_r_cg
        r_cg = removed_at if experiment.r_cg_from_q is None else experiment.r_cg_from_q
        weight = mass * experiment.gravity * upward(run, r_cg, rests)
        level = run.specific_force is None and run.gravity is None
        how = "the gyro, level at first" if level else "the accelerometer" if run.gravity is None else "the attitude"
        what = "the declared mass at the declared r_CG" if recording.payload_mass is None else "the declared payload"
        assumption = f"the driver removed {what}, and gravity's direction is that of {how}"
        weighed = _with(run, weight, removed_at, also_moment=recording.compensated == "gravity")
        if level and recording.compensated == "gravity_from_force":
            _check_level(weighed, rests, experiment)
        return weighed, (assumption,)
    if recording.zero == "loaded" and recording.offsets == "none":
        mass = _mass(run, experiment, "zero is loaded, with offsets none")
        weight = np.broadcast_to(mass * experiment.gravity * UP, run.force.shape)
        assumption = "the load cell was zeroed with the body on it at rest and level"
        return _with(run, weight, experiment.stated_r_cg, also_moment=True), (assumption,)
    return run, ()


def _check_level(run: Run, rests: Sequence[Segment], experiment: Experiment) -> None:
    """Refuse a level that the moment at rest contradicts; a tilt and an offset look alike in it."""
    rest = rest_of(run, rests[:1])
    if rest is None:
        raise RunError(
            f"{run.name} has neither accelerometer nor two seconds of level rest before the motion: the weight removed "
            "from the force cannot be put back without"
        )
    r_cg = experiment.stated_r_cg
    # the moment of the weight at right angles to r_CG [N·m]
    weight_moment = max((experiment.mass or 0.0) * experiment.gravity * float(np.linalg.norm(r_cg)), 1e-9)
    tilt = np.linalg.norm(rest.moment - np.cross(r_cg, rest.force)) / weight_moment
    if tilt > LEVEL:
        raise RunError(
            f"the moment at rest before the motion in {run.name} is that of a body tilted by "
            f"{significant(np.rad2deg(tilt), 2)} deg, or an offset: the "
            "weight removed from the force cannot be put back without an accelerometer"
        )


def _mass(run: Run, experiment: Experiment, why: str) -> float:
    if experiment.mass is None:
        payload = ", or payload_mass and payload_r_cg_from_q" if experiment.recording.removes_weight else ""
        raise RunError(f"recording.{why}, and the weight that {run.name} lacks needs the mass: give body.mass{payload}")
    return experiment.mass


def _with(run: Run, force: np.ndarray, r_cg: np.ndarray, *, also_moment: bool) -> Run:
    """The run with a force at the centre of gravity added, and where asked its moment about Q."""
    moment = moment_about(run.moment, force, r_cg) if also_moment else run.moment
    return replace(run, force=run.force + force, moment=moment)
