"""Other ways to read the attitudes of a table of static poses than that declared, with the keys that declare each."""

from collections.abc import Iterator
from itertools import product

import msgspec
import numpy as np

from identify.judge.conventions.pose_findings import PoseReading
from identify.signals.run import RunError
from uq.experiment.experiment import Experiment
from uq.experiment.pose_table import CONVENTIONS, Poses, rotations

OTHER = {"sensor_to_level": "level_to_sensor", "level_to_sensor": "sensor_to_level"}


def pose_readings(
    values: np.ndarray, experiment: Experiment, to_body: np.ndarray, name: str
) -> tuple[PoseReading, ...]:
    """Return the ways to read a table's attitudes, that declared first.

    Args:
        values: columns of the attitude.
        experiment: what is declared of poses and recording.
        to_body: rotation from the axes of the attitude's sensor to the body's.
        name: what messages call the table.
    """
    poses, recording = experiment.poses, experiment.recording
    assert poses is not None  # noqa: S101 - the table was read by it
    gravity = recording.gravity_of_poses
    gravity = experiment.gravity / np.linalg.norm(gravity) * gravity
    readings = []
    for (how, cure, reading, order), (frame, frame_cure, at_rest) in product(
        _attitudes(poses), _frames(at_rest=recording.turns_back)
    ):
        if frame and reading.takes != poses.takes:  # the same as gravity along other axes, weight and zero swapped
            continue
        try:
            to_rest = rotations(values[:, order], reading, name) @ to_body.T
        except RunError:
            continue
        for leaning in (False, True):
            hows = list(filter(None, [*how, frame, "with gravity along other axes" if leaning else ""]))
            cures = filter(None, [*cure, frame_cure, "urdf_gravity = [{gravity}] in [recording]" if leaning else ""])
            readings.append(
                PoseReading(
                    how=" and ".join(hows), cure="set " + " and ".join(cures), to_rest=to_rest, at_rest=at_rest,
                    gravity=None if leaning else gravity, changes=len(hows),
                )
            )  # fmt: skip
    return tuple(readings)


def _frames(*, at_rest: bool) -> tuple[tuple[str, str, bool], ...]:
    """The axes of the wrench, those declared first."""
    if at_rest:
        return ("", "", True), ("with the wrench along axes that turn", 'wrench_frame = "sensor" in [recording]', False)
    return ("", "", False), ("with the wrench along axes at rest", 'wrench_frame = "base" in [recording]', True)


def _attitudes(poses: Poses) -> Iterator[tuple[tuple[str, ...], tuple[str, ...], Poses, list[int]]]:
    """Other declarations of the attitude, each with words, keys, and the order of the columns."""
    other = OTHER[str(poses.takes)]
    for how, cure, reading, order in _orders(poses):
        yield (how,), (cure,), reading, order
        taken = msgspec.structs.replace(reading, takes=other)
        yield (how, "taken the other way"), (cure, f'takes = "{other}" in [poses]'), taken, order


def _orders(poses: Poses) -> Iterator[tuple[str, str, Poses, list[int]]]:
    """Other orders of a quaternion's components, or other conventions of angles."""
    columns = poses.columns.names[str(poses.attitude)]
    declared = list(range(len(columns)))
    yield "", "", poses, declared
    if poses.quaternion is not None:  # w stands first where others have it last
        for order in ([3, 0, 1, 2], [1, 2, 3, 0]):
            by_component = ", ".join(f'{name} = "{columns[k]}"' for name, k in zip("wxyz", order, strict=True))
            cure = f"quaternion = {{ {by_component} }} in [poses]"
            yield "with the quaternion's components in another order", cure, poses, order
    if poses.euler is not None:
        for axes in sorted({*CONVENTIONS.values(), "zyx"} - {str(poses.euler_convention)}):
            cure = f'euler_convention = "{axes}" in [poses]'
            yield f"with angles about {axes}", cure, msgspec.structs.replace(poses, euler_convention=axes), declared
