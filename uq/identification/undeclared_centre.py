"""Effects on mass and centre of gravity from static poses of errors that are not declared, at typical figures."""

from dataclasses import replace

import numpy as np
from jaxtyping import Float

from identify.static.centre_result import Centre
from uq.experiment.experiment import Experiment
from uq.experiment.typical_errors import typical_errors
from uq.identification.centre_errors import ON_POSES, wrench_error
from uq.identification.estimated_errors import estimated_errors
from uq.identification.undeclared import numbers_of, undeclared_errors


def centre_with_undeclared(
    centre: Centre,
    experiment: Experiment,
    *,
    wrench: Float[np.ndarray, "n 6"],
    specific_force: Float[np.ndarray, "n 3"],
    sensed: bool,
) -> Centre:
    """Return a centre with the errors that its first intervals leave out.

    The load cell's axes count where ``sigma_alignment`` does not declare how far the attitude's are off from them.

    Args:
        centre: of these poses, not read from a file.
        experiment: its sources, and the typical figures.
        wrench: of each pose, whose largest force and moment are the full scale [N, N·m].
        specific_force: of each pose, opposite to gravity [m/s²].
        sensed: whether an accelerometer tells the attitude.
    """
    largest = float(np.abs(wrench[:, :3]).max()), float(np.abs(wrench[:, 3:]).max())
    weight = _wrench(centre, specific_force)
    aligned = experiment.poses is not None and experiment.poses.sigma_alignment > 0
    errors = {}
    for name, error in estimated_errors(typical_errors(experiment, largest), 0.0).items():
        if error.unknown in ON_POSES and not (aligned and name == "load_cell_axes"):
            columns = numbers_of(name, error).T
            errors[name] = [wrench_error(error.unknown, axis, weight, experiment.gravity) for axis in columns]
    scale = experiment.undeclared.accelerometer_scale
    if sensed and scale is not None:
        up = specific_force / np.linalg.norm(specific_force, axis=1, keepdims=True)
        for_axes = [scale * specific_force * axis for axis in np.eye(3)]
        across = [change - up * np.sum(up * change, axis=1, keepdims=True) for change in for_axes]
        errors["accelerometer_scale"] = [-_wrench(centre, change) for change in across]
    by_wrench = np.asarray(centre.by_wrench)
    changes = {name: np.einsum("pnc,knc->pk", by_wrench, np.array(by_axis)) for name, by_axis in errors.items()}
    size = np.repeat([centre.mass, 1.0, centre.mass * centre.gravity], [1, 3, 6])
    return replace(centre, undeclared=undeclared_errors(changes, size, experiment))


def _wrench(centre: Centre, specific_force: np.ndarray) -> Float[np.ndarray, "n 6"]:
    """Return the weight's wrench about Q under a specific force."""
    force = centre.mass * specific_force
    return np.hstack([force, np.cross(centre.r_cg, force)])
