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
    # of each choice: words, the key that declares it, the value; as declared first
    other = OTHER[str(poses.takes)]
    directions = ("", "", str(poses.takes)), ("taken the other way", f'takes = "{other}" in [poses]', other)
    downs = ("", "", gravity), ("with gravity along other axes", "urdf_gravity = [{gravity}] in [recording]", None)
    frames = _frames(at_rest=recording.turns_back)
    readings = []
    for order, direction, frame, down in product(_orders(poses), directions, frames, downs):
        if frame[0] and direction[0]:  # the same as gravity along other axes, weight and zero swapped
            continue
        reading, columns = order[2]
        try:
            to_rest = rotations(values[:, columns], msgspec.structs.replace(reading, takes=direction[2]), name)
        except RunError:
            continue
        changed = [(how, cure) for how, cure, _ in (order, direction, frame, down) if how]
        readings.append(
            PoseReading(
                how=" and ".join(how for how, _ in changed), cure="set " + " and ".join(cure for _, cure in changed),
                to_rest=to_rest @ to_body.T, at_rest=frame[2], gravity=down[2], changes=len(changed),
            )
        )  # fmt: skip
    return tuple(readings)


def _frames(*, at_rest: bool) -> tuple[tuple[str, str, bool], ...]:
    """The axes of the wrench, those declared first."""
    if at_rest:
        return ("", "", True), ("with the wrench along axes that turn", 'wrench_frame = "sensor" in [recording]', False)
    return ("", "", False), ("with the wrench along axes at rest", 'wrench_frame = "base" in [recording]', True)


def _orders(poses: Poses) -> Iterator[tuple[str, str, tuple[Poses, list[int]]]]:
    """Orders of a quaternion's components, or conventions of angles, those declared first."""
    columns = poses.columns.names[str(poses.attitude)]
    declared = list(range(len(columns)))
    yield "", "", (poses, declared)
    if poses.quaternion is not None:  # w stands first where others have it last
        for order in ([3, 0, 1, 2], [1, 2, 3, 0]):
            by_component = ", ".join(f'{name} = "{columns[k]}"' for name, k in zip("wxyz", order, strict=True))
            cure = f"quaternion = {{ {by_component} }} in [poses]"
            yield "with the quaternion's components in another order", cure, (poses, order)
    if poses.euler is not None:
        for axes in sorted({*CONVENTIONS.values(), "zyx"} - {str(poses.euler_convention)}):
            cure = f'euler_convention = "{axes}" in [poses]'
            yield f"with angles about {axes}", cure, (msgspec.structs.replace(poses, euler_convention=axes), declared)
