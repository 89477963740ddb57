"""Declared errors of the load cell and of gravity in static poses: what they do to mass and centre of gravity.

The same errors act in the runs that are identified with this centre, so they keep their names: ``F_gain 1`` is the
first axis of the source ``F_gain``, one standard uncertainty of it.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from jaxtyping import Float

from identify.estimation.joint.priors import axes_of
from identify.estimation.static_poses.centre_result import Centre
from identify.exceptions import RunError
from uq.experiment.experiment import Experiment
from uq.runs.identification.estimated_errors import estimated_errors

FIGURES = ("target", "kind", "sigma", "shape", "settings")
"""Fields of a source that decide its effect on static poses, beside the correlation of its axes."""
ON_POSES = ("cell_matrix", "gravity")
"""Unknowns of :data:`identify.estimation.joint.joint_model.SIZES` whose errors act on the weight."""
ATTITUDE_AXIS = "attitude axis "
"""Prefix of the names of an attitude sensor's lasting errors; a source's name has no space."""
ATTITUDE = ("sigma_attitude", "sigma_alignment", "sigma_accelerometer")
"""Keys of the table ``[poses]`` that decide the effect of its errors."""


def weight_errors(
    experiment: Experiment, weight: Float[np.ndarray, "n 6"]
) -> tuple[Float[np.ndarray, "n 6 k"], tuple[str, ...]]:
    """Return what declared errors, of one standard uncertainty each, do to the wrench of static poses, and their names.

    Args:
        experiment: its sources and gravity.
        weight: wrench of the weight alone [N, N·m].
    """
    effects = {
        name: np.sum([wrench_error(*part, weight, experiment.gravity) for part in parts], axis=0)
        for name, every in axes_of(estimated_errors(experiment, 0.0)).items()
        if (parts := [part for part in every if part.unknown in ON_POSES and part.numbers.any()])
    }
    columns = np.stack(list(effects.values()), axis=2) if effects else np.zeros((*weight.shape, 0))
    return columns, tuple(effects)


def calibrated_error(experiment: Experiment, weight: Float[np.ndarray, "n 6"]) -> Float[np.ndarray, "n 6"]:
    """Return what the means of calibrated sources do to the wrench of static poses, which are corrected by it.

    Args:
        experiment: its sources, calibrations and gravity.
        weight: wrench of the weight alone [N, N·m].
    """
    groups = {calibration.group for calibration in experiment.calibrations}
    names = {source.name for source in experiment.sources if source.group in groups}
    errors = [error for name, error in estimated_errors(experiment, 0.0).items() if name in names]
    parts = [
        wrench_error(error.unknown, error.mean, weight, experiment.gravity)
        for error in errors
        if error.unknown in ON_POSES
    ]
    return np.sum([np.zeros_like(weight), *parts], axis=0)


def wrench_error(
    unknown: str, error: Float[np.ndarray, " p"], weight: Float[np.ndarray, "n 6"], gravity: float
) -> Float[np.ndarray, "n 6"]:
    """Return what an error of :data:`ON_POSES` does to the wrench of static poses.

    Args:
        unknown: what errs.
        error: its numbers: the load cell's matrix less the unit matrix, row by row; gravity [m/s²].
        weight: wrench of the weight alone [N, N·m].
        gravity: stated [m/s²].
    """
    return weight @ error.reshape(6, 6).T if unknown == "cell_matrix" else weight * error[0] / gravity


def check_declared(experiment: Experiment, centre: Centre, name: str) -> None:
    """Refuse a centre whose covariance holds other errors than those that the experiment declares.

    The runs would count an error in the wrench that mass and centre of gravity are free of, or the other way about.

    Args:
        experiment: its sources, and its table ``[poses]`` where it has one.
        centre: of static poses.
        name: what the message calls it.

    Raises:
        RunError: a source that acts on static poses, or an uncertainty of the attitudes, was declared, changed or
            removed since.
    """
    now, then = experiment.inputs()["resolved"], centre.provenance.get("resolved")
    _, labels = weight_errors(experiment, np.zeros((1, 6)))
    declared, held = (
        dict.fromkeys(label.rpartition(" ")[0] for label in axes if not label.startswith(ATTITUDE_AXIS))
        for axes in (labels, centre.lasting_names)
    )
    changed = [source for source in declared if source in held and _figures(now, source) != _figures(then, source)]
    poses = then.get("poses") if isinstance(then, Mapping) else None
    if experiment.poses is not None:
        stated = poses if isinstance(poses, Mapping) else {}
        changed += [f"poses.{key}" for key in ATTITUDE if getattr(experiment.poses, key) != stated.get(key, 0.0)]
    differences = {
        "without": [source for source in declared if source not in held],
        "with other figures of": changed,
        "with": [f"{source}, which is no longer declared" for source in held if source not in declared],
    }
    made = "; ".join(f"{how} {', '.join(names)}" for how, names in differences.items() if names)
    if made:
        raise RunError(f"{name} was made {made}: run `inertia centre` again with what is declared now")


def _figures(resolved: Any, name: str) -> list[Any]:
    """The figures of a source, or of a calibration's, and the correlation of its axes, as a provenance has them."""
    try:
        members = [source for source in resolved["sources"] if name in (source["name"], source["group"])]
        figures = [[source[key] for key in FIGURES] for source in members]
        for mix in resolved["mixing"]:
            if name in mix["names"]:
                number = mix["names"].index(name)
                first, end = sum(mix["axes"][:number]), sum(mix["axes"][: number + 1])
                figures.append([row[first:end] for row in mix["correlation"][first:end]])
    except (AttributeError, KeyError, TypeError, ValueError):  # a file that was changed by hand
        return []
    return figures
