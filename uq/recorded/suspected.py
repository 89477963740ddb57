"""What in a recorded run contradicts mechanics or the experiment: ``identify`` warns of it."""

from dataclasses import replace

import numpy as np

from identify.signals.run import Run
from rig.channels import ImuChannel, WrenchChannel
from rig.inspection.detective import Declared, detect
from rig.inspection.suspicions import Finding, axes, units
from uq.experiment.experiment import Experiment

NANOSECONDS = 1e9


def suspected(run: Run, experiment: Experiment, *, undone: bool = False) -> list[Finding]:
    """Judge the longest whole stretch of a run that was read as the experiment declares.

    Args:
        run: wrench on the body about Q and motion, in B; without an accelerometer nothing is found.
        experiment: mass and centre of gravity, where stated, and what was declared already.
        undone: whether weight that a driver took off was put back.
    """
    if run.specific_force is None:
        return []
    part = _longest(run)
    stamp = np.round(run.t[part] * NANOSECONDS).astype(np.int64)
    if len(stamp) < 10:
        return []
    wrench = WrenchChannel(run.name, "body", stamp, stamp, run.force[part], run.moment[part])
    imu = ImuChannel(run.name, "body", stamp, stamp, run.omega[part], run.specific_force[part])
    if swapped := list(axes(imu)):
        return [*units(imu), *swapped]
    return [*units(imu), *detect(wrench, imu, declaration(run, experiment, undone=undone))]


def declaration(run: Run, experiment: Experiment, *, undone: bool) -> Declared:
    """What the experiment says of the body and of how the run was recorded."""
    recording = experiment.recording
    removed = recording.compensated in ("gravity", "gravity_from_force") and not undone
    return Declared(
        mass=experiment.mass,
        r_cg=np.asarray(experiment.r_cg_from_q),
        sigma_r_cg=np.asarray(experiment.sigma_r_cg),
        imu_position=run.imu_position,
        wrench_point=recording.wrench_point,
        wrench_rotation=recording.wrench_rotation_to_body,
        imu_rotation=recording.imu_rotation_to_body,
        weighed=recording.zero != "loaded" and not removed,
    )


def warned(run: Run, experiment: Experiment) -> tuple[str, ...]:
    """The findings as warnings of a result."""
    return tuple(
        f"suspicious {replace(finding, topic=run.name)}" for finding in suspected(run, experiment, undone=True)
    )


def _longest(run: Run) -> slice:
    """The longest stretch of samples that may all be used."""
    if run.missing is None:
        return slice(None)
    edges = np.flatnonzero(np.diff(np.concatenate([[True], run.missing, [True]]).astype(np.int8)))
    starts, stops = edges[::2], edges[1::2]
    if not len(starts):
        return slice(0, 0)
    longest = int(np.argmax(stops - starts))
    return slice(int(starts[longest]), int(stops[longest]))
