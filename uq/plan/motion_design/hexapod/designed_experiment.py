"""A designed trajectory as an experiment file that runs as it is: ``designed.toml`` and the files that it names."""

import copy
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from identify.motion.multisine import Multisine
from identify.motion.trajectory import Harmonic, Sphere
from uq.experiment.experiment import Experiment, ExperimentError, TrajectorySpec
from uq.experiment.multisine_table import multisine_csv
from uq.files.toml_text import toml_text
from uq.plan.measurement.pose_plan import DECLARATION

NAME = "designed"


def designed_files(experiment: Experiment, spec: TrajectorySpec, band: float) -> dict[str, bytes]:
    """Return ``designed.toml`` with what it names: the experiment with the designed trajectory.

    Its only estimator is named ``designed`` too, matched to the design's band, which holds that of every slower
    trajectory; ``[poses]`` reads the list of static poses, unless the experiment declares others.

    Args:
        experiment: as it was read; its file's other content stays.
        spec: the designed trajectory.
        band: its highest frequency [Hz].

    Raises:
        ExperimentError: the experiment was not read from a file or document, or a file that it names is missing.
    """
    if not experiment.document:
        raise ExperimentError("this experiment is of no file: read it by Experiment.load or Experiment.from_dict")
    document: dict[str, Any] = copy.deepcopy(dict(experiment.document))
    document["trajectory"] = {k: v for k, v in document.get("trajectory", {}).items() if k != NAME}
    files = dict(_carried(document, experiment.folder))
    document["trajectory"][NAME] = trajectory_table(spec)
    document["estimator"] = [
        {"name": NAME, "method": "ols", "differentiator": "savitzky-golay", "band": f"{band:.12g} Hz"}
    ]
    document["recording"] = {**document.get("recording", {}), "estimator": NAME}
    document.setdefault("poses", dict(DECLARATION))
    if isinstance(spec.trajectory, Multisine):
        files[f"{NAME}.csv"] = multisine_csv(spec.trajectory).encode()
    return {f"{NAME}.toml": toml_text(document).encode(), **files}


def trajectory_table(spec: TrajectorySpec) -> dict[str, Any]:
    """Return the table ``[trajectory.NAME]`` of a trajectory; a multisine's amplitudes stand in ``designed.csv``.

    Raises:
        ExperimentError: a trajectory that no file can hold.
    """
    trajectory: Any = spec.trajectory
    common = {
        "still": spec.still, "duration": f"{spec.duration!r} s", "rate": f"{spec.rate!r} Hz",
        "ramp": f"{float(trajectory.ramp)!r} s",
    }  # fmt: skip
    if isinstance(trajectory, Multisine):
        return {"kind": "multisine", "amplitudes": f"{NAME}.csv", **common}
    if not isinstance(trajectory, (Sphere, Harmonic)):
        raise ExperimentError(f"a {type(trajectory).__name__.lower()} cannot stand in an experiment file")
    units = {"angular_velocity": "rad/s", "angular_acceleration": "rad/s^2"}
    speeds = {key: f"{float(getattr(trajectory, key))!r} {unit}" for key, unit in units.items()}
    if isinstance(trajectory, Harmonic):
        return {"kind": "harmonic", **common, **speeds}
    if float(trajectory.precessions) != round(float(trajectory.precessions)):
        raise ExperimentError("a sphere without a whole number of precessions cannot stand in an experiment file")
    turns = {"precessions": int(np.round(trajectory.precessions)), "pole": f"b{trajectory.pole + 1}"}
    return {"kind": "sphere", **common, **speeds, **turns}


def _carried(document: dict[str, Any], folder: Path) -> Iterator[tuple[str, bytes]]:
    """The files that a document names, which are to stand beside it; it names them by their last part from then on."""
    taken: dict[str, Path] = {}
    tables = [(table, "amplitudes") for table in document["trajectory"].values()]
    tables += [(table, "samples") for table in document.get("source", [])]
    tables += [(document.get("recording", {}), "urdf")]
    for table, key in tables:
        if isinstance(table.get(key), str):
            path = Path(folder, table[key])
            if taken.setdefault(path.name, path) != path or path.name == f"{NAME}.csv":
                raise ExperimentError(f"two files are named {path.name}: rename one, or {NAME}.toml cannot stand alone")
            table[key] = path.name
            yield path.name, path.read_bytes()
