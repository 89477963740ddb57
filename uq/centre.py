"""Static poses to mass, centre of gravity and offsets: the function behind ``inertia centre``."""

import hashlib
from dataclasses import replace
from pathlib import Path

import numpy as np

from identify.centre import Centre, centre
from identify.frames import moment_about
from uq.columns import read_columns
from uq.document import ExperimentError
from uq.experiment import Experiment
from uq.poses import need_table, of_accelerometer, up
from uq.provenance import provenance
from uq.recording import UNITS, Recording
from uq.units import scale

TABLES = (".csv", ".tsv", ".txt")


def centre_file(path: str | Path, experiment: Experiment) -> Centre:
    """Estimate mass, centre of gravity and the load cell's offsets from static poses.

    Args:
        path: a table with one row a pose (.csv, .tsv, .txt), whose columns ``[poses]`` names.
        experiment: what the columns mean (``[recording]``, ``[poses]``) and local gravity (``[platform]``).

    Raises:
        ExperimentError: nothing declares the columns.
        RunError: the table cannot be used, or its poses do not determine the centre of gravity.
        OSError: the file cannot be read.
    """
    name = Path(path).name
    if Path(path).suffix.lower() not in TABLES:
        raise ExperimentError(f"{name} is no table: give {', '.join(TABLES)}")
    poses, recording = need_table(experiment.poses, path), experiment.recording
    table = read_columns(path, poses.columns)
    notes: list[str] = []
    warnings: tuple[str, ...] = ()
    attitude = table[str(poses.attitude)]
    if poses.attitude == "acceleration":
        readings = attitude * scale(recording.acceleration_unit or UNITS["acceleration"], UNITS["acceleration"])
        specific_force, found, warnings = of_accelerometer(readings, poses, experiment.gravity)
        notes.append(f"the accelerometer's offset is {_vector(found.offset)} m/s², its gain {found.gain:.4f}")
    else:
        specific_force = experiment.gravity * up(attitude, poses, name)
    if recording.imu_rotation_to_body is not None:
        specific_force = specific_force @ recording.imu_rotation_to_body.T
    force, moment = wrench_in_body(table["force"], table["moment"], recording)
    found_centre = centre(force, moment, specific_force, name=name)
    digest = hashlib.sha256(Path(path).read_bytes()).hexdigest()
    return replace(
        found_centre,
        zero=reading_of(np.hstack([found_centre.force_offset, found_centre.moment_offset]), recording),
        warnings=(*found_centre.warnings, *warnings),
        assumptions=(*assumptions(experiment, str(poses.attitude)), *notes),
        provenance=provenance(**experiment.inputs(), inputs=[{"file": str(path), "sha256": digest}]),
    )


def wrench_in_body(force: np.ndarray, moment: np.ndarray, recording: Recording) -> tuple[np.ndarray, np.ndarray]:
    """Return force [N] and moment [N·m] on the body at Q, in B, of readings that ``[recording]`` declares."""
    readings = np.hstack([force, moment])
    if recording.calibration is not None:
        readings = readings @ recording.calibration.T
    sign = -1.0 if recording.wrench == "on_sensor" else 1.0
    turn = np.eye(3) if recording.wrench_rotation_to_body is None else recording.wrench_rotation_to_body
    units = [scale(recording.unit(name) or UNITS[name], UNITS[name]) for name in ("force", "moment")]
    on_body, about_point = (
        sign * unit * values @ turn.T for unit, values in zip(units, (readings[:, :3], readings[:, 3:]), strict=True)
    )
    point = np.zeros(3) if recording.wrench_point is None else recording.wrench_point
    return on_body, moment_about(about_point, on_body, point)


def reading_of(wrench: np.ndarray, recording: Recording) -> np.ndarray:
    """Return what the cell reads [N, N·m] of a wrench (6,) on the body at Q: in its own sign and axes."""
    sign = -1.0 if recording.wrench == "on_sensor" else 1.0
    turn = np.eye(3) if recording.wrench_rotation_to_body is None else recording.wrench_rotation_to_body
    point = np.zeros(3) if recording.wrench_point is None else recording.wrench_point
    force, moment = wrench[:3], wrench[3:] - np.cross(point, wrench[:3])
    return sign * np.concatenate([turn.T @ force, turn.T @ moment])


def assumptions(experiment: Experiment, attitude: str) -> tuple[str, ...]:
    """Return what nothing declares."""
    recording, found = experiment.recording, ["the attitudes are free of errors"]
    if recording.wrench is None:
        found.append("the wrench is that on the body")
    if recording.wrench_rotation_to_body is None:
        found.append("the load cell's axes are the body's")
    if recording.imu_rotation_to_body is None:
        found.append("the attitude is that of the body's axes")
    found += [
        f"the {name} is in {UNITS[name]}"
        for name in ("force", "moment", *(["acceleration"] if attitude == "acceleration" else []))
        if recording.unit(name) is None
    ]
    if "gravity" not in experiment.document.get("platform", {}):
        found.append(f"local gravity is {experiment.gravity:g} m/s²")
    return tuple(found)


def _vector(values: np.ndarray) -> str:
    return "(" + ", ".join(f"{value:.3g}" for value in values).replace("-", "−") + ")"
